//! Reads laser scans from files: structured E57, PTX, and XYZ with row and column.
//!
//! # What it does
//! It recognises the format from the content, checks that the file is complete, decides from the geometry how rows
//! and columns lie, which way the frame turns and whether the file is in metres or millimetres, and delivers the
//! lattice column by column in the scanner's frame. Every decision becomes a sentence of the scan's notes. The
//! file is opened for reading only; it is never locked, changed or deleted.
//!
//! Missing cells may be flagged, left out, written as the origin or as NaN. A pose in the file is reported and not
//! applied. Formats that hold no lattice, or that only their maker's software reads (`.fls`, `.fws`, `.lsproj`,
//! `.las`, `.pts`, `.pod`, `.cpe`), are refused with what to export instead.
//!
//! # Example
//! ```toml
//! [scanner]
//! plugin = "faro-file"
//! [scanner.options]
//! file = "scan.e57"
//! ```
//!
//! | key | meaning |
//! |---|---|
//! | `file` | the scan |
//! | `cloud` | which scan of a file that holds several, from 1 |
//! | `turn` | which way columns run in this scanner's files; the other way is refused as mirrored |
//! | `mirror` | the axis to mirror where the exporter writes a left-handed frame |
//! | `cut_azimuth_deg` | where a full circle is cut open, so that the plate is not |

mod device;
mod e57;
mod error;
mod open;
mod ptx;
mod source;
mod text;
mod xyz;

use std::path::PathBuf;

use platen_scan::orient::{Expected, Mirror, Turn};
use platen_sdk::{Info, Job, Result, ScanSink, Scanner, options};

options! {
    /// Options of the file driver; the module head is their manual.
    pub struct Options {
        /// The scan file.
        file: Option<PathBuf>;
        /// Which scan of a file that holds several, from 1.
        cloud: Option<i64>, min 1;
        /// Which way columns run by growing number in this scanner's files, seen from above, where that is known:
        /// a scan that runs the other way is mirrored and refused.
        turn: String = "any", choices ["any", "clockwise", "counter_clockwise"];
        /// Axis to mirror where the exporter writes a left-handed frame.
        mirror: String = "none", choices ["none", "x", "y"];
        /// Azimuth at which a full circle is cut open, so that the plate is not.
        cut_azimuth_deg: Option<f64>, unit "deg", min -360.0, max 360.0;
    }
}

/// The driver.
#[derive(Debug)]
pub struct FaroFile {
    options: Options,
    known: Expected,
}

impl Scanner for FaroFile {
    const INFO: Info = Info::new(
        c"faro-file",
        c"FARO scan files",
        c"Reads structured E57, PTX and XYZ scans; decides orientation, handedness and units from the geometry.",
        c"0.1.0",
    );
    type Options = Options;

    fn new(options: Options) -> Result<Self> {
        let known = Expected {
            turn: match options.turn.as_str() {
                "clockwise" => Some(Turn::Clockwise),
                "counter_clockwise" => Some(Turn::CounterClockwise),
                _ => None,
            },
            mirror: match options.mirror.as_str() {
                "x" => Mirror::X,
                "y" => Mirror::Y,
                _ => Mirror::None,
            },
            cut_azimuth: options.cut_azimuth_deg.map(f64::to_radians),
            intensity: None,
        };
        Ok(Self { options, known })
    }

    fn capture(&mut self, job: &Job<'_>, out: &mut ScanSink<'_>) -> Result<()> {
        device::capture(&self.options, &self.known, job, out)
    }
}

platen_sdk::export!(scanner FaroFile);

#[cfg(test)]
mod tests;
