//! Range error of the scanner, propagated to the standard deviations of positions, lengths and directions.
//!
//! The range error e is the calibration error of the scanner, in addition to the noise: the cyclic error of a phase
//! measurement, or the effect of temperature or reflectivity. It is a slow function of the range with unknown phase.
//! Samples whose ranges differ by little compared with its period have the same error, so that no fit averages it out.
//! At places farther apart it counts as independent.
//!
//! In: the standard deviation s of e over all phases, metres (a sine of amplitude A has s = A / sqrt 2). Out: the
//! standard deviation of a position along a direction, metres, and of the direction of an edge, radians.
//!
//! **Positions.** An error e moves a sample at p along its beam b = p / |p|, hence by e (b . d) along a unit direction
//! d. A place on the plate moves along the normal by e times the cosine of incidence. An edge, which is located by the
//! directions of beams, moves across itself by the remaining component.
//!
//! ```text
//! var(d . p) = s^2 (b . d)^2          one place
//! var(sum w_i p_i) = sum w_i^2 var(p_i)    a figure of several places
//! ```
//!
//! **Directions.** The direction of an edge at a corner is that of a line fitted by least squares to the edge over an
//! arm of length L. A wave of the error over the range tilts this line. Its standard deviation, over all phases, is
//! that of one place across the arm times 6 j1(x) / L, where the arm spans x / pi periods and j1(x) = (sin x / x - cos
//! x) / x is the spherical Bessel function. The factor is at most 2.6 / L; two ends with independent errors give
//! sqrt(2) / L.
//!
//! Limits: places closer than half a period are correlated, so that differences between them are better than stated. A
//! sine is bounded by 1.41 s, so that an interval of 1.96 s always contains it where it dominates.
//!
//! Source: own; the law of propagation is that of JCGM 100:2008 (GUM), 5.1.2.

use std::f64::consts::{PI, SQRT_2};

use crate::Vec3;

/// Shortest period of a cyclic error over the range, metres. The finest modulations of phase scanners have periods near
/// a metre (FARO Focus3D: 1.2 m).
const SHORTEST_PERIOD: f64 = 0.75;

/// Standard deviation of the range error that neighbouring samples share.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RangeError {
    sigma: f64,
}

impl RangeError {
    /// Builds the range error from the standard deviation of a range, metres.
    #[must_use]
    pub fn new(sigma: f64) -> Self {
        Self { sigma }
    }

    /// Returns the standard deviation of a range, metres.
    #[must_use]
    pub fn sigma(&self) -> f64 {
        self.sigma
    }

    /// Returns the standard deviation of the position `at` (scanner frame, metres) along a unit direction, metres; 0 at
    /// the scanner itself.
    #[must_use]
    pub fn along(&self, at: &Vec3, direction: &Vec3) -> f64 {
        self.sigma * beam(at).dot(direction).abs()
    }

    /// Returns the standard deviation, radians, of the direction of the least-squares line through `arm`, which starts
    /// at `at`, towards the unit direction `aside` across it.
    ///
    /// It is that of the worst wave of [`SHORTEST_PERIOD`] or more, and at least that of two ends with independent
    /// errors.
    pub(crate) fn tilt(&self, at: &Vec3, arm: &Vec3, aside: &Vec3) -> f64 {
        /// Place of the maximum of j1.
        const PEAK: f64 = 2.0816;
        let x = (PI * beam(at).dot(arm).abs() / SHORTEST_PERIOD).min(PEAK);
        let wave = 6.0 * (x.sin() / x - x.cos()) / x;
        self.along(at, aside) * wave.max(SQRT_2) / arm.norm()
    }
}

/// Returns the unit direction from the scanner to a position; zero at the scanner.
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

    /// An arm that runs away from the scanner at half a right angle; the least-squares line is compared for waves of
    /// every period and phase.
    #[test]
    fn the_worst_wave_tilts_a_line_as_stated() {
        let (at, arm) = (Vec3::new(10.0, 0.0, 0.0), Vec3::new(1.0, 1.0, 0.0) / SQRT_2);
        let aside = Vec3::new(-1.0, 1.0, 0.0) / SQRT_2;
        let (n, n_phases) = (200, 24);
        let tilt = |period: f64, phase: f64| {
            let slope = |k: i32| {
                let along = (f64::from(k) + 0.5) / f64::from(n);
                let range = 10.0 + along / SQRT_2;
                // An amplitude of sqrt(2) has a standard deviation of 1; its part across the arm is 1 / sqrt(2).
                let error = SQRT_2 * (2.0 * PI * range / period + phase).sin() / SQRT_2;
                12.0 * (along - 0.5) * error / f64::from(n)
            };
            (0..n).map(slope).sum::<f64>()
        };
        let rms = |period: f64| {
            let squares =
                (0..n_phases).map(|k| tilt(period, 2.0 * PI * f64::from(k) / f64::from(n_phases)).powi(2));
            (squares.sum::<f64>() / f64::from(n_phases)).sqrt()
        };
        let stated = RangeError::new(1.0).tilt(&at, &arm, &aside);
        let worst = (0..60).map(|k| rms(SHORTEST_PERIOD * 1.05_f64.powi(k))).fold(0.0, f64::max);
        assert!((worst / stated - 1.0).abs() < 5e-3, "{worst} {stated}");
        // An arm across the beam has one range: no wave, but independent errors of its ends.
        let across = RangeError::new(1.0).tilt(&at, &Vec3::new(0.0, 1.0, 0.0), &Vec3::new(1.0, 0.0, 0.0));
        assert!((across - SQRT_2).abs() < 1e-12);
    }
}
