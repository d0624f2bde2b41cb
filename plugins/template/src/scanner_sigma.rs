//! Scanner errors in the standard deviations of gaps, deviations and curvatures: the errors that no fit averages out.

use std::f64::consts::{SQRT_2, TAU};

use platen_model::Task;
use platen_shape::Surface;

/// Change of range over which the correlated error completes a period, metres: as the wavelength of comparison
/// `curvature`, near that of the finest modulation of phase scanners (FARO Focus3D: 1.2 m).
const PERIOD: f64 = 1.0;

/// Standard deviations of a scanner's errors, metres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ScannerSigma {
    /// Correlated error of a position along the normal in a single scan.
    position: f64,
    /// Error of a gap on a known artefact.
    gap: f64,
}

impl ScannerSigma {
    /// Takes the errors of a task; its correlated error belongs to a pair of scans, of which a single one has half the
    /// variance.
    pub(crate) fn of(task: &Task) -> Self {
        Self { position: task.sigma_correlated / SQRT_2, gap: task.sigma_true.unwrap_or(0.0) }
    }

    /// Returns the standard deviation of a weighted sum of heights, with each point given once: the correlated error
    /// counts as independent between points.
    pub(crate) fn of_heights(&self, weights: impl IntoIterator<Item = f64>) -> f64 {
        let square: f64 = weights.into_iter().map(|w| w * w).sum();
        (self.position * square.sqrt()).hypot(self.gap)
    }

    /// Returns the standard deviation of a gap on a known artefact, metres.
    pub(crate) fn of_gap(&self) -> f64 {
        self.gap
    }

    /// Returns the standard deviation of a position along the normal, metres.
    pub(crate) fn of_position(&self) -> f64 {
        self.position
    }

    /// Returns the standard deviation of a curvature along a unit direction (u, v), or of the steepest one without a
    /// direction, 1/m.
    ///
    /// An error a sin(2 pi r / L) of the range r has along the plate the second derivative of a wave. Per metre the
    /// range changes by the cosine c between beam and direction, so that the amplitude of the derivative is a (2 pi c /
    /// L)^2.
    pub(crate) fn of_curvature(&self, now: &Surface, [u, v]: [f64; 2], direction: Option<[f64; 2]>) -> f64 {
        let derivatives = now.derivatives(u, v);
        let beam = derivatives.p.normalize();
        let change = match direction {
            Some([x, y]) => beam.dot(&(derivatives.u * x + derivatives.v * y).normalize()),
            None => (1.0 - beam.dot(&derivatives.normal()).powi(2)).max(0.0).sqrt(),
        };
        self.position * (TAU * change / PERIOD).powi(2)
    }
}
