//! Correlated error of the scanner in the stated uncertainties, taken from its calibration or else from its data sheet.
//!
//! The data sheet of a scanner states a range error. Neighbouring cells share this error, so no fit averages it out.
//! Without a calibration the error is taken from the plant file, then from the driver. If neither states one, the error
//! of common phase scanners is assumed.
//!
//! - A range error moves a point along the beam, and along the normal by the cosine of incidence times that.
//! - Two scans differ by the errors of both, hence the factor sqrt 2, as in a calibration by pairs of scans.
//! - The calibrated error belongs to a pair of scans; a single scan has 1 / sqrt 2 of it.
//! - The gap in the middle of a template on an artefact is z1 / 2 - z2 + z3 / 2. Its error is that of a point times the
//!   square root of 3 / 2. Either error divided by the cosine of incidence is an error of a range.
//!
//! Levels of detection, templates and stations include the error, calibrated or assumed. Positions, lengths and angles
//! include it only if it is calibrated ([`RangeError`]). A data sheet bounds the error and does not state over which
//! distances it changes. If the two ends of an edge had the full error independently of each other, every length would
//! be uncertain by millimetres. The sentence about the assumption states that positions and lengths do not include it.
//!
//! Limits: there is one figure for the whole plate, without a wavelength. An error that is equal in both scans of a
//! pair cancels, but it is counted here. A calibration without an artefact cannot find an error that repeats in every
//! scan; then no uncertainty includes it.

use std::f64::consts::SQRT_2;

use platen_model::Task;
use platen_model::units::mm;
use platen_plant::PlateFile;
use platen_shape::{RangeError, Surface};

use crate::calibration::Calibration;

/// Range error where neither the plant file nor the driver states one, one sigma, metres: the data sheets of phase
/// scanners for buildings and plants state 1 to 3 mm (FARO Focus3D S120: 2 mm at 10 m and 25 m).
const UNSTATED: f64 = 2e-3;

/// Sum of the squared weights of the heights in the gap of a balanced template: 1/4 + 1 + 1/4.
const GAP_SQUARES: f64 = 1.5;

/// Smallest cosine of incidence by which an error along the normal is divided: 85 degrees.
const LEAST_COSINE: f64 = 0.09;

/// Sample positions along each side at which the incidence is taken.
const PLACES: usize = 21;

/// Correlated and systematic errors of a scanner at one plate.
#[derive(Debug, Clone, PartialEq)]
pub struct ScannerError {
    /// Correlated error of a position between two scans, one sigma, metres.
    correlated: f64,
    /// Systematic error of a gap, one sigma, metres; known only from an artefact.
    systematic: Option<f64>,
    /// Range error in positions, lengths and angles; none unless calibrated.
    range: RangeError,
    /// Sentence that states the assumed range error; `None` with a calibration.
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

    /// Returns the errors of an uncalibrated scanner at this plate: the range error of the plant file, else of the
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

    /// Returns the range error in positions, lengths and angles; none unless it was calibrated.
    #[must_use]
    pub fn range(&self) -> RangeError {
        self.range
    }

    /// Logs the assumption, if there is one: a warning, unless the stated range error is zero.
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

/// Returns the root mean square of the cosine of incidence over the sample positions that were seen; 1 where none was.
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
