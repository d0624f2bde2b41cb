//! The scanner's own range error in the standard deviations of places: that of its calibration, beside the noise.
//!
//! A range error e moves a sample at p along its beam b = p / |p|, thus by e (b . d) along a unit direction d: a place on the plate along the
//! normal by the cosine of incidence, and an edge, which is located by the directions of beams, across itself by the rest. Such an
//! error (cyclic error of a phase measurement, temperature, reflectivity) is a slow function of the range with a phase that nobody
//! knows. It is equal for samples whose ranges differ by little against its period, so no fit averages it out, and it counts as
//! independent at places farther apart:
//!
//! ```text
//! var(d . p) = s^2 (b . d)^2          one place
//! var(sum w_i p_i) = sum w_i^2 var(p_i)    a figure of several places
//! ```
//!
//! with s the standard deviation of e over all phases (a sine of amplitude A: A / sqrt 2). Own; the law of propagation is that of JCGM
//! 100:2008 (GUM), 5.1.2. Limits: places closer than half a period are correlated, and figures of differences between them
//! are better than stated; a sine is bounded by 1.41 s, so that an interval of 1.96 s holds it always where it dominates.

use crate::Vec3;

/// Standard deviation of the range error that neighbouring samples share.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RangeError {
    sigma: f64,
}

impl RangeError {
    /// Takes the standard deviation of a range, metres.
    #[must_use]
    pub fn new(sigma: f64) -> Self {
        Self { sigma }
    }

    /// Returns the standard deviation of a range, metres.
    #[must_use]
    pub fn sigma(&self) -> f64 {
        self.sigma
    }

    /// Returns the standard deviation of the place `at` (scanner frame, metres) along a unit direction, metres; 0 at the scanner itself.
    #[must_use]
    pub fn along(&self, at: &Vec3, direction: &Vec3) -> f64 {
        self.sigma * beam(at).dot(direction).abs()
    }
}

/// Returns the unit direction from the scanner to a place; zero at the scanner.
pub(crate) fn beam(at: &Vec3) -> Vec3 {
    at.try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vec3::zeros)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_error_acts_along_the_beam() {
        let error = RangeError::new(2e-3);
        // 60 degrees of incidence on a level plate.
        let at = Vec3::new(3.0_f64.sqrt(), 0.0, -1.0);
        let along = |x, y, z| error.along(&at, &Vec3::new(x, y, z));
        assert!((along(0.0, 0.0, 1.0) - 1e-3).abs() < 1e-12);
        assert!((along(1.0, 0.0, 0.0) - 3.0_f64.sqrt() * 1e-3).abs() < 1e-12);
        assert_eq!(along(0.0, 1.0, 0.0), 0.0);
        assert_eq!(error.along(&Vec3::zeros(), &Vec3::z()), 0.0);
    }
}
