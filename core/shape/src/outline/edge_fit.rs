//! Most likely curve of an edge, with the footprint and the contrasts estimated in turn with it, by Newton's method.
//!
//! In: the lattice lines of an edge and the prior of its curve. Out: [`EdgeFit`], with the covariance at the maximum and
//! the weight of each line in the curve.

use nalgebra::{Cholesky, DMatrix, Dyn};
use platen_numerics::penalised_curve::{CurveFit, SplineCurve};

use super::beam_shape::BeamShape;
use super::contrast::{self, ContrastDistribution, Contrasts};
use super::edge_likelihood::{EdgeLikelihood, NewtonStep};
use super::footprint;
use super::lattice_line::{BeamModel, LatticeLine};

/// Number of Newton steps with widened likelihoods, largest number of further steps, and the movement that ends them,
/// metres.
const WIDENED_STEPS: i32 = 8;
const STEPS: i32 = 32;
const STILL: f64 = 1e-7;

/// Rounds of fitting the curve and estimating the beams' footprint and contrasts in turn.
const ROUNDS: usize = 3;

/// The most likely curve of an edge with the footprint and contrasts that were estimated together with it.
pub(super) struct EdgeFit {
    pub(super) lines: Vec<EdgeLikelihood>,
    pub(super) found: MostLikely,
    /// Covariance of the curve's coefficients followed by the contrasts.
    pub(super) covariance: DMatrix<f64>,
    pub(super) contrasts: ContrastDistribution,
    pub(super) beam: BeamModel,
    /// Logarithm of the likelihood of the footprint where it was estimated at this edge, otherwise 0.
    pub(super) log_likelihood: f64,
}

impl EdgeFit {
    /// Fits the edge to its lattice lines, with the prior of its curve. `footprint` is half the angle that a beam sees,
    /// radians, and `shape` that of the beam; with `own` the footprint is the start value of an estimate at this edge.
    /// `known` is the prior of the contrasts, `step` the spacing of the samples. `None` when the lines do not determine
    /// the curve.
    pub(super) fn new(
        (prior, lattice_lines): (&CurveFit, &[LatticeLine]),
        (footprint, shape): (f64, BeamShape),
        own: bool,
        known: &ContrastDistribution,
        step: f64,
    ) -> Option<Self> {
        let prior = prior.clone().with_parameters(known.planes());
        let fit = |beam: BeamModel| {
            let lines: Vec<EdgeLikelihood> = lattice_lines.iter().map(|l| l.likelihood(beam)).collect();
            let found = most_likely(&prior, &lines, step)?;
            Some((lines, found))
        };
        let mut beam = BeamModel::of(footprint, shape, known.mean());
        let mut log_likelihood = 0.0;
        let (mut lines, mut found) = fit(beam)?;
        for _ in 0..ROUNDS {
            let last = beam;
            beam.contrasts = found.contrasts;
            beam.mixed_spread = contrast::spread(mixed_offsets(&lines, &found));
            if own && footprint > 0.0 {
                let at = |along| found.curve.at(along);
                (beam.footprint, log_likelihood) = footprint::at_edge(lattice_lines, at, footprint, beam);
            }
            // The same beams would give the same curve again: converged.
            if beam.is_near(&last) {
                break;
            }
            (lines, found) = fit(beam)?;
        }
        let covariance = found.precision.inverse();
        let n = found.curve.n_coefficients();
        let contrasts =
            ContrastDistribution::of(&found.contrasts, |plane| covariance[(n + plane, n + plane)].sqrt());
        Some(Self { lines, found, covariance, contrasts, beam, log_likelihood })
    }

    /// Returns the absolute distances of the edge positions by the single mixed pixels from the curve, in radii of the
    /// beam.
    pub(super) fn mixed_offsets(&self) -> Vec<f64> {
        mixed_offsets(&self.lines, &self.found)
    }

    /// Returns, for each line, the derivatives of the curve at `places` along it by the position of the edge in the line.
    pub(super) fn influences<const N: usize>(&self, places: [f64; N]) -> Vec<[f64; N]> {
        let MostLikely { curve, contrasts, .. } = &self.found;
        let n = curve.n_coefficients();
        let responses = places.map(|along| {
            let column = self.covariance.columns(0, n) * curve.functional(along);
            (curve.with(column.rows(0, n).into_owned()), column)
        });
        let influence = |line: &EdgeLikelihood| {
            let step = line.newton_step(curve.at(line.along), contrasts.logarithms(), 0.0);
            responses.each_ref().map(|(response, column)| {
                let here = response.at(line.along);
                let by_contrast = line.shared.map_or(0.0, |shared| shared.factor * column[n + shared.number]);
                step.weight * here + step.shared_weight * (here + by_contrast)
            })
        };
        self.lines.iter().map(influence).collect()
    }
}

/// The curve of largest likelihood.
pub(super) struct MostLikely {
    pub(super) curve: SplineCurve,
    /// Logarithms of the contrasts of the background's planes.
    contrasts: Contrasts,
    /// Cholesky factor of the precision of the curve's coefficients followed by the contrasts.
    precision: Cholesky<f64, Dyn>,
}

/// Maximises the likelihood by Newton's method, starting from the middles of the intervals.
///
/// The first steps use likelihoods that are widened less and less (continuation); a widened likelihood has a slope far
/// from the edge. The search never starts from the curve found with another footprint: with 2 mm of noise that curve
/// may lie at a lesser maximum, 1 mm off, and the footprint estimated there would keep it.
fn most_likely(prior: &CurveFit, lines: &[EdgeLikelihood], step: f64) -> Option<MostLikely> {
    let mut normal = prior.clone();
    for line in lines {
        let (to, weight) = line.middle(step);
        normal.add(line.along, to, weight);
    }
    let mut found = solve(normal)?;
    for widened in 0..WIDENED_STEPS {
        found = newton_step(prior, lines, &found, 2.0 * step * 0.5_f64.powi(widened))?;
    }
    for _ in 0..STEPS {
        let next = newton_step(prior, lines, &found, 0.0)?;
        let moved = next.curve.distance(&found.curve);
        found = next;
        if moved < STILL {
            break;
        }
    }
    Some(found)
}

/// Returns the absolute distances of the edge positions by the single mixed pixels from the curve, in radii of the
/// beam.
fn mixed_offsets(lines: &[EdgeLikelihood], found: &MostLikely) -> Vec<f64> {
    let size = |line: &EdgeLikelihood| {
        let shared = line.shared?;
        let off = shared.off(found.curve.at(line.along), found.contrasts.logarithms());
        Some((off / shared.radius).abs())
    };
    lines.iter().filter_map(size).collect()
}

/// Performs one Newton step of the curve and the contrasts.
fn newton_step(
    prior: &CurveFit,
    lines: &[EdgeLikelihood],
    from: &MostLikely,
    least_soft: f64,
) -> Option<MostLikely> {
    let mut normal = prior.clone();
    for line in lines {
        let at = from.curve.at(line.along);
        let NewtonStep { to, weight, shared_weight } =
            line.newton_step(at, from.contrasts.logarithms(), least_soft);
        normal.add(line.along, to, weight);
        if let Some(shared) = line.shared {
            normal.add_with(line.along, shared.place, shared_weight, (shared.number, shared.factor));
        }
    }
    solve(normal)
}

fn solve(normal: CurveFit) -> Option<MostLikely> {
    let (curve, contrasts, precision) = normal.solve_with_parameters()?;
    Some(MostLikely { curve, contrasts: Contrasts::of(contrasts.as_slice()), precision })
}
