//! Posterior of an edge curve, mean and covariance, by Laplace's method or adaptive Metropolis.
//!
//! - Laplace's method (the normal distribution at the maximum) serves where the edge is dithered, that is, crosses many
//!   lines of the lattice.
//! - Along a lattice line the likelihood is flat between steep sides, and Laplace's method fails. There the posterior
//!   is integrated by adaptive Metropolis over the curve at four places, the footprint, the softness of the intervals'
//!   ends and the contrast.
//!
//! In: the curve of `edge`, its prior and its lattice lines. Out: [`Posterior`], variances in m^2.

use nalgebra::{DMatrix, SMatrix, SVector};
use platen_numerics::adaptive_metropolis::mean_and_covariance;
use platen_numerics::penalised_curve::{CurveFit, SplineCurve};

use super::SEED;
use super::contrast::ContrastDistribution;
use super::lattice_line::{BeamModel, FOOTPRINT_SPREAD, LatticeLine, SOFTNESS};

/// Number of places along the edge at which its position is sampled: ends and thirds. Between them the prior leaves two
/// tenths of a millimetre undetermined.
const PLACES: usize = 4;

/// Number of dimensions sampled: the positions at those places, then three parameters, each as its distance from the
/// prior mean in standard deviations:
///
/// 1. the footprint;
/// 2. the logarithm of the softness relative to that of a dithered edge (which includes the deviations that the curve
///    of such an edge does not follow), with the prior mean `LOG_SOFTNESS` and a standard deviation of one;
/// 3. the logarithm of the contrasts, with the same deviation for all planes.
const FREE: usize = PLACES + 3;
const LOG_SOFTNESS: f64 = -1.2;

/// Weight with which the curve is held at the places, 1/m^2, to find the prior given its positions there: as stiff as
/// the prior's own.
const HELD: f64 = 1e8;

/// First steps of the sampler: of the positions in parts of the lattice's spacing, of the other parameters in standard
/// deviations.
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
    /// Approximates the posterior of a dithered edge by the normal distribution at its maximum (Laplace's method).
    /// `covariance` is that of the curve's coefficients followed by the contrasts.
    pub(super) fn laplace(curve: SplineCurve, covariance: &DMatrix<f64>) -> Self {
        let n = curve.n_coefficients();
        Self { curve, covariance: covariance.view((0, 0), (n, n)).into_owned() }
    }

    /// Samples the posterior of an edge along a lattice line by adaptive Metropolis.
    ///
    /// Such an edge may lie anywhere between two lattice lines. Its likelihood is flat between steep sides: the
    /// position of the maximum and the curvature there do not give the width. The place where mixed pixels begin
    /// depends on the footprint as much as on the edge.
    ///
    /// `curve` is a likely curve, `from` and `to` are the places of the corners along it, `beam` the properties of the
    /// beams, `known` the prior of the contrasts from the other edges, `step` the spacing of the samples. `None` when
    /// the prior leaves the curve undetermined.
    pub(super) fn sampled(
        curve: &SplineCurve,
        prior: &CurveFit,
        lines: &[LatticeLine],
        [from, to]: [f64; 2],
        beam: BeamModel,
        known: &ContrastDistribution,
        step: f64,
    ) -> Option<Self> {
        let places: [_; PLACES] =
            std::array::from_fn(|k| curve.functional(from + (to - from) * k as f64 / (PLACES - 1) as f64));
        // The prior given the positions at the places: its mean as a linear map of these, and its covariance.
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
        let at_lines: Vec<(&LatticeLine, f64, SVector<f64, PLACES>)> = lines
            .iter()
            .map(|l| (l, curve.at(l.along), SVector::from_fn(|k, _| parts[k].at(l.along))))
            .collect();
        let logarithm = |free: &SVector<f64, FREE>| {
            let by: SVector<f64, PLACES> = free.fixed_rows::<PLACES>(0).into_owned();
            let contrasts = known.off(free[PLACES + 2]);
            let beam = BeamModel {
                footprint: beam.footprint * (1.0 + FOOTPRINT_SPREAD * free[PLACES]).max(0.0),
                softness: SOFTNESS * (LOG_SOFTNESS + free[PLACES + 1]).exp(),
                contrasts,
                ..beam
            };
            let likelihood = |(line, at, parts): &(&LatticeLine, f64, SVector<f64, PLACES>)| {
                line.likelihood(beam).value(at + parts.dot(&by), contrasts.logarithms())
            };
            let together = |lines: &[_]| lines.iter().map(likelihood).product::<f64>().ln();
            let bent = curve.moved(&(&through * by));
            at_lines.chunks(TOGETHER).map(together).sum::<f64>()
                - prior.roughness(&bent)
                - 0.5 * free.fixed_rows::<{ FREE - PLACES }>(PLACES).norm_squared()
        };
        let first = SVector::from_fn(|k, _| if k < PLACES { FIRST_STEP * step } else { FIRST_PART });
        let (mean, covariance) = mean_and_covariance(first, SEED ^ FREE as u64, logarithm);
        let (mean, covariance) =
            (mean.fixed_rows::<PLACES>(0), covariance.fixed_view::<PLACES, PLACES>(0, 0));
        let covariance = between + &through * covariance * through.transpose();
        Some(Self { curve: curve.moved(&(&through * mean)), covariance })
    }

    /// Returns the variance across the edge at a place along it.
    pub(super) fn variance(&self, along: f64) -> f64 {
        let functional = self.curve.functional(along);
        functional.dot(&(&self.covariance * &functional))
    }
}
