//! Driver `simulated`: scans of a simulated plate by ray casting.
//!
//! # Method
//! Each trigger fetches the present shape of the plate and places it in a simulated press shop. Then the rays of a
//! terrestrial laser scanner are cast, with its errors (`platen-sim-scanner`). Without a window the plate and
//! `margin_deg` around it are scanned. Scans are marked as simulated.
//!
//! The plate comes from a simulated press (`cell`), from a description file (`plate_file`), or from the options
//! `shape`, `radius_mm`, `axis_deg` and the dimensions. Each scan of a run has its own noise. The n-th scans of two
//! runs with the same `seed` agree to the last bit.
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
//! | `cell` | address of the simulated press's control port, which serves the plate |
//! | `plate_file` | description of a plate: blank, shape, pose, in TOML |
//! | `shape`, `radius_mm`, `axis_deg` | plate without press and file |
//! | `width_mm`, `height_mm`, `thickness_mm` | its dimensions |
//! | `scanner_m`, `scanner_yaw_deg` | position and orientation of the scanner in the frame of the plate's pose |
//! | `step_deg`, `margin_deg` | angle between cells; scanned margin around the plate |
//! | `noise_mm`, `tail_dof` | standard deviation of a range at 10 m; degrees of freedom of heavy tails |
//! | `wide_share`, `wide_factor` | share of the ranges whose standard deviation is larger by a factor |
//! | `footprint_mrad`, `beam` | width of the beam; its cross section |
//! | `dropout`, `cyclic_mm`, `angular_noise_urad` | further errors |
//! | `back_face_from_deg`, `collimation_urad` | start of the back face; collimation error between the faces |
//! | `warm_up_columns` | columns measured before the laser is warm |
//! | `plate_reflectivity` | share of the light that the plate's faces scatter back |
//! | `hidden_by` | object in front of the plate |
//! | `strip_deg` | angle by which the table is visible beyond the plate's far edges |
//! | `seed` | seed of all random numbers |
//! | `time_scale`, `rate_kpts` | duration of a scan relative to a real scanner, and the measuring rate it follows from |
//! | `threads` | number of threads; 0: one per core |
//! | `truth_file` | file for the ground truth of each scan, as JSON, for tests |

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
    /// Options of the driver, documented in the module head.
    pub struct Options {
        /// Address of the simulated press's control port.
        cell: Option<String>;
        /// Description of a plate in TOML.
        plate_file: Option<std::path::PathBuf>;
        /// Shape of the plate without press and file.
        shape: String = "flat", choices ["flat", "cylinder", "sphere"];
        /// Radius of its mid-surface, positive when the centre lies above the plate.
        radius_mm: f64 = 9000.0, unit "mm", min -1e6, max 1e6;
        /// Direction of a cylinder's generators, from u towards v.
        axis_deg: f64 = 90.0, unit "deg", min -360.0, max 360.0;
        /// Extent of the plate along u.
        width_mm: f64 = 3000.0, unit "mm", min 100.0, max 20000.0;
        /// Extent of the plate along v.
        height_mm: f64 = 2500.0, unit "mm", min 100.0, max 20000.0;
        /// Thickness of the plate.
        thickness_mm: f64 = 36.0, unit "mm", min 1.0, max 300.0;
        /// Position of the scanner in the frame of the plate's pose: x, y, z in metres.
        scanner_m: Option<Vec<f64>>;
        /// Rotation of the scanner about the vertical.
        scanner_yaw_deg: f64 = 0.0, unit "deg", min -360.0, max 360.0;
        /// Angle between neighbouring cells.
        step_deg: f64 = 0.05, unit "deg", min 0.005, max 5.0;
        /// Margin around the plate that is scanned when no window is requested.
        margin_deg: f64 = 6.0, unit "deg", min 0.0, max 45.0;
        /// Standard deviation of a range at 10 m on mill scale.
        noise_mm: f64 = 0.5, unit "mm", min 0.0, max 20.0;
        /// Degrees of freedom of the range error (Student's t, heavy tails); without it the error is normal.
        tail_dof: Option<f64>, min 2.1, max 1000.0;
        /// Share of the ranges with a wide error.
        wide_share: f64 = 0.0, min 0.0, max 1.0;
        /// Factor of the standard deviation of these ranges.
        wide_factor: f64 = 4.0, min 1.0, max 100.0;
        /// Full width of the beam at 1/e^2 of its intensity.
        footprint_mrad: f64 = 0.3, unit "mrad", min 0.0, max 5.0;
        /// Cross section of the beam: a Gaussian truncated at that width, one with power beyond it, or 13 rays.
        beam: String = "truncated", choices ["truncated", "winged", "few rays"];
        /// Probability that an echo is lost.
        dropout: f64 = 0.006, min 0.0, max 1.0;
        /// Amplitude of the cyclic range error, period 1.2 m.
        cyclic_mm: f64 = 0.0, unit "mm", min 0.0, max 20.0;
        /// Standard deviation of the reported angles.
        angular_noise_urad: f64 = 0.0, unit "urad", min 0.0, max 1000.0;
        /// Azimuth from which columns are measured on the back face; without it the scan has one face.
        back_face_from_deg: Option<f64>, unit "deg", min -180.0, max 180.0;
        /// Collimation error; its sign changes between the faces.
        collimation_urad: f64 = 0.0, unit "urad", min -1000.0, max 1000.0;
        /// Columns measured before the laser is warm.
        warm_up_columns: i64 = 10, min 0, max 1000;
        /// Diffuse reflectivity of the plate's faces: mill scale 0.35, rust and soot darker, primer brighter.
        plate_reflectivity: f64 = 0.35, min 0.01, max 1.0;
        /// Object between scanner and plate.
        hidden_by: String = "nothing", choices ["nothing", "person", "person at corner", "chain", "both"];
        /// Angle by which the table shows beyond the plate's far edges; 0: it is as wide as the shop has it.
        strip_deg: f64 = 0.0, unit "deg", min 0.0, max 5.0;
        /// Seed of all random numbers.
        seed: i64 = 1, min 0;
        /// Duration of a scan relative to a real scanner; 0: as fast as the computer allows.
        time_scale: f64 = 0.0, min 0.0, max 10.0;
        /// Measuring rate from which the duration follows, in thousands of points per second.
        rate_kpts: String = "122", choices ["122", "244", "488", "976"];
        /// Number of threads; 0: one per core.
        threads: i64 = 0, min 0, max 256;
        /// File for the ground truth of each scan, as JSON.
        truth_file: Option<std::path::PathBuf>;
    }
}

/// Driver `simulated`.
#[derive(Debug)]
pub struct Simulated {
    options: Options,
    scans: u64,
}

impl Scanner for Simulated {
    const INFO: Info = Info::new(
        c"simulated",
        c"Simulated scanner",
        c"Simulates a terrestrial laser scanner by ray casting, on the plate of the simulated press or on one of its own.",
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
            // The press answers; its plate will be at rest when a scan is requested.
            Ok(_) | Err(Error::Busy { .. }) => Ok(()),
            Err(error) => Err(error.into()),
        }
    }

    fn estimate_s(&mut self, window: Option<&Window>) -> Option<f64> {
        capture::estimate_s(&self.options, window)
    }

    fn capture(&mut self, _: &Job<'_>, out: &mut ScanSink<'_>) -> Result<()> {
        let state = plate::fetch(&self.options)?;
        let window = out.window().copied();
        self.scans += 1;
        let shot = capture::PreparedScan::new(&self.options, state, window.as_ref(), self.scans)?;
        shot.take(out)
    }
}

platen_sdk::export!(scanner Simulated);
