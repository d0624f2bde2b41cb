//! Propagation of distributions by a Monte Carlo method (JCGM 101:2008, Supplement 1 to the GUM): the gaps on plates
//! with drawn errors.
//!
//! The plates differ from the measured one by errors of the fit and of the scanner. A gap is a function of the heights
//! that jumps where a template falls on another contact or begins to rock. Its first derivatives, the weights of the
//! contacts, do not show that.
//!
//! Each trial draws an error of the fit from its covariance, and an error of the scanner as a wave over the range with
//! unknown phase and period. Another trial has the same errors with the other sign (antithetic variates). The template,
//! or the whole target, is laid on that plate. The same scan always has the same trials.

use std::f64::consts::{SQRT_2, TAU};

use platen_shape::Surface;
use platen_shape::surface::HeightDraws;

use crate::scanner_sigma::ScannerSigma;

/// Number of drawn errors, and of trials: each error with both signs.
const DRAWS: usize = 32;
pub(crate) const TRIALS: usize = 2 * DRAWS;
/// Rank of the 95 % interval's half width among the departures of all trials: that of the 62 smallest of 64 holds 62 /
/// 65 of them.
const RANK: usize = 61;
const SEED: u64 = 101_2008;

/// Wave numbers of the scanner's error over the range, 1/m: the finest modulations of phase scanners have periods near
/// a metre (FARO Focus3D: 1.2 m).
const WAVE_NUMBERS: [f64; 4] = [0.7, 0.9, 1.1, 1.3];

/// Errors of the plate's heights, one for each trial.
#[derive(Debug)]
pub(crate) struct Trials<'a> {
    now: &'a Surface,
    fit: HeightDraws<'a, DRAWS>,
    /// Amplitude of the scanner's wave, metres, and its phase in each draw as sine and cosine.
    amplitude: f64,
    phases: [(f64, f64); DRAWS],
}

impl<'a> Trials<'a> {
    pub(crate) fn draw(now: &'a Surface, scanner: ScannerSigma) -> Self {
        // Phases distributed evenly over half a turn for each wave number; the other sign is the other half.
        let turns =
            |draw: usize| 0.5 * (draw / WAVE_NUMBERS.len()) as f64 / (DRAWS / WAVE_NUMBERS.len()) as f64;
        let phases = std::array::from_fn(|draw| (TAU * turns(draw)).sin_cos());
        Self { now, fit: now.draw_heights(SEED), amplitude: SQRT_2 * scanner.of_position(), phases }
    }

    /// Returns the errors along the normal at a point, metres.
    pub(crate) fn heights(&self, [u, v]: [f64; 2]) -> [f64; TRIALS] {
        let mut drawn = self.fit.at(u, v);
        if self.amplitude > 0.0 {
            let range = self.now.face(u, v).norm();
            let waves = WAVE_NUMBERS.map(|number| (TAU * number * range).sin_cos());
            for (k, (height, (of_cos, of_sin))) in drawn.iter_mut().zip(&self.phases).enumerate() {
                let (sin, cos) = waves[k % WAVE_NUMBERS.len()];
                *height += self.amplitude * (of_sin * sin + of_cos * cos);
            }
        }
        std::array::from_fn(|k| if k < DRAWS { drawn[k] } else { -drawn[k - DRAWS] })
    }
}

/// Returns the half width of the 95 % interval about the measured figure, from the departures of the trials.
pub(crate) fn half_width(mut departures: [f64; TRIALS]) -> f64 {
    departures.iter_mut().for_each(|departure| *departure = departure.abs());
    departures.sort_by(f64::total_cmp);
    departures[RANK]
}
