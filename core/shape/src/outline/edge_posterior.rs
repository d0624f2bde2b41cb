//! What the lines of an edge say of it together: its expected curve, and how well that is known.

use nalgebra::{Cholesky, DMatrix, Dyn, SMatrix, SVector};

use super::edge_likelihood::{BeamModel, FOOTPRINT_SPREAD, Line, SOFTNESS};
use super::{SEED, Sampling};
use platen_numerics::adaptive_metropolis::mean_and_covariance;
use platen_numerics::penalised_curve::{CurveFit, SplineCurve};

/// Places of the edge that are free where its posterior is not normal: ends and thirds. Between them a stiff curve leaves
/// two tenths of a millimetre open.
const PLACES: usize = 4;

/// Those, the footprint and the softness, the latter as the logarithm of its part of that of a dithered edge, which also
/// holds what the curve of such an edge does not follow. Its mean; the standard deviation is one.
const FREE: usize = PLACES + 2;
const LOG_SOFTNESS: f64 = -1.2;

/// Weight with which the places are held, 1/m^2, while what they leave open is told: as stiff as the prior's own.
const HELD: f64 = 1e8;

/// First steps: of places in parts of the lattice's spacing, of the others in standard deviations.
const FIRST_STEP: f64 = 0.05;
const FIRST_PART: f64 = 0.3;

/// Lines whose likelihoods are multiplied before a logarithm is taken: each is above 10^-3.
const TOGETHER: usize = 64;

/// The expected curve of an edge and its covariance.
#[derive(Debug, Clone)]
pub(super) struct Posterior {
    pub(super) curve: SplineCurve,
    covariance: DMatrix<f64>,
}

impl Posterior {
    /// About the most likely curve, as a normal distribution (Laplace's method): of an edge that crosses many lines
    /// of the lattice.
    pub(super) fn laplace(curve: SplineCurve, precision: &Cholesky<f64, Dyn>) -> Self {
        Self { curve, covariance: precision.inverse() }
    }

    /// Of an edge along a line of the lattice, which lies anywhere between two of them: the product of its brackets is flat
    /// between steep sides, its maximum may be anywhere within and its curvature there tells nothing of its width. And
    /// where mixed pixels begin on it depends on the footprint as much as on the edge. So all that is free is
    /// integrated over, by a Metropolis chain.
    ///
    /// `curve` is a likely one, its ends the places of the edge's corners along it, `footprint` that of all edges,
    /// radians. `None` when the prior leaves the curve open.
    pub(super) fn sampled(
        curve: &SplineCurve,
        prior: &CurveFit,
        lines: &[Line],
        [from, to]: [f64; 2],
        footprint: f64,
        sampling: Sampling,
    ) -> Option<Self> {
        let Sampling { step, noise, .. } = sampling;
        let places: [_; PLACES] =
            std::array::from_fn(|k| curve.functional(from + (to - from) * k as f64 / (PLACES - 1) as f64));
        // The stiffest curves through one of the places and zero at the others, and what they leave open: the prior
        // under the condition that the places are known.
        let mut held = prior.clone();
        for place in &places {
            held.hold(place, HELD);
        }
        let (_, factor) = held.solve()?;
        let across = DMatrix::from_columns(&places.each_ref().map(|place| factor.solve(place)));
        let of_places = SMatrix::<f64, PLACES, PLACES>::from_fn(|i, j| places[i].dot(&across.column(j)));
        let through = &across * of_places.try_inverse()?;
        let between = factor.inverse() - &through * across.transpose();
        let parts: [SplineCurve; PLACES] =
            std::array::from_fn(|k| curve.with(through.column(k).into_owned()));
        let at_lines: Vec<(&Line, f64, SVector<f64, PLACES>)> = lines
            .iter()
            .map(|l| (l, curve.at(l.along), SVector::from_fn(|k, _| parts[k].at(l.along))))
            .collect();
        let logarithm = |free: &SVector<f64, FREE>| {
            let by: SVector<f64, PLACES> = free.fixed_rows::<PLACES>(0).into_owned();
            let beam = BeamModel {
                footprint: footprint * (1.0 + FOOTPRINT_SPREAD * free[PLACES]).max(0.0),
                softness: SOFTNESS * (LOG_SOFTNESS + free[PLACES + 1]).exp(),
            };
            let likelihood = |(line, at, parts): &(&Line, f64, SVector<f64, PLACES>)| {
                line.bracket(beam, noise).likelihood(at + parts.dot(&by))
            };
            let together = |lines: &[_]| lines.iter().map(likelihood).product::<f64>().ln();
            let bent = curve.moved(&(&through * by));
            at_lines.chunks(TOGETHER).map(together).sum::<f64>()
                - prior.roughness(&bent)
                - 0.5 * (free[PLACES].powi(2) + free[PLACES + 1].powi(2))
        };
        let first = SVector::from_fn(|k, _| if k < PLACES { FIRST_STEP * step } else { FIRST_PART });
        let (mean, covariance) = mean_and_covariance(first, SEED ^ FREE as u64, logarithm);
        let (mean, covariance) =
            (mean.fixed_rows::<PLACES>(0), covariance.fixed_view::<PLACES, PLACES>(0, 0));
        let covariance = between + &through * covariance * through.transpose();
        Some(Self { curve: curve.moved(&(&through * mean)), covariance })
    }

    /// Variance across the edge at a place along it.
    pub(super) fn variance(&self, along: f64) -> f64 {
        let functional = self.curve.functional(along);
        functional.dot(&(&self.covariance * &functional))
    }
}
