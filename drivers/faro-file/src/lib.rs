//! Driver `faro-file`: reads laser scans from files (structured E57, PTX, XYZ with row and column, XYB).
//!
//! # Operation
//! The format is detected from the content, and the file is checked for completeness. Rows, columns, handedness and
//! units are determined from the geometry (`platen-formats`). The lattice is delivered column by column in the
//! scanner's frame. Every decision is recorded as a sentence in the scan's notes. The file is opened for reading only;
//! it is never locked, changed or deleted.
//!
//! Missing cells may be flagged, left out, written as the origin or as NaN. A pose in the file is reported and not
//! applied. Formats without a lattice, and formats that only their maker's software reads (`.fls`, `.fws`, `.lsproj`,
//! `.las`, `.pts`, `.pod`, `.cpe`), are refused; the message gives the format to export instead.
//!
//! A scan is read from one file, or from the next file in a watched folder. A file in the folder is accepted if
//!
//! - its name matches the pattern,
//! - it is new or has changed since the press was ready,
//! - it stays the same for a number of polls, and
//! - its structure is valid (lengths, checksums, number of lines).
//!
//! A refused file is examined again until the stroke's deadline; then the reason is returned. Polling works on every
//! network share; no events are needed.
//!
//! # Example
//! ```toml
//! [scanner]
//! plugin = "faro-file"
//! [scanner.options]
//! folder = "/mnt/scans"
//! pattern = "press3-{stroke}-*.e57"
//! ```
//!
//! | key | meaning |
//! |---|---|
//! | `file` | the scan; or |
//! | `folder` | folder in which scans arrive |
//! | `pattern` | names of scans, with `*`, `?`, `[..]`, and `{stroke}` or `{job}` for their numbers |
//! | `poll_ms` | time between two polls of the folder |
//! | `stable_polls` | polls for which a file must stay the same |
//! | `cloud` | number of the scan in a file that holds several, from 1 |
//! | `turn` | direction of columns in this scanner's files; the opposite one is refused as mirrored |
//! | `mirror` | the axis to mirror where the exporter writes a left-handed frame |
//! | `cut_azimuth_deg` | azimuth at which a full circle is cut, away from the plate |

mod device;
mod error;
mod watch;

use std::path::PathBuf;
use std::time::Duration;

use platen_formats::orient::{Expected, Mirror, Turn};
use platen_sdk::{Info, Job, Result, ScanSink, Scanner, options};

use device::{Folder, Reading, config};

options! {
    /// Options of the file driver; the module head is their manual.
    pub struct Options {
        /// The scan file.
        file: Option<PathBuf>;
        /// Folder in which scans arrive, instead of one file.
        folder: Option<PathBuf>;
        /// Names of scans in the folder: `*`, `?` and `[..]` as in a shell, `{stroke}` and `{job}` for the numbers of
        /// the stroke and the job.
        pattern: String = "*";
        /// Time between two polls of the folder.
        poll_ms: i64 = 500, unit "ms", min 20, max 60000;
        /// Polls for which a file must stay the same before it is opened.
        stable_polls: i64 = 3, min 1, max 100;
        /// Number of the scan in a file that holds several, from 1.
        cloud: Option<i64>, min 1;
        /// Direction of columns by increasing number in this scanner's files, seen from above, where it is known: a scan
        /// in the opposite direction is mirrored and refused.
        turn: String = "any", choices ["any", "clockwise", "counter_clockwise"];
        /// Axis to mirror where the exporter writes a left-handed frame.
        mirror: String = "none", choices ["none", "x", "y"];
        /// Azimuth at which a full circle is cut, away from the plate.
        cut_azimuth_deg: Option<f64>, unit "deg", min -360.0, max 360.0;
    }
}

/// The driver.
#[derive(Debug)]
pub struct FaroFile {
    place: Place,
    reading: Reading,
    poll: Duration,
}

/// Source of the scan: one file or a watched folder.
#[derive(Debug)]
enum Place {
    File(PathBuf),
    Folder(Folder),
}

impl Scanner for FaroFile {
    const INFO: Info = Info::new(
        c"faro-file",
        c"FARO scan files",
        c"Reads structured E57, PTX, XYZ and XYB scans, one file or the next in a watched folder; decides orientation, handedness and units from the geometry.",
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
        let place = match (options.file, options.folder) {
            (Some(file), None) => Place::File(file),
            (None, Some(path)) => {
                let stable_polls = u32::try_from(options.stable_polls).unwrap_or(1).max(1);
                let folder =
                    Folder { path, pattern: options.pattern, stable_polls, before: None, measured: None };
                folder.pattern(0, 0).map_err(|e| config(&format!("pattern: {e}"), "see its description"))?;
                Place::Folder(folder)
            }
            (Some(_), Some(_)) => return Err(config("both file and folder are given", "keep one of them")),
            (None, None) => return Err(config("no scan to read", "set the option file or folder")),
        };
        let cloud = options.cloud.and_then(|cloud| usize::try_from(cloud).ok());
        let poll = Duration::from_millis(options.poll_ms.unsigned_abs());
        Ok(Self { place, reading: Reading { cloud, known }, poll })
    }

    fn open(&mut self) -> Result<()> {
        self.look()
    }

    fn capture(&mut self, job: &Job<'_>, out: &mut ScanSink<'_>) -> Result<()> {
        let alive = || job.check().is_ok();
        let mut progress = device::progress(job, "looking at the lattice");
        match &mut self.place {
            Place::File(path) => {
                let read = self.reading.open(path, &alive).and_then(|mut reader| {
                    let oriented = self.reading.orient(&mut reader, &mut progress)?;
                    device::deliver(job, &mut reader, &oriented, out)
                });
                // A cancelled job ends the reading with an error of its own. The host adds the name of the file.
                read.map_err(|error| job.check().err().unwrap_or_else(|| error.into_sdk()))
            }
            Place::Folder(folder) => {
                let pattern = folder.pattern(job.stroke(), job.id());
                let pattern = pattern.map_err(|e| config(&format!("pattern: {e}"), "see its description"))?;
                let poll = self.poll;
                let mut pause = |why| device::pause(job, poll, why);
                let found = folder.wait(&self.reading, pattern, &mut progress, &mut pause, &alive);
                let delivered = found.and_then(|(path, mut reader, oriented)| {
                    let sent = device::deliver(job, &mut reader, &oriented, out);
                    sent.map(|()| oriented.checksum()).map_err(|error| error.at(&path))
                });
                folder.close(delivered.as_ref().ok().copied());
                delivered.map(drop)
            }
        }
    }
}

impl FaroFile {
    /// Lists the watched folder: its present files are not the scan of the next stroke.
    fn look(&mut self) -> Result<()> {
        match &mut self.place {
            Place::File(_) => Ok(()),
            Place::Folder(folder) => {
                let path = folder.path.clone();
                folder.look().map_err(|error| error.at(&path))
            }
        }
    }
}

platen_sdk::export!(scanner FaroFile);

#[cfg(test)]
mod tests;
