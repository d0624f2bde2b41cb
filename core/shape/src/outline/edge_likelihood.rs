//! Likelihood of an edge position given one lattice line (a row or a column of the lattice that crosses the edge).
//!
//! The observation is interval-censored: the edge lies between the last sample on the face and the first beyond it. Both ends
//! of the interval are probit-smoothed by the pointing noise of the beams, and the likelihood is a mixture with a
//! constant for outliers (lines that belong to something else). What narrows the interval:
//!
//! - A mixed pixel sees both sides: the edge is within a footprint of its beam. A beam that is not mixed has its centre on its
//!   own side, and most likely a footprint away; a quarter of the mixed beams is mixed too little to be detected.
//! - Where the plate's side face is visible, its lower edge mixes the beams; that edge's place beside the upper one follows from
//!   the thickness. A beam on a side face of a few millimetres falls behind the face's continuation in proportion to its
//!   distance from the edge: a direct observation.
//! - The last cell taken for one of the face may itself lie on the side face, within the noise: both its range and that of the
//!   first cell not taken enter, else the selection would bias the edge outwards.
//!
//! In: a projected crossing in its developed strip; out: [`EdgeLikelihood`], whose Newton steps `edge` adds up and whose values
//! `edge_posterior` samples. All distances inwards, in metres. Own; Masuda et al. take the boundary samples as the edge.

use platen_numerics::normal_distribution::{CERTAIN, cdf, log_cdf};

use super::developed_strip::DevelopedStrip;
use super::projected_crossing::ProjectedCrossing;
use crate::Vec3;
use crate::extract::Beyond;

/// Standard deviation of an interval's ends in parts of the angle between beams: pointing of the beam, shape of the footprint.
pub(super) const SOFTNESS: f64 = 0.03;

/// Noise of the smooth face near its edges in parts of that of a sample.
const FACE_NOISE: f64 = 0.03;

/// Least curvature of a line's log likelihood in a Newton step, 1/m^2.
const LEAST_BEND: f64 = 1e2;

/// Part of the lines that are outliers, and the likelihood of an edge position given one of those.
const OUTLIER_PART: f64 = 0.05;
const OUTLIER_LIKELIHOOD: f64 = 0.1;

/// Part of the beams that see both sides of an edge and are not detected as mixed.
const HIDDEN_PART: f64 = 0.25;

/// A beam less than this part of the seen side face outside of the edge is on it; tangent of the angle by which a cut
/// may be out of square.
const SIDE_SLACK: f64 = 1.1;
const SIDE_SLOPE: f64 = 0.1;

/// The direction of an edge is known to about this, radians: a side face visible under a smaller angle is taken as hidden.
const DIRECTION: f64 = 0.02;

/// Relative standard deviation between the footprint of one edge and that of all: it is not quite round.
pub(super) const FOOTPRINT_SPREAD: f64 = 0.3;

/// Properties of the beams.
#[derive(Debug, Clone, Copy)]
pub(super) struct BeamModel {
    /// Half the angle that a beam sees, radians.
    pub(super) footprint: f64,
    /// Standard deviation of an interval's ends, in parts of the angle between beams.
    pub(super) softness: f64,
}

impl BeamModel {
    /// Builds beams of the usual softness.
    pub(super) fn of(footprint: f64) -> Self {
        Self { footprint, softness: SOFTNESS }
    }
}

/// One lattice line where it crosses an edge, in the edge's developed strip. Distances inwards, metres.
#[derive(Debug, Clone, Copy)]
pub(super) struct LatticeLine {
    pub(super) along: f64,
    /// Column and row of the last cell of the face.
    pub(super) place: [u32; 2],
    low: f64,
    high: f64,
    /// Lowest and highest mixed pixel.
    mixed: Option<(f64, f64)>,
    complete: bool,
    beyond: Beyond,
    /// Distance inwards on the face per radian of footprint.
    per_radian: f64,
    /// The same per angle between beams.
    per_angle: f64,
    /// Distance inwards per lattice step.
    per_step: f64,
    /// Distance outside of the edge at which the plate's lower edge is seen, on the face's continuation; 0 where it is hidden.
    side: f64,
    /// Distance inwards per range by which a beam falls behind the face's continuation on a square side face.
    per_range: f64,
    /// The nearest cell off the face, and its range behind the face's continuation.
    off: f64,
    excess: f64,
    /// The last cell of the face, and its range behind the face.
    cell: f64,
    residual: f64,
}

impl LatticeLine {
    /// Places a crossing in its strip; `angle` is that between beams, radians.
    pub(super) fn new(
        strip: &DevelopedStrip,
        settled: &ProjectedCrossing,
        thickness: f64,
        angle: f64,
    ) -> Self {
        let crossing = &settled.crossing;
        let [inside, outside] = [crossing.inside, crossing.outside].map(|p| strip.flatten(p));
        let mixed = crossing.mixed.map(|ends| ends.map(|p| strip.flatten(p).y));
        let along = 0.5 * (inside.x + outside.x);
        let (beam, normal, inward) = (crossing.inside.normalize(), crossing.normal, strip.inward(along));
        let per_radian = inwards_per_radian(crossing.inside, normal, inward);
        // The lower edge lies `thickness` below; its beam meets the face's plane, `height` from the scanner, at
        // height / (height + thickness) of its way.
        let height = -normal.dot(&crossing.inside);
        let side = inward.dot(&crossing.inside) * thickness / (height + thickness);
        let (off, excess) = match mixed {
            Some([near, _]) => (near, crossing.mixed_excess),
            None => (inside.y.min(outside.y), crossing.excess),
        };
        Self {
            along,
            place: settled.place,
            low: inside.y.min(outside.y),
            high: inside.y.max(outside.y),
            mixed: mixed.map(|[a, b]| (a.min(b), a.max(b))),
            complete: crossing.complete,
            beyond: crossing.beyond,
            per_radian,
            per_angle: angle * per_radian,
            per_step: (inside.y - outside.y).abs() / f64::from(crossing.cells.max(1)),
            side: if side > DIRECTION * thickness { side } else { 0.0 },
            per_range: inward.dot(&beam),
            off,
            excess: f64::from(excess),
            cell: strip.flatten(settled.cell).y,
            residual: settled.residual,
        }
    }

    /// Returns true when the plate ends here in front of something and every cell up to there was measured: such lines show the
    /// footprint.
    fn shows_footprint(&self) -> bool {
        self.complete && self.beyond == Beyond::Behind && self.side == 0.0
    }

    /// Returns true when an edge at `at` is within `slack` of the interval.
    pub(super) fn is_near(&self, at: f64, slack: f64) -> bool {
        self.low - slack < at && at < self.high + slack
    }

    /// Returns the likelihood of an edge position given this line; `noise` is that of ranges, metres.
    pub(super) fn likelihood(&self, beam: BeamModel, noise: f64) -> EdgeLikelihood {
        let noise = noise * self.per_range.abs();
        let soft = norm(beam.softness * self.per_angle, FACE_NOISE * noise);
        let seen = beam.footprint * self.per_radian;
        let of = |terms| EdgeLikelihood { along: self.along, terms };
        let last =
            EdgeObservation::Last { cell: self.cell, behind: self.residual * self.per_range }.within(noise);
        if self.beyond == Beyond::SideFace {
            // Given as two standard deviations about the crease.
            let soft = norm(soft, 0.25 * (self.high - self.low));
            return of([EdgeObservation::At(0.5 * (self.low + self.high)).within(soft), last]);
        }
        let on_side = self.excess * self.per_range;
        // Of a side face a few beams wide each may pass for mixed.
        if self.side > 0.0
            && self.beyond == Beyond::Behind
            && (self.mixed.is_none() || on_side > -3.0 * noise)
            && on_side < SIDE_SLACK * self.side + 3.0 * noise
        {
            let soft = norm(norm(soft, noise), SIDE_SLOPE * on_side);
            return of([EdgeObservation::At(self.off + on_side).within(soft), last]);
        }
        let mut above = Bound { sure: self.low, likely: self.low };
        // A beam within a footprint of the edge sees beyond the plate if the side face is narrower than that.
        let mut below =
            Bound { sure: self.high + self.side.min(seen), likely: self.high - (seen - self.side).max(0.0) };
        if self.beyond == Beyond::Behind {
            above.sure += self.side;
            above.likely += self.side + seen;
        }
        if let Some((lowest, highest)) = self.mixed {
            let (least, most) = (highest + self.side - seen, lowest + self.side + seen);
            above = Bound { sure: above.sure.max(least), likely: above.likely.max(least) };
            below = Bound { sure: below.sure.min(most), likely: below.likely.min(most) };
        } else if self.side > seen && noise > 0.0 {
            return of([EdgeObservation::Above(above).within(soft), last]);
        }
        of([EdgeObservation::Above(above), EdgeObservation::Below(below)]
            .map(|observation| observation.within(soft)))
    }
}

/// Returns the distance inwards on the face by which a beam to `point` moves when it turns, per radian; `normal` and `inward` are
/// unit vectors there.
pub(super) fn inwards_per_radian(point: Vec3, normal: Vec3, inward: Vec3) -> f64 {
    let beam = point.normalize();
    // A beam turned by an angle in the direction e meets the face r (e - beam (n e) / (n beam)) away: the
    // inward part of that, over all e across the beam, is the length of this vector.
    let lever = inward - normal * (inward.dot(&beam) / normal.dot(&beam));
    point.norm() * (lever - beam * lever.dot(&beam)).norm()
}

/// Returns true when the side face below the edge at `point` is seen: there the edge is located by the ranges on it.
pub(super) fn shows_side_face(point: Vec3, normal: Vec3, inward: Vec3) -> bool {
    inward.dot(&point) > -normal.dot(&point) * DIRECTION
}

/// Estimates half the angle over which a beam sees both sides of an edge from the number of mixed pixels on all edges; 0 where
/// too few lines show it. `angle` is that between beams.
pub(super) fn footprint<'a>(lines: impl Iterator<Item = &'a LatticeLine>, angle: f64) -> f64 {
    /// Lines that give the number to a tenth.
    const LEAST_LINES: usize = 100;
    /// A line that meets an edge at less than a third of a step per cell may not have reached its far side.
    const MOST_CELLS: f64 = 3.0;
    let (mut n, mut mixed, mut expected) = (0, 0.0, 0.0);
    for line in lines.filter(|l| l.shows_footprint() && l.per_radian * angle < MOST_CELLS * l.per_step) {
        n += 1;
        mixed += line.mixed.map_or(0.0, |(low, high)| (high - low) / line.per_step + 1.0);
        expected += 2.0 * (1.0 - HIDDEN_PART) * line.per_radian / line.per_step;
    }
    if n >= LEAST_LINES { mixed / expected } else { 0.0 }
}

/// Estimates the footprint at an edge of known place, near that of all edges, by maximum likelihood of its mixed and its sound
/// pixels; two nested grid searches.
pub(super) fn footprint_at(lines: &[LatticeLine], edge: impl Fn(f64) -> f64, all: f64) -> f64 {
    /// Steps to each side and their size, in parts of `all`: coarse ones first, then finer ones about the best.
    const SEARCH: [(i32, f64); 2] = [(5, 0.16), (7, 0.02)];
    /// Lines whose likelihoods are multiplied before a logarithm is taken: each is above 10^-4.
    const TOGETHER: usize = 16;
    let showing: Vec<(&LatticeLine, f64)> =
        lines.iter().filter(|l| l.shows_footprint()).map(|l| (l, edge(l.along))).collect();
    let likelihood = |line: &LatticeLine, edge: f64, footprint: f64| {
        let seen = footprint * line.per_radian;
        let is_mixed =
            |off: f64| (1.0 - HIDDEN_PART) * cdf((seen - (off - edge).abs()) / (SOFTNESS * line.per_angle));
        let sound = (1.0 - is_mixed(line.high)) * (1.0 - is_mixed(line.low));
        line.mixed.map_or(sound, |(low, high)| {
            sound * (is_mixed(low) + OUTLIER_PART) * (is_mixed(high) + OUTLIER_PART)
        })
    };
    let fits = |footprint: f64| {
        let off = (footprint / all - 1.0) / FOOTPRINT_SPREAD;
        let together = |lines: &[(&LatticeLine, f64)]| {
            lines.iter().map(|(l, e)| likelihood(l, *e, footprint)).product::<f64>()
        };
        showing.chunks(TOGETHER).map(|lines| together(lines).ln()).sum::<f64>() - 0.5 * off * off
    };
    SEARCH.iter().fold(all, |from, (steps, size)| {
        let trials = (-steps..=*steps).map(|k| from + all * size * f64::from(k));
        let trials = trials.map(|footprint| (fits(footprint), footprint));
        trials.max_by(|a, b| a.0.total_cmp(&b.0)).map_or(from, |(_, footprint)| footprint)
    })
}

/// Likelihood of an edge position given one lattice line: the product of two independent terms, mixed with a constant for
/// outliers.
#[derive(Debug, Clone, Copy)]
pub(super) struct EdgeLikelihood {
    pub(super) along: f64,
    terms: [Term; 2],
}

/// One observation of the edge and its standard deviation, metres.
#[derive(Debug, Clone, Copy)]
struct Term {
    observation: EdgeObservation,
    soft: f64,
}

/// One observation of the edge position. Distances inwards, metres.
#[derive(Debug, Clone, Copy)]
enum EdgeObservation {
    /// A direct observation.
    At(f64),
    /// Censored from below: the edge is inside of this.
    Above(Bound),
    /// Censored from above: the edge is outside of this.
    Below(Bound),
    /// The last cell of the face: the edge is outside of it, or it lies on the side face, `behind` outside of the edge by its
    /// noisy range.
    Last { cell: f64, behind: f64 },
}

/// Censoring bound as a mixture of two: at `likely` where the beam would have been detected as mixed, at `sure`, farther out,
/// where not.
#[derive(Debug, Clone, Copy)]
struct Bound {
    sure: f64,
    likely: f64,
}

impl Bound {
    /// Returns the likelihood of an edge by its distances inside of the two bounds, in standard deviations.
    fn value(sure: f64, likely: f64) -> f64 {
        HIDDEN_PART * cdf(sure) + (1.0 - HIDDEN_PART) * cdf(likely)
    }

    /// Returns the same with the slope of its logarithm and the negative second derivative of a lower bound of that (expectation
    /// maximisation, so that a Newton step never meets a negative curvature).
    fn likelihood(sure: f64, likely: f64) -> (f64, f64, f64) {
        if sure.min(likely) > CERTAIN {
            return (1.0, 0.0, 0.0);
        }
        let (a, b) = (log_cdf(sure), log_cdf(likely));
        let (a_part, b_part) = (HIDDEN_PART * a.cdf, (1.0 - HIDDEN_PART) * b.cdf);
        let sum = (a_part + b_part).max(f64::MIN_POSITIVE);
        let (a_part, b_part) = (a_part / sum, b_part / sum);
        (sum, a_part * a.slope + b_part * b.slope, a_part * a.bend + b_part * b.bend)
    }
}

impl EdgeObservation {
    fn within(self, soft: f64) -> Term {
        Term { observation: self, soft }
    }
}

impl Term {
    /// Returns the likelihood of an edge at `at`, the slope of its logarithm, per metre, and its negative second derivative.
    fn likelihood(&self, at: f64, least_soft: f64) -> (f64, f64, f64) {
        let soft = self.soft.max(least_soft);
        let (sign, (likelihood, slope, bend)) = match self.observation {
            EdgeObservation::At(place) => {
                let off = (place - at) / soft;
                (1.0, ((-0.5 * off * off).exp(), off, 1.0))
            }
            EdgeObservation::Above(Bound { sure, likely }) => {
                (1.0, Bound::likelihood((at - sure) / soft, (at - likely) / soft))
            }
            EdgeObservation::Below(Bound { sure, likely }) => {
                (-1.0, Bound::likelihood((sure - at) / soft, (likely - at) / soft))
            }
            EdgeObservation::Last { cell, behind } => {
                let (off, behind) = (((at - cell) / soft).max(0.0), behind / soft);
                let bend = f64::from(off > 0.0);
                let log = off * (behind - 0.5 * off);
                (1.0, (log.min(0.0).exp(), bend * (behind - off), bend))
            }
        };
        (likelihood, sign * slope / soft, bend / (soft * soft))
    }

    /// Returns the likelihood of an edge at `at`.
    fn value(&self, at: f64) -> f64 {
        let bound = |sure: f64, likely: f64| Bound::value(sure / self.soft, likely / self.soft);
        match self.observation {
            EdgeObservation::Above(Bound { sure, likely }) => bound(at - sure, at - likely),
            EdgeObservation::Below(Bound { sure, likely }) => bound(sure - at, likely - at),
            EdgeObservation::At(_) | EdgeObservation::Last { .. } => self.likelihood(at, 0.0).0,
        }
    }

    /// Returns the end of the interval at this side.
    fn limit(&self) -> f64 {
        match self.observation {
            EdgeObservation::At(place) => place,
            EdgeObservation::Above(bound) | EdgeObservation::Below(bound) => bound.likely,
            EdgeObservation::Last { cell, .. } => cell,
        }
    }

    /// Returns true when an edge at `at` agrees with the observation within `slack`.
    fn agrees(&self, at: f64, slack: f64) -> bool {
        match self.observation {
            EdgeObservation::At(place) => (place - at).abs() < slack,
            EdgeObservation::Above(bound) => bound.sure - slack < at,
            EdgeObservation::Below(bound) => at < bound.sure + slack,
            EdgeObservation::Last { cell, behind } => at < cell + behind.max(0.0) + slack,
        }
    }
}

impl EdgeLikelihood {
    /// Returns (place, weight) of the interval's middle, with the variance of a uniform distribution: the start of the search.
    pub(super) fn middle(&self, step: f64) -> (f64, f64) {
        let [first, second] = &self.terms;
        if let EdgeObservation::At(place) = first.observation {
            return (place, 12.0 / (step * step));
        }
        let (above, below) = (first.limit(), second.limit());
        (0.5 * (above + below), 12.0 / (below - above).max(step).powi(2))
    }

    /// Returns the likelihood of an edge at `at`, up to a constant factor.
    pub(super) fn value(&self, at: f64) -> f64 {
        let [a, b] = self.terms.map(|term| term.value(at));
        (1.0 - OUTLIER_PART) * a * b + OUTLIER_PART * OUTLIER_LIKELIHOOD
    }

    /// Returns one Newton step of the log likelihood from `at`: the place it leads to and its weight (the curvature). The weight
    /// fades where the line is more likely an outlier.
    ///
    /// `least_soft` widens the likelihood, to give it a slope far away.
    pub(super) fn newton_step(&self, at: f64, least_soft: f64) -> (f64, f64) {
        let [a, b] = self.terms.map(|term| term.likelihood(at, least_soft));
        let mine = (1.0 - OUTLIER_PART) * a.0 * b.0;
        let belongs = mine / (mine + OUTLIER_PART * OUTLIER_LIKELIHOOD);
        // The middle of a wide interval is flat: a small curvature, of a tenth of a metre, keeps the step finite.
        let bend = (a.2 + b.2).max(LEAST_BEND);
        (at + (a.1 + b.1) / bend, belongs * bend)
    }

    /// Returns true when an edge at `at` agrees with both observations within `slack`.
    pub(super) fn agrees(&self, at: f64, slack: f64) -> bool {
        self.terms.iter().all(|term| term.agrees(at, slack))
    }
}

/// Returns the length of (a, b) without the range checks of `hypot`.
fn norm(a: f64, b: f64) -> f64 {
    (a * a + b * b).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn newton_steps_lead_into_the_interval_and_stay_there() {
        let bound = |at: f64| Bound { sure: at, likely: at };
        let terms = [EdgeObservation::Above(bound(-0.003)), EdgeObservation::Below(bound(0.003))]
            .map(|observation| observation.within(3e-4));
        let line = EdgeLikelihood { along: 0.0, terms };
        let (to, weight) = line.newton_step(0.004, 2e-3);
        assert!(to < 0.004 && weight > 0.0);
        let (to, weight) = line.newton_step(0.001, 0.0);
        assert!((to - 0.001).abs() < 1e-6 && weight < 1e5);
        // Half a metre off it has nothing to do with the edge.
        assert!(line.newton_step(0.5, 0.0).1 < 1e-3);
    }
}
