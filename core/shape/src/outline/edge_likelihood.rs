//! Likelihood of an edge position given one lattice line: an interval-censored observation with outliers.
//!
//! The likelihood is the product of independent terms, mixed with a constant for lines that are outliers. A term is a
//! direct observation of the edge or one end of a censored interval; both ends of an interval are smoothed by the
//! pointing noise of the beams (probit).
//!
//! In: the terms of `lattice_line`. Out: [`EdgeLikelihood`]; `edge` adds up its Newton steps and `edge_posterior`
//! samples its values. All distances are positive inwards (into the plate), in metres.

use platen_numerics::normal_distribution::{CERTAIN, cdf, log_cdf};

/// Least curvature of a line's log likelihood in a Newton step, 1/m^2.
const LEAST_BEND: f64 = 1e2;

/// Part of the lines that are outliers, and the likelihood of an edge position given an outlier.
pub(super) const OUTLIER_PART: f64 = 0.05;
const OUTLIER_LIKELIHOOD: f64 = 0.1;

/// Part of the beams that see both sides of an edge and are not detected as mixed.
pub(super) const HIDDEN_PART: f64 = 0.25;

/// Likelihood of an edge position given one lattice line.
#[derive(Debug, Clone, Copy)]
pub(super) struct EdgeLikelihood {
    pub(super) along: f64,
    pub(super) terms: [Term; 2],
    pub(super) shared: Option<SharedObservation>,
}

/// Direct observation of an edge that depends on a parameter shared with other lines: the edge plus `factor` times the
/// parameter is at `place`.
#[derive(Debug, Clone, Copy)]
pub(super) struct SharedObservation {
    pub(super) place: f64,
    /// Standard deviation, metres.
    pub(super) soft: f64,
    /// Radius of the beam, metres.
    pub(super) radius: f64,
    /// Number of the parameter.
    pub(super) number: usize,
    pub(super) factor: f64,
}

impl SharedObservation {
    /// Returns the distance by which an edge at `at` lies inside of the observation, metres.
    pub(super) fn off(&self, at: f64, parameters: &[f64]) -> f64 {
        at + self.factor * parameters[self.number] - self.place
    }

    /// Returns the likelihood of an edge at `at` and the parameters, and the weight of the observation.
    fn likelihood(&self, at: f64, parameters: &[f64], least_soft: f64) -> (f64, f64) {
        let soft = self.soft.max(least_soft);
        let off = self.off(at, parameters) / soft;
        ((-0.5 * off * off).exp(), 1.0 / (soft * soft))
    }
}

/// One Newton step of the log likelihood of a line.
#[derive(Debug, Clone, Copy)]
pub(super) struct NewtonStep {
    /// Position to which the terms lead, and its weight (the curvature).
    pub(super) to: f64,
    pub(super) weight: f64,
    /// Weight of the shared observation.
    pub(super) shared_weight: f64,
}

/// One observation of the edge and its standard deviation, metres.
#[derive(Debug, Clone, Copy)]
pub(super) struct Term {
    observation: EdgeObservation,
    soft: f64,
}

/// One observation of the edge position. Distances inwards, metres.
#[derive(Debug, Clone, Copy)]
pub(super) enum EdgeObservation {
    /// A direct observation.
    At(f64),
    /// Censored from below: the edge is inside of this bound.
    Above(Bound),
    /// Censored from above: the edge is outside of this bound.
    Below(Bound),
    /// The last cell of the face: the edge is outside of the cell, or the cell lies on the side face, by its noisy
    /// range `behind` outside of the edge.
    Last { cell: f64, behind: f64 },
}

/// Censoring bound as a mixture of two: at `likely` if a mixed beam would have been detected, at `sure`, farther out,
/// if not.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bound {
    pub(super) sure: f64,
    pub(super) likely: f64,
}

impl Bound {
    /// Returns the likelihood of an edge from its distances inside of the two bounds, in standard deviations.
    fn value(sure: f64, likely: f64) -> f64 {
        HIDDEN_PART * cdf(sure) + (1.0 - HIDDEN_PART) * cdf(likely)
    }

    /// Returns the same likelihood, the slope of its logarithm and the negative second derivative of a lower bound of
    /// that logarithm (expectation maximisation; a Newton step never meets a negative curvature).
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
    pub(super) fn within(self, soft: f64) -> Term {
        Term { observation: self, soft }
    }
}

impl Term {
    /// Returns the likelihood of an edge at `at`, the slope of its logarithm, per metre, and the negative second
    /// derivative of that.
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
    /// Returns the middle of the interval and its weight by the variance of a uniform distribution: the start of the
    /// search.
    pub(super) fn middle(&self, step: f64) -> (f64, f64) {
        let [first, second] = &self.terms;
        if let EdgeObservation::At(place) = first.observation {
            return (place, 12.0 / (step * step));
        }
        let (above, below) = (first.limit(), second.limit());
        (0.5 * (above + below), 12.0 / (below - above).max(step).powi(2))
    }

    /// Returns the likelihood of an edge at `at` and the shared parameters, up to a constant factor.
    pub(super) fn value(&self, at: f64, parameters: &[f64]) -> f64 {
        let [a, b] = self.terms.map(|term| term.value(at));
        let shared = self.shared.map_or(1.0, |shared| shared.likelihood(at, parameters, 0.0).0);
        (1.0 - OUTLIER_PART) * a * b * shared + OUTLIER_PART * OUTLIER_LIKELIHOOD
    }

    /// Returns one Newton step of the log likelihood from `at` and the shared parameters. The weights vanish where the
    /// line is more likely an outlier.
    ///
    /// `least_soft` widens the likelihood, to give it a slope far from the edge.
    pub(super) fn newton_step(&self, at: f64, parameters: &[f64], least_soft: f64) -> NewtonStep {
        let [a, b] = self.terms.map(|term| term.likelihood(at, least_soft));
        let (shared, shared_weight) =
            self.shared.map_or((1.0, 0.0), |shared| shared.likelihood(at, parameters, least_soft));
        let mine = (1.0 - OUTLIER_PART) * a.0 * b.0 * shared;
        let belongs = mine / (mine + OUTLIER_PART * OUTLIER_LIKELIHOOD);
        // The middle of a wide interval is flat: a small curvature, that of a tenth of a metre, keeps the step finite.
        let bend = (a.2 + b.2).max(LEAST_BEND);
        NewtonStep {
            to: at + (a.1 + b.1) / bend,
            weight: belongs * bend,
            shared_weight: belongs * shared_weight,
        }
    }

    /// Returns true when an edge at `at` agrees with both observations within `slack`.
    pub(super) fn agrees(&self, at: f64, slack: f64) -> bool {
        self.terms.iter().all(|term| term.agrees(at, slack))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn newton_steps_lead_into_the_interval_and_stay_there() {
        let bound = |at: f64| Bound { sure: at, likely: at };
        let terms = [EdgeObservation::Above(bound(-0.003)), EdgeObservation::Below(bound(0.003))]
            .map(|observation| observation.within(3e-4));
        let line = EdgeLikelihood { along: 0.0, terms, shared: None };
        let NewtonStep { to, weight, .. } = line.newton_step(0.004, &[], 2e-3);
        assert!(to < 0.004 && weight > 0.0);
        let NewtonStep { to, weight, .. } = line.newton_step(0.001, &[], 0.0);
        assert!((to - 0.001).abs() < 1e-6 && weight < 1e5);
        // A line half a metre off the edge has no weight.
        assert!(line.newton_step(0.5, &[], 0.0).weight < 1e-3);
    }
}
