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
//!
//! A wave over the range tilts the line of least squares through an arm. The standard deviation of its direction, over all phases, is that of one place across
//! the arm times 6 j1(x) / L for an arm of length L that spans x / pi periods, with the spherical Bessel function j1(x) = (sin x / x - cos x) / x: up to
//! 2.6 / L, where two ends with independent errors give sqrt(2) / L.

use std::f64::consts::{PI, SQRT_2};

use crate::Vec3;

/// Shortest period of a cyclic error over the range, metres: the finest modulations of phase scanners have periods near a metre (FARO Focus3D: 1.2 m).
const SHORTEST_PERIOD: f64 = 0.75;

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

    /// Returns the standard deviation of the direction of the line of least squares through an arm from the place `at`, towards the unit direction
    /// `aside` across it, radians: that of the worst wave of [`SHORTEST_PERIOD`] or more, at least that of two ends with errors of their own.
    pub(crate) fn tilt(&self, at: &Vec3, arm: &Vec3, aside: &Vec3) -> f64 {
        /// Where j1 is largest.
        const PEAK: f64 = 2.0816;
        let x = (PI * beam(at).dot(arm).abs() / SHORTEST_PERIOD).min(PEAK);
        let wave = 6.0 * (x.sin() / x - x.cos()) / x;
        self.along(at, aside) * wave.max(SQRT_2) / arm.norm()
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

    /// An arm that runs away from the scanner at half a right angle: waves of every period and phase against the line of least squares.
    #[test]
    fn the_worst_wave_tilts_a_line_as_stated() {
        let (at, arm) = (Vec3::new(10.0, 0.0, 0.0), Vec3::new(1.0, 1.0, 0.0) / SQRT_2);
        let aside = Vec3::new(-1.0, 1.0, 0.0) / SQRT_2;
        let (n, n_phases) = (200, 24);
        let tilt = |period: f64, phase: f64| {
            let slope = |k: i32| {
                let along = (f64::from(k) + 0.5) / f64::from(n);
                let range = 10.0 + along / SQRT_2;
                // Of an amplitude of sqrt(2) the standard deviation is 1; a part of 1 / sqrt(2) shows across the arm.
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
        // Across the beam an arm has one range: no wave, but its ends may be off.
        let across = RangeError::new(1.0).tilt(&at, &Vec3::new(0.0, 1.0, 0.0), &Vec3::new(1.0, 0.0, 0.0));
        assert!((across - SQRT_2).abs() < 1e-12);
    }
}
