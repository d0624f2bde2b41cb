//! Correlated error of the scanner in the stated uncertainties: that of its calibration, and until there is one that of the
//! instrument's data sheet.
//!
//! A data sheet states the accuracy of a range: an error that neighbouring cells share, which no fit averages out. The plant file
//! has precedence over the driver; where neither states one, that of common phase scanners is assumed. A range error moves a place
//! along the beam, thus along the normal by its cosine of incidence. Two scans differ by the errors of both, hence the factor of
//! sqrt 2, as in a calibration by pairs of scans.
//!
//! Levels of detection, templates and stations hold the error, calibrated or assumed. Places, lengths and angles hold it once it is
//! calibrated ([`RangeError`]): a data sheet bounds an error and does not say over which ranges it changes, and two ends of an
//! edge that were off by all of it independently would make each length uncertain by millimetres. The assumption says that they
//! are stated without it.
//!
//! Of the calibrated error of a pair a single scan has its share; the gap in the middle of a template on an artefact is
//! z1 / 2 - z2 + z3 / 2, its error that of a place times the square root of 3 / 2. Both divided by the cosine of incidence are
//! errors of a range.
//!
//! Limits: one figure for the whole plate, without a wavelength; what is equal in both scans of a pair cancels, and counts here all
//! the same. A calibration without an artefact does not know what repeats in every scan, and then no uncertainty holds it.

use std::f64::consts::SQRT_2;

use platen_model::Task;
use platen_model::units::mm;
use platen_plant::PlateFile;
use platen_shape::{RangeError, Surface};

use crate::calibration::Calibration;

/// Range error where neither the plant file nor the driver states one, one sigma, metres: the data sheets of phase scanners for
/// buildings and plants state 1 to 3 mm (FARO Focus3D S120: 2 mm at 10 m and 25 m).
const UNSTATED: f64 = 2e-3;

/// Sum of the squared weights of the heights in the gap of a balanced template: 1/4 + 1 + 1/4.
const GAP_SQUARES: f64 = 1.5;

/// Smallest cosine of incidence by which an error along the normal is divided: 85 degrees.
const LEAST_COSINE: f64 = 0.09;

/// Places along each side at which the incidence is taken.
const PLACES: usize = 21;

/// Correlated and systematic errors of a scanner at one plate.
#[derive(Debug, Clone, PartialEq)]
pub struct ScannerError {
    /// Correlated error of a position between two scans, one sigma, metres.
    correlated: f64,
    /// Systematic error of a gap, one sigma, metres; known only from an artefact.
    systematic: Option<f64>,
    /// Range error in places, lengths and angles; none unless calibrated.
    range: RangeError,
    /// Sentence that names the assumed range error; `None` with a calibration.
    pub assumption: Option<String>,
}

impl ScannerError {
    /// Returns the errors of a calibration, at this plate.
    pub fn calibrated(calibration: &Calibration, surface: &Surface) -> Self {
        let systematic = calibration.sigma_true.unwrap_or(0.0) / GAP_SQUARES.sqrt();
        let place = (calibration.sigma_correlated / SQRT_2).hypot(systematic);
        Self {
            range: RangeError::new(place / rms_cosine(surface).max(LEAST_COSINE)),
            correlated: calibration.sigma_correlated,
            systematic: calibration.sigma_true,
            assumption: None,
        }
    }

    /// Returns the errors of a scanner that nobody calibrated, at this plate: the range error of the plant file, else of the
    /// driver (metres, one sigma), else the stand-in.
    pub fn assumed(of_plant: Option<f64>, of_driver: Option<f64>, surface: &Surface) -> Self {
        let (error, source) = match (of_plant, of_driver) {
            (Some(error), _) => (error, "as the plant file states it"),
            (None, Some(error)) => (error, "as its driver states it"),
            (None, None) => {
                (UNSTATED, "as neither its driver nor range_error_mm of the plant file states one")
            }
        };
        let without = if error > 0.0 { "; places and lengths are stated without it" } else { "" };
        let assumption = format!(
            "the scanner is not calibrated: a range error of {:.2} mm (one sigma) is assumed, {source}{without}",
            mm(error)
        );
        let range = RangeError::default();
        Self { range, assumption: Some(assumption), ..Self::known(RangeError::new(error), surface) }
    }

    /// Returns the errors of a scanner whose range error is known, at this plate.
    pub fn known(range: RangeError, surface: &Surface) -> Self {
        let correlated = SQRT_2 * range.sigma() * rms_cosine(surface);
        Self { correlated, systematic: None, range, assumption: None }
    }

    /// Returns the correlated error of a position along the normal between two scans, one sigma, metres.
    #[must_use]
    pub fn correlated(&self) -> f64 {
        self.correlated
    }

    /// Returns the range error in places, lengths and angles; none unless it was calibrated.
    #[must_use]
    pub fn range(&self) -> RangeError {
        self.range
    }

    /// Logs the assumption, if there is one: a warning, unless the scanner is said to have no such error.
    pub fn log(&self) {
        match &self.assumption {
            Some(assumption) if self.correlated > 0.0 => tracing::warn!("{assumption}; run platen calibrate"),
            Some(assumption) => tracing::info!("{assumption}"),
            None => {}
        }
    }

    /// Returns the task of the comparisons for a plate.
    pub fn task(&self, plate: &PlateFile, supports_changed: bool) -> Task {
        plate.task(self.correlated, self.systematic, supports_changed)
    }
}

/// Returns the root mean square of the cosine of incidence over the places that were seen; 1 where none was.
fn rms_cosine(surface: &Surface) -> f64 {
    let along = |k: usize, length: f64| length * k as f64 / (PLACES - 1) as f64;
    let places = (0..PLACES * PLACES)
        .map(|k| [along(k % PLACES, surface.width()), along(k / PLACES, surface.height())])
        .filter(|[u, v]| surface.mask().seen(*u, *v));
    let squares: Vec<f64> = places
        .map(|[u, v]| surface.face(u, v).normalize().dot(&surface.normal(u, v)).powi(2))
        .filter(|square| square.is_finite())
        .collect();
    if squares.is_empty() { 1.0 } else { (squares.iter().sum::<f64>() / squares.len() as f64).sqrt() }
}
