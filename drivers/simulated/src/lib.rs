//! Scans simulated plates: the one that lies in the simulated press, or one of its own.
//!
//! # What it does
//! On each trigger it asks where the plate comes from what shape the plate has now, puts it into a simulated press
//! shop and casts the rays of a terrestrial scanner at it, with the errors of one. Without a window it scans the
//! plate and `margin_deg` round it. Everything is reported as simulated.
//!
//! The plate comes from one of three places: from a simulated press (`cell`), from a description file
//! (`plate_file`), or from the options `shape`, `radius_mm`, `axis_deg` and the sizes. Each scan has noise of its own: the
//! first scans of two runs with the same `seed` agree to the last bit, and so do the second ones.
//!
//! # Example
//! ```toml
//! [scanner]
//! plugin = "simulated"
//! [scanner.options]
//! cell = "127.0.0.1:5021"
//! step_deg = 0.05
//! ```
//!
//! | key | meaning |
//! |---|---|
//! | `cell` | address where the simulated press says what its plate looks like |
//! | `plate_file` | description of a plate: blank, shape, pose, in TOML |
//! | `shape`, `radius_mm`, `axis_deg` | a plate without press and file |
//! | `width_mm`, `height_mm`, `thickness_mm` | its size |
//! | `scanner_m`, `scanner_yaw_deg` | where the scanner stands in the frame of the plate's pose, and how it is turned |
//! | `step_deg`, `margin_deg` | angle between cells; what is scanned round the plate |
//! | `noise_mm`, `tail_dof` | standard deviation of a range at 10 m; degrees of freedom of heavy tails |
//! | `footprint_mrad`, `dropout`, `cyclic_mm`, `angular_noise_urad` | further errors |
//! | `back_face_from_deg`, `collimation_urad` | where the back face begins, and what the faces disagree by |
//! | `warm_up_columns` | columns before the laser is warm |
//! | `hidden_by` | what stands before the plate |
//! | `seed` | of all random numbers |
//! | `time_scale`, `rate_kpts` | share of a real scanner's time that a scan takes, and the rate it would have |
//! | `threads` | 0: one per core |
//! | `truth_file` | where to write what a measurement of the scan should find, as JSON: for benches and tests |

mod capture;
mod error;
mod pace;
mod plate;

#[cfg(test)]
mod tests;

use error::Error;
use platen_scan::Window;
use platen_sdk::{Info, Job, Result, ScanSink, Scanner, options};

options! {
    /// Options of the driver; the module head is their manual.
    pub struct Options {
        /// Address of the simulated press's second port.
        cell: Option<String>;
        /// Description of a plate in TOML.
        plate_file: Option<std::path::PathBuf>;
        /// Shape of a plate without press and file.
        shape: String = "flat", choices ["flat", "cylinder", "sphere"];
        /// Radius of its mid-surface, positive when the centre lies above the plate.
        radius_mm: f64 = 9000.0, unit "mm", min -1e6, max 1e6;
        /// Direction of a cylinder's straight lines, from u towards v.
        axis_deg: f64 = 90.0, unit "deg", min -360.0, max 360.0;
        /// Extent of the plate along u.
        width_mm: f64 = 3000.0, unit "mm", min 100.0, max 20000.0;
        /// Extent of the plate along v.
        height_mm: f64 = 2500.0, unit "mm", min 100.0, max 20000.0;
        /// Thickness of the plate.
        thickness_mm: f64 = 36.0, unit "mm", min 1.0, max 300.0;
        /// Position of the scanner in the frame of the plate's pose: x, y, z in metres.
        scanner_m: Option<Vec<f64>>;
        /// Turn of the scanner about the vertical.
        scanner_yaw_deg: f64 = 0.0, unit "deg", min -360.0, max 360.0;
        /// Angle between neighbouring cells.
        step_deg: f64 = 0.05, unit "deg", min 0.005, max 5.0;
        /// What is scanned round the plate when no window is asked for.
        margin_deg: f64 = 6.0, unit "deg", min 0.0, max 45.0;
        /// Standard deviation of a range at 10 m on mill scale.
        noise_mm: f64 = 0.5, unit "mm", min 0.0, max 20.0;
        /// Degrees of freedom of the range error, for heavy tails; without it the error is normal.
        tail_dof: Option<f64>, min 2.1, max 1000.0;
        /// Width of the beam to 1/e^2.
        footprint_mrad: f64 = 0.3, unit "mrad", min 0.0, max 5.0;
        /// Share of echoes lost by chance.
        dropout: f64 = 0.006, min 0.0, max 1.0;
        /// Amplitude of the cyclic range error, period 1.2 m.
        cyclic_mm: f64 = 0.0, unit "mm", min 0.0, max 20.0;
        /// Standard deviation of the reported angles.
        angular_noise_urad: f64 = 0.0, unit "urad", min 0.0, max 1000.0;
        /// Azimuth from which on columns are measured on the back face; without it the scan has one face.
        back_face_from_deg: Option<f64>, unit "deg", min -180.0, max 180.0;
        /// Angle of the beam against the mirror's plane; its sign changes between the faces.
        collimation_urad: f64 = 0.0, unit "urad", min -1000.0, max 1000.0;
        /// Columns before the laser is warm.
        warm_up_columns: i64 = 10, min 0, max 1000;
        /// What stands between scanner and plate.
        hidden_by: String = "nothing", choices ["nothing", "person", "chain", "both"];
        /// Seed of all random numbers.
        seed: i64 = 1, min 0;
        /// Share of a real scanner's time that a scan takes; 0: no longer than the computer needs.
        time_scale: f64 = 0.0, min 0.0, max 10.0;
        /// Measuring rate that this time follows from, in thousands of points per second.
        rate_kpts: String = "122", choices ["122", "244", "488", "976"];
        /// Threads; 0 takes one per core.
        threads: i64 = 0, min 0, max 256;
        /// File that gets, after each scan, what a measurement of it should find, as JSON.
        truth_file: Option<std::path::PathBuf>;
    }
}

/// The driver.
#[derive(Debug)]
pub struct Simulated {
    options: Options,
    scans: u64,
}

impl Scanner for Simulated {
    const INFO: Info = Info::new(
        c"simulated",
        c"Simulated scanner",
        c"Casts rays at the plate of the simulated press, or at one of its own, with the errors of a real scanner.",
        c"0.1.0",
    );
    type Options = Options;

    fn new(options: Options) -> Result<Self> {
        plate::check(&options)?;
        if options.time_scale > 0.0 {
            pace::device(&options)?;
        }
        Ok(Self { options, scans: 0 })
    }

    fn open(&mut self) -> Result<()> {
        match plate::fetch(&self.options) {
            // The press is there; its plate will be at rest when it asks for a scan.
            Ok(_) | Err(Error::Busy { .. }) => Ok(()),
            Err(error) => Err(error.into()),
        }
    }

    fn estimate_s(&mut self, window: Option<&Window>) -> Option<f64> {
        capture::estimate_s(&self.options, window)
    }

    fn capture(&mut self, job: &Job<'_>, out: &mut ScanSink<'_>) -> Result<()> {
        let state = plate::fetch(&self.options)?;
        let window = out.window().copied();
        self.scans += 1;
        let shot = capture::Shot::new(&self.options, state, window.as_ref(), self.scans)?;
        shot.take(&mut capture::ToHost { job, out })
    }
}

platen_sdk::export!(scanner Simulated);
