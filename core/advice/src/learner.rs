//! Learner of the depth law: Gaussian process regression of its offset q along the plate, with its slope a.
//!
//! In: reported depths and measured angles of strokes. Out: offset and slope with their covariance, and from these the
//! depth for an angle and the scatter of the angle.
//!
//! - A stroke at x that left the angle th observes q(x) + a th.
//! - q is the sum of a mean over the plate, which is predicted from earlier plates of the same kind, and a departure
//!   that is correlated between neighbouring places. Thickness and yield strength vary along a plate, so that a bend is
//!   predicted best by the strokes beside it.
//! - A stroke that bent the plate by less than can be detected is a one-sided observation: the plate yields no sooner
//!   than at that depth.
//!
//! Source: Rasmussen, Williams, "Gaussian processes for machine learning", 2006, sections 2.2 and 2.7.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix2, RowVector2, Vector2};
use platen_model::{LikePlates, PressModel};

use crate::press_law::PressLaw;

/// Prior standard deviations without earlier plates: of the offset, metres, and of the slope, share of that of the
/// closed form.
const COLD: [f64; 2] = [0.6e-3, 0.1];
/// Departure of the offset from its mean over the plate, metres, one standard deviation, and its correlation length
/// (distance over which the correlation falls to 1/e), metres: thickness (EN 10029: about a millimetre from the
/// thinnest to the thickest place of a plate) and yield strength vary.
const DEPARTURE: (f64, f64) = (0.3e-3, 2.0);
/// Usual distance of neighbouring bends, metres.
const FEED: f64 = 0.3;
/// Error of a reported depth, metres, including the variation from stroke to stroke at one place.
const DEPTH_NOISE: f64 = 0.10e-3;
/// Least error of a measured angle, radians.
const ANGLE_NOISE: f64 = 0.4e-3;
/// Angle by which a small bend is larger than by the closed form, radians, and the range of angles in which this excess
/// falls to zero. Steel yields more gradually than in the closed form, whose offset is learned from large bends. Found
/// with the steel of the fibre model: 3.2 mrad where 2.5 were wanted, 1 at 6 to 8.
const ROUND_KNEE: (f64, [f64; 2]) = (3.2e-3, [5.7e-3, 9e-3]);
/// Scatter of that angle from bend to bend, radians, one standard deviation. Found with the steel of the fibre model:
/// 1.4 mrad.
const KNEE: f64 = 1.4e-3;
/// Number of strokes whose weight the assumed scatter has beside the observed one.
const SPREAD: f64 = 3.0;
/// Scatter of the ram before any is known, metres, and the number of strokes whose weight this assumption has.
const RAM: (f64, f64) = (0.1e-3, 4.0);
/// Scatter of the place of a bend before any is known, metres, and the number of strokes whose weight this assumption
/// has.
pub(crate) const PLACE: (f64, f64) = (9.2e-3, 4.0);
/// Least angle of a bend, radians: a smaller one can be hidden by the errors of the surfaces before and after a stroke.
pub const LEAST_ANGLE: f64 = 2.5e-3;
/// Half width of a 99 % interval, standard deviations.
const P99: f64 = 2.576;

/// Observation of offset and slope by one stroke.
#[derive(Debug, Clone, Copy)]
struct Observed {
    /// Coordinate of the bend, metres.
    x: f64,
    angle: f64,
    /// Depth in excess of sag and closed form, metres, and the variance of its error.
    depth: f64,
    noise: f64,
}

/// State of the learner on one plate.
#[derive(Debug, Clone)]
pub struct Learner {
    law: PressLaw,
    /// Mean and covariance of offset and slope before the first stroke.
    mean: Vector2<f64>,
    covariance: Matrix2<f64>,
    like_plates: u32,
    observed: Vec<Observed>,
    /// Factored covariance of the observations, and its inverse times their departures from the mean; `None` before the
    /// first.
    solved: Option<(Cholesky<f64, Dyn>, DVector<f64>)>,
    ram_square: f64,
    ram_weight: f64,
    /// Sum, sum of squares and number of the distances of bends from their advised lines.
    marks: [f64; 3],
    /// Normalised innovation of each stroke with a reported depth, standard deviations; positive when it bent more than
    /// expected.
    pub(crate) surprises: Vec<f64>,
}

impl Learner {
    /// Builds the learner from like plates, or from the prior.
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
            observed: Vec::new(),
            solved: None,
            ram_square: ram * ram * RAM.1,
            ram_weight: RAM.1,
            marks: [0.0; 3],
            surprises: Vec::new(),
        }
    }

    /// Adds the observation of a stroke of this depth at x into a plate that sagged by `sag` in the die. `bend` is the
    /// angle that remained with its standard deviation; `None` when no bend was found.
    pub fn observe(&mut self, x: f64, depth: f64, sag: f64, bend: Option<(f64, f64)>) {
        let (angle, sigma) = bend.unwrap_or((LEAST_ANGLE, ANGLE_NOISE));
        let depth = depth - sag - self.closed_form(angle);
        let (expected, variance) = self.expected(x, angle);
        let innovation = depth - expected;
        // The bend is at most the least angle: this contradicts only an offset that would have given a larger bend.
        if bend.is_none() && innovation <= 0.0 {
            return;
        }
        let noise = DEPTH_NOISE.powi(2)
            + (sigma.max(ANGLE_NOISE).hypot(KNEE * at_knee(angle)) * self.slope()).powi(2);
        self.surprises.push(-innovation / (variance + noise).sqrt());
        self.observed.push(Observed { x, angle, depth, noise });
        self.solve();
    }

    /// Returns the depth that leaves an angle on a flat plate by the closed form with a rounded knee, metres.
    fn closed_form(&self, angle: f64) -> f64 {
        self.law.depth(angle) - ROUND_KNEE.0 * at_knee(angle) * self.law.stiffness()
    }

    /// Returns the expected depth in excess of sag and closed form for an angle at x, metres, and its variance.
    fn expected(&self, x: f64, angle: f64) -> (f64, f64) {
        let row = RowVector2::new(1.0, angle);
        let prior = (row * self.covariance * row.transpose())[0] + DEPARTURE.0.powi(2);
        let mean = (row * self.mean)[0];
        let Some((factor, weights)) = &self.solved else { return (mean, prior) };
        let shared = DVector::from_iterator(
            self.observed.len(),
            self.observed.iter().map(|it| self.shared((it.x, it.angle), (x, angle))),
        );
        let known = shared.dot(&factor.solve(&shared));
        (mean + shared.dot(weights), (prior - known).max(0.0))
    }

    /// Returns the covariance of the depths at two places for two angles, square metres.
    fn shared(&self, (x, angle): (f64, f64), (y, other): (f64, f64)) -> f64 {
        let of_plate = (RowVector2::new(1.0, angle) * self.covariance * Vector2::new(1.0, other))[0];
        of_plate + DEPARTURE.0.powi(2) * (-(x - y).abs() / DEPARTURE.1).exp()
    }

    fn solve(&mut self) {
        let at = |k: usize| (self.observed[k].x, self.observed[k].angle);
        let n = self.observed.len();
        let noise = |k: usize, l: usize| if k == l { self.observed[k].noise } else { 0.0 };
        let covariance = DMatrix::from_fn(n, n, |k, l| self.shared(at(k), at(l)) + noise(k, l));
        let departs = |it: &Observed| it.depth - self.mean[0] - self.mean[1] * it.angle;
        let departs = DVector::from_iterator(n, self.observed.iter().map(departs));
        self.solved = covariance.cholesky().map(|factor| {
            let weights = factor.solve(&departs);
            (factor, weights)
        });
    }

    /// Returns mean and covariance of offset and slope over the plate.
    fn of_plate(&self) -> (Vector2<f64>, Matrix2<f64>) {
        let Some((factor, weights)) = &self.solved else { return (self.mean, self.covariance) };
        let rows = DMatrix::from_fn(2, self.observed.len(), |k, l| {
            (self.covariance * Vector2::new(1.0, self.observed[l].angle))[k]
        });
        let gain = &rows * weights;
        let known = &rows * factor.solve(&rows.transpose());
        let known = Matrix2::from_fn(|k, l| 0.5 * (known[(k, l)] + known[(l, k)]));
        (self.mean + Vector2::new(gain[0], gain[1]), self.covariance - known)
    }

    /// Returns the change of depth with the angle, metres per radian.
    fn slope(&self) -> f64 {
        self.law.stiffness() + self.of_plate().0[1]
    }

    /// Adds the distance by which the ram stopped off the advised depth, metres.
    pub fn observe_ram(&mut self, off: f64) {
        self.ram_square += off * off;
        self.ram_weight += 1.0;
    }

    /// Adds the distance of a bend from its advised line, metres, positive towards larger x.
    pub fn observe_mark(&mut self, off: f64) {
        let [sum, squares, n] = self.marks;
        self.marks = [sum + off, squares + off * off, n + 1.0];
    }

    /// Returns the depth that leaves `angle` at x, where the plate sags by `sag` in the die, metres.
    #[must_use]
    pub fn depth(&self, x: f64, angle: f64, sag: f64) -> f64 {
        sag + self.closed_form(angle) + self.expected(x, angle).0
    }

    /// Returns the standard deviation of the angle that a stroke for `angle` at x leaves, radians.
    #[must_use]
    pub fn sigma(&self, x: f64, angle: f64) -> f64 {
        self.sigma_reported(x, angle).hypot(self.ram_sigma() / self.slope())
    }

    /// Returns the same for a bend beside another one near x, as all bends except the first are.
    #[must_use]
    pub fn sigma_beside(&self, x: f64, angle: f64) -> f64 {
        if !self.observed.is_empty() {
            return self.sigma(x, angle);
        }
        let by_neighbour = DEPARTURE.0.powi(2) * (-2.0 * FEED / DEPARTURE.1).exp();
        let variance = self.expected(x, angle).1 - by_neighbour;
        self.angle_sigma(variance, angle).hypot(self.ram_sigma() / self.slope())
    }

    /// Returns the same where the press reports the depth that the ram reached, radians.
    #[must_use]
    pub fn sigma_reported(&self, x: f64, angle: f64) -> f64 {
        self.angle_sigma(self.expected(x, angle).1, angle)
    }

    /// Returns the standard deviation of an angle, radians, from the variance of the expected depth, square metres.
    fn angle_sigma(&self, variance: f64, angle: f64) -> f64 {
        let variance = variance + DEPTH_NOISE * DEPTH_NOISE;
        ((variance * self.spread()).sqrt() / self.slope()).hypot(ANGLE_NOISE).hypot(KNEE * at_knee(angle))
    }

    /// Returns the ratio of the observed to the expected variance of the strokes so far; 1 while little is known.
    fn spread(&self) -> f64 {
        let square: f64 = self.surprises.iter().map(|it| it * it).sum();
        ((SPREAD + square) / (SPREAD + self.surprises.len() as f64)).max(1.0)
    }

    /// Returns the standard deviation of the ram about the wanted depth, metres.
    #[must_use]
    pub fn ram_sigma(&self) -> f64 {
        (self.ram_square / self.ram_weight).sqrt()
    }

    /// Returns the mean distance of the bends from their advised lines, shrunk to 0 while few are known, metres.
    #[must_use]
    pub fn off_mark(&self) -> f64 {
        self.marks[0] / (self.marks[2] + 1.0)
    }

    /// Returns the standard deviation of the place of a bend about its line, metres.
    #[must_use]
    pub fn place_sigma(&self) -> f64 {
        let [sum, squares, n] = self.marks;
        let about_mean = squares - sum * sum / n.max(1.0);
        ((PLACE.1 * PLACE.0.powi(2) + about_mean.max(0.0)) / (PLACE.1 + (n - 1.0).max(0.0))).sqrt()
    }

    /// Returns whether the last three strokes all lay outside their 99 % intervals.
    #[must_use]
    pub fn is_surprised(&self) -> bool {
        self.surprises.len() >= 3 && self.surprises.iter().rev().take(3).all(|it| it.abs() > P99)
    }

    /// Returns what was learned; the next bend is one of `angle`, radians, at x.
    #[must_use]
    pub fn model(&self, x: f64, angle: f64) -> PressModel {
        let (mean, c) = self.of_plate();
        PressModel {
            like_plates: self.like_plates,
            strokes_learned: self.observed.len().try_into().unwrap_or(u32::MAX),
            offset: mean[0],
            slope: mean[1],
            covariance: [[c[(0, 0)], c[(0, 1)]], [c[(1, 0)], c[(1, 1)]]],
            sigma_angle: self.sigma(x, angle),
            ram_sigma: self.ram_sigma(),
            off_mark: self.off_mark(),
        }
    }
}

/// Returns the share of the closed form's error at the knee that remains at an angle.
fn at_knee(angle: f64) -> f64 {
    let [from, to] = ROUND_KNEE.1;
    ((to - angle) / (to - from)).clamp(0.0, 1.0)
}

/// Number of like plates whose own scatter has the same weight as the assumption.
const SHRINK: f64 = 3.0;

/// Combines the results of finished plates of the same kind; `None` without any. Their scatter is shrunk to the prior
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
        let die = Die { id: 1, opening: 0.36, edge: 0.2, punch_radius: None };
        PressLaw::new(&die, &Steel { grade: None, yield_strength: 440e6, heat: None }, 0.036)
    }

    #[test]
    fn offset_and_slope_of_exact_strokes_are_found() {
        let (law, q, a) = (law(), 0.7e-3, 0.012);
        let mut learner = Learner::new(law, None);
        let cold = learner.sigma(1.0, 0.02);
        for angle in [0.012, 0.03, 0.02, 0.035, 0.015, 0.025] {
            learner.observe(1.0, 0.001 + law.depth(angle) + q + a * angle, 0.001, Some((angle, 0.1e-3)));
        }
        assert!(learner.sigma(1.0, 0.02) < 0.3 * cold);
        let wanted = law.depth(0.02) + q + a * 0.02;
        assert!(
            (learner.depth(1.0, 0.02, 0.0) - wanted).abs() < 0.02e-3,
            "{}",
            learner.depth(1.0, 0.02, 0.0) - wanted
        );
    }

    /// A plate 0.8 mm thicker at its far end: for a bend back at the first end the strokes made there count, not the
    /// last ones.
    #[test]
    fn an_offset_that_changes_along_the_plate_is_followed_back() {
        let law = law();
        let offset = |x: f64| 0.2e-3 + 0.8e-3 * x / 3.0;
        let mut learner = Learner::new(law, None);
        for k in 0..10 {
            let x = 0.25 + 0.27 * f64::from(k);
            learner.observe(x, law.depth(0.03) + offset(x), 0.0, Some((0.03, 0.1e-3)));
        }
        for x in [0.4, 1.5, 2.6] {
            let off = learner.depth(x, 0.03, 0.0) - law.depth(0.03) - offset(x);
            assert!(off.abs() < 0.05e-3, "{x} m: {off}");
        }
        assert!(learner.sigma(1.5, 0.03) < 0.8 * learner.sigma(6.0, 0.03));
    }

    #[test]
    fn a_stroke_without_a_bend_teaches_only_when_a_bend_was_expected() {
        let law = law();
        let mut learner = Learner::new(law, None);
        learner.observe(1.0, law.depth(LEAST_ANGLE) - 0.5e-3, 0.0, None);
        assert_eq!(learner.model(1.0, 0.02).offset, 0.0);
        learner.observe(1.0, law.depth(0.02), 0.0, None);
        assert!(learner.model(1.0, 0.02).offset > 0.5e-3);
    }

    #[test]
    fn like_plates_start_nearer_and_surer() {
        let law = law();
        let mut models = Vec::new();
        for q in [0.4e-3, 0.5e-3, 0.6e-3, 0.55e-3, 0.45e-3].repeat(4) {
            let mut learner = Learner::new(law, None);
            for k in 0..10 {
                let (x, angle) = (0.25 + 0.27 * f64::from(k), [0.02, 0.03][k as usize % 2]);
                learner.observe(x, law.depth(angle) + q, 0.0, Some((angle, 0.1e-3)));
            }
            models.push(learner.model(1.0, 0.02));
        }
        let like = like_plates(&law, &models);
        let learner = Learner::new(law, like.as_ref());
        assert!((learner.depth(1.0, 0.02, 0.0) - law.depth(0.02) - 0.5e-3).abs() < 0.1e-3);
        assert!(learner.sigma(1.0, 0.02) < 0.8 * Learner::new(law, None).sigma(1.0, 0.02));
    }
}
