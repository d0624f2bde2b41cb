//! Learner of the depth law: a Kalman filter on its offset q and slope a, one observation a stroke.
//!
//! It starts from earlier plates of the same kind, else from nothing known. q wanders from stroke to stroke; a stroke that bent less than
//! can be told is a one-sided observation: the plate yields no sooner than at that depth.

use nalgebra::{Matrix2, RowVector2, Vector2};
use platen_model::{LikePlates, PressModel};

use crate::press_law::PressLaw;

/// Standard deviations of offset, metres, and of the slope, share of the closed form's, where nothing is known.
const COLD: [f64; 2] = [0.6e-3, 0.1];
/// Wander of the offset from one stroke to the next, metres: thickness and yield strength vary along a plate.
const WALK: f64 = 0.14e-3;
/// Error of a told depth, metres.
const DEPTH_NOISE: f64 = 0.07e-3;
/// Least error of a measured angle, radians.
const ANGLE_NOISE: f64 = 0.4e-3;
/// Error of the closed form at its knee, radians, and the angles from which it falls to none: real steel yields rounder, and small bends
/// that correct a plate come on top of old ones. Found with fibre steel: 3.9 mrad of scatter at bends of 4 mrad, beside 2.4 expected.
const KNEE: (f64, [f64; 2]) = (3.1e-3, [4e-3, 7e-3]);
/// Strokes that the assumption of the filter's own scatter counts for.
const SPREAD: f64 = 3.0;
/// Scatter of the ram before any is known, metres, and the strokes that this assumption counts for.
const RAM: (f64, f64) = (0.1e-3, 4.0);
/// Angle that is no bend, radians: as much as the surfaces on both sides of a stroke can hide.
pub const LEAST_ANGLE: f64 = 2.5e-3;
/// Half width of a 99 % interval, standard deviations.
const P99: f64 = 2.576;

/// State of the learner on one plate.
#[derive(Debug, Clone)]
pub struct Learner {
    law: PressLaw,
    mean: Vector2<f64>,
    covariance: Matrix2<f64>,
    like_plates: u32,
    strokes: u32,
    ram_square: f64,
    ram_weight: f64,
    off_mark: (f64, f64),
    /// Normalised surprise of each stroke with a told depth, standard deviations; positive when it bent more than expected.
    pub(crate) surprises: Vec<f64>,
}

impl Learner {
    /// Starts from like plates, or from nothing known.
    #[must_use]
    pub fn new(law: PressLaw, like: Option<&LikePlates>) -> Self {
        let cold =
            Matrix2::from_diagonal(&Vector2::new(COLD[0].powi(2), (COLD[1] * law.stiffness()).powi(2)));
        let ram = like.and_then(|like| like.ram_sigma).unwrap_or(RAM.0);
        Self {
            law,
            mean: like.map_or_else(Vector2::zeros, |like| like.mean.into()),
            covariance: like.map_or(cold, |like| {
                let [[qq, qa], [_, aa]] = like.covariance;
                Matrix2::new(qq, qa, qa, aa)
            }),
            like_plates: like.map_or(0, |like| like.plates),
            strokes: 0,
            ram_square: ram * ram * RAM.1,
            ram_weight: RAM.1,
            off_mark: (0.0, 0.0),
            surprises: Vec::new(),
        }
    }

    /// Learns from a stroke of this depth into a plate that sagged by `sag` in the die: the angle that stayed with its standard
    /// deviation, `None` when no bend was found.
    pub fn observe(&mut self, depth: f64, sag: f64, bend: Option<(f64, f64)>) {
        self.covariance[(0, 0)] += WALK * WALK;
        let (angle, sigma) = bend.unwrap_or((LEAST_ANGLE, ANGLE_NOISE));
        let gain_of_angle = RowVector2::new(1.0, angle);
        let innovation = depth - sag - self.law.depth(angle) - (gain_of_angle * self.mean)[0];
        // It bent no more than the least angle: only an offset that would have bent it more is contradicted.
        if bend.is_none() && innovation <= 0.0 {
            return;
        }
        let slope = self.law.stiffness() + self.mean[1];
        let noise = DEPTH_NOISE.powi(2) + (sigma.max(ANGLE_NOISE) * slope).powi(2);
        let variance = (gain_of_angle * self.covariance * gain_of_angle.transpose())[0] + noise;
        let gain = self.covariance * gain_of_angle.transpose() / variance;
        self.mean += gain * innovation;
        self.covariance -= gain * gain_of_angle * self.covariance;
        self.covariance = 0.5 * (self.covariance + self.covariance.transpose());
        self.strokes += 1;
        self.surprises.push(-innovation / variance.sqrt());
    }

    /// Learns how far the ram stopped from the advised depth, metres.
    pub fn observe_ram(&mut self, off: f64) {
        self.ram_square += off * off;
        self.ram_weight += 1.0;
    }

    /// Learns how far a bend lies from its advised line, metres, positive onward.
    pub fn observe_mark(&mut self, off: f64) {
        self.off_mark = (self.off_mark.0 + off, self.off_mark.1 + 1.0);
    }

    /// Returns the depth that leaves `angle` where the plate sags by `sag` in the die, metres.
    #[must_use]
    pub fn depth(&self, angle: f64, sag: f64) -> f64 {
        sag + self.law.depth(angle) + self.mean[0] + self.mean[1] * angle
    }

    /// Returns the standard deviation of the angle that a stroke for `angle` leaves, radians.
    #[must_use]
    pub fn sigma(&self, angle: f64) -> f64 {
        self.sigma_told(angle).hypot(self.ram_sigma() / (self.law.stiffness() + self.mean[1]))
    }

    /// Returns the same where the depth that the ram reached is told, radians.
    #[must_use]
    pub fn sigma_told(&self, angle: f64) -> f64 {
        let row = RowVector2::new(1.0, angle);
        let known = (row * self.covariance * row.transpose())[0];
        let variance = known + WALK * WALK + DEPTH_NOISE * DEPTH_NOISE;
        let (knee, [from, to]) = KNEE;
        let knee = knee * ((to - angle) / (to - from)).clamp(0.0, 1.0);
        ((variance * self.spread()).sqrt() / (self.law.stiffness() + self.mean[1]))
            .hypot(ANGLE_NOISE)
            .hypot(knee)
    }

    /// Returns by how much the strokes so far scattered more than the filter expects, variances; 1 while little is known.
    fn spread(&self) -> f64 {
        let square: f64 = self.surprises.iter().map(|it| it * it).sum();
        ((SPREAD + square) / (SPREAD + self.surprises.len() as f64)).max(1.0)
    }

    /// Returns the standard deviation of the ram about the wanted depth, metres.
    #[must_use]
    pub fn ram_sigma(&self) -> f64 {
        (self.ram_square / self.ram_weight).sqrt()
    }

    /// Returns the mean distance of the bends from their advised lines, drawn to 0 while few are known, metres.
    #[must_use]
    pub fn off_mark(&self) -> f64 {
        self.off_mark.0 / (self.off_mark.1 + 1.0)
    }

    /// Returns whether the last three strokes all lay outside their 99 % intervals.
    #[must_use]
    pub fn is_surprised(&self) -> bool {
        self.surprises.len() >= 3 && self.surprises.iter().rev().take(3).all(|it| it.abs() > P99)
    }

    /// Returns what was learned; `angle` is that of the next bend, radians.
    #[must_use]
    pub fn model(&self, angle: f64) -> PressModel {
        let c = &self.covariance;
        PressModel {
            like_plates: self.like_plates,
            strokes_learned: self.strokes,
            offset: self.mean[0],
            slope: self.mean[1],
            covariance: [[c[(0, 0)], c[(0, 1)]], [c[(1, 0)], c[(1, 1)]]],
            sigma_angle: self.sigma(angle),
            ram_sigma: self.ram_sigma(),
            off_mark: self.off_mark(),
        }
    }
}

/// Least number of like plates whose own scatter counts as much as the assumption.
const SHRINK: f64 = 3.0;

/// Combines what finished plates of the same kind learned; `None` without one. Their scatter is drawn to that of nothing known
/// while they are few.
#[must_use]
pub fn like_plates(law: &PressLaw, models: &[PressModel]) -> Option<LikePlates> {
    if models.is_empty() {
        return None;
    }
    let n = models.len() as f64;
    let mean = models.iter().map(|it| Vector2::new(it.offset, it.slope)).sum::<Vector2<f64>>() / n;
    let cold = Vector2::new(COLD[0].powi(2), (COLD[1] * law.stiffness()).powi(2));
    let scatter: Matrix2<f64> = models
        .iter()
        .map(|it| {
            let off = Vector2::new(it.offset, it.slope) - mean;
            off * off.transpose()
        })
        .sum();
    // A plate like the others is predicted by the scatter and the error of the mean.
    let covariance =
        (scatter + Matrix2::from_diagonal(&cold) * SHRINK) / (n + SHRINK) * (1.0 + 1.0 / (n + SHRINK));
    let ram = (models.iter().map(|it| it.ram_sigma.powi(2)).sum::<f64>() / n).sqrt();
    Some(LikePlates {
        plates: models.len().try_into().unwrap_or(u32::MAX),
        mean: mean.into(),
        covariance: [[covariance[(0, 0)], covariance[(0, 1)]], [covariance[(1, 0)], covariance[(1, 1)]]],
        ram_sigma: Some(ram),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use platen_model::{Die, Steel};

    fn law() -> PressLaw {
        let die = Die { id: 1, opening: 0.36, edge: 0.2 };
        PressLaw::new(&die, &Steel { grade: None, yield_strength: 440e6, heat: None }, 0.036)
    }

    #[test]
    fn offset_and_slope_of_exact_strokes_are_found() {
        let (law, q, a) = (law(), 0.7e-3, 0.012);
        let mut learner = Learner::new(law, None);
        let cold = learner.sigma(0.02);
        for angle in [0.012, 0.03, 0.02, 0.035, 0.015, 0.025] {
            learner.observe(0.001 + law.depth(angle) + q + a * angle, 0.001, Some((angle, 0.1e-3)));
        }
        assert!(learner.sigma(0.02) < 0.3 * cold);
        let wanted = law.depth(0.02) + q + a * 0.02;
        assert!((learner.depth(0.02, 0.0) - wanted).abs() < 0.02e-3, "{}", learner.depth(0.02, 0.0) - wanted);
    }

    #[test]
    fn a_stroke_without_a_bend_teaches_only_when_a_bend_was_expected() {
        let law = law();
        let mut learner = Learner::new(law, None);
        learner.observe(law.depth(LEAST_ANGLE) - 0.5e-3, 0.0, None);
        assert_eq!(learner.model(0.02).offset, 0.0);
        learner.observe(law.depth(0.02), 0.0, None);
        assert!(learner.model(0.02).offset > 0.5e-3);
    }

    #[test]
    fn like_plates_start_nearer_and_surer() {
        let law = law();
        let mut models = Vec::new();
        for q in [0.4e-3, 0.5e-3, 0.6e-3, 0.55e-3, 0.45e-3] {
            let mut learner = Learner::new(law, None);
            for angle in [0.02, 0.03] {
                learner.observe(law.depth(angle) + q, 0.0, Some((angle, 0.1e-3)));
            }
            models.push(learner.model(0.02));
        }
        let like = like_plates(&law, &models);
        let learner = Learner::new(law, like.as_ref());
        assert!((learner.depth(0.02, 0.0) - law.depth(0.02) - 0.5e-3).abs() < 0.1e-3);
        assert!(learner.sigma(0.02) < 0.8 * Learner::new(law, None).sigma(0.02));
    }
}
