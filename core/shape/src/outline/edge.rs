//! One edge as the penalised spline of largest likelihood in its developed strip, by Newton's method.
//!
//! In: projected crossings of one edge; out: the edge curve and its posterior. The likelihood of the curve is the product of
//! the interval-censored likelihoods of its lattice lines (`edge_likelihood`), the prior a curvature like white noise. It is
//! unbiased where the middle between two samples is not: along a lattice row all lines have the same interval but for the
//! few cells where the edge changes rows, and those few locate it. Where it changes none, the posterior is sampled
//! (`edge_posterior`). The beam's footprint is estimated from the mixed pixels and the edge in turn. Mixed pixels have a radiometric
//! bias, which `contrast` finds: it is taken off, and its spread is stated.

use nalgebra::{Cholesky, Dyn, Vector2};
use platen_numerics::penalised_curve::{CurveFit, Roughness, SplineCurve};
use platen_numerics::uniform_knots::UniformKnots;

use super::contrast::Contrast;
use super::coverage::Coverage;
use super::developed_strip::DevelopedStrip;
use super::edge_likelihood::EdgeLikelihood;
use super::edge_posterior::Posterior;
use super::footprint;
use super::height_field::LEAST_COSINE;
use super::lattice_line::{self, BeamModel, LatticeLine};
use super::projected_crossing::ProjectedCrossing;
use super::side_face::SideFace;
use super::{OutlineError, Sampling, of_each};
use crate::Vec3;

/// Span of the curve, metres.
const SPAN: f64 = 0.25;

/// Prior: a cut edge, developed, is straight but for the membrane strain of the plate and the bow and waviness of the cut:
/// curvature, 1/m, over a length, metres. Over 3 m that is a bow of 1 mm and, at twice its deviation, that of a sphere of R 11 m.
const CURVATURE: (f64, f64) = (0.003, 0.3);

/// Standard deviation of errors that all lines of an edge share, metres: squareness of the cut, shape of the footprint. On
/// plates of an independent simulator edges are 0.1 to 0.3 mm farther off than the scatter of their lines explains.
const COMMON: f64 = 1e-4;

/// Newton steps with widened likelihoods, then further ones at most, and the movement that ends them, metres.
const WIDENED_ROUNDS: i32 = 8;
const ROUNDS: i32 = 32;
const STILL: f64 = 1e-7;

/// Columns and rows of the lattice that an edge must cross to be dithered, that is, to lie at random between them.
const DITHERED: u32 = 6;

/// Rounds of fitting the curve and estimating its footprint in turn.
const FOOTPRINT_ROUNDS: usize = 3;

/// The crossings of an edge in its strip.
#[derive(Debug, Clone)]
pub(super) struct EdgeData {
    strip: DevelopedStrip,
    side_face: SideFace,
    lines: Vec<LatticeLine>,
    dithered: bool,
    from: Vec3,
    to: Vec3,
}

impl EdgeData {
    /// Develops the crossings along the edge from `from` to `to`.
    ///
    /// # Errors
    /// [`OutlineError::Edge`] when too little of it is seen.
    pub(super) fn new(
        crossings: &[ProjectedCrossing],
        [from, to]: [Vec3; 2],
        thickness: f64,
        side_face: SideFace,
        sampling: Sampling,
    ) -> Result<Self, OutlineError> {
        let strip = DevelopedStrip::new(crossings, [from, to], 0.5 * thickness, sampling)?;
        let line = |crossing| LatticeLine::new(&strip, crossing, &side_face, sampling);
        let lines: Vec<LatticeLine> = crossings.iter().map(line).collect();
        let dithered = is_dithered(&lines, |along| strip.base(along), sampling.step);
        Ok(Self { strip, side_face, lines, dithered, from, to })
    }
}

/// Fits the four edges. Half the angle that a beam sees is first counted from the mixed pixels, then estimated at each edge that shows
/// it, and their mean taken for those that do not. It is the scanner's, not the edge's: cells of a narrow background that pass for mixed pixels
/// make one edge show far more than the others, and that edge takes theirs.
///
/// # Errors
/// [`OutlineError::Edge`] when too little of one is seen.
pub(super) fn fit_all(edges: [EdgeData; 4], sampling: Sampling) -> Result<[Edge; 4], OutlineError> {
    // Along an edge that is not dithered all beams may be mixed or none: it counts only where no other edge is.
    let any = edges.iter().any(|edge| edge.dithered);
    let counting: Vec<&[LatticeLine]> =
        edges.iter().filter(|edge| edge.dithered || !any).map(|edge| edge.lines.as_slice()).collect();
    let counted = footprint::counted(&counting, sampling.angle);
    let telling = edges.each_ref().map(|edge| edge.dithered && footprint::is_shown(&edge.lines));
    let fit = |k: usize, footprint, own| Edge::fit(edges[k].clone(), footprint, own, sampling);
    let [a, b, c, d] = of_each(|k| telling[k].then(|| fit(k, counted, true)).transpose());
    let mut fitted = [a?, b?, c?, d?];
    let most = footprint::most_of_an_edge(fitted.iter().flatten().map(|edge| edge.footprint));
    for edge in &mut fitted {
        edge.take_if(|edge| edge.footprint > most);
    }
    let found: Vec<f64> = fitted.iter().flatten().map(|edge| edge.footprint).collect();
    let common = if found.is_empty() { counted } else { found.iter().sum::<f64>() / found.len() as f64 };
    let [a, b, c, d] = of_each(|k| fitted[k].clone().map_or_else(|| fit(k, common, !telling[k]), Ok));
    Ok([a?, b?, c?, d?])
}

/// Returns true when the edge, about at `base`, crosses so many columns and rows of the lattice that its place between them
/// is practically random.
fn is_dithered(lines: &[LatticeLine], base: impl Fn(f64) -> f64, step: f64) -> bool {
    let on_it = lines.iter().filter(|l| l.is_near(base(l.along), step));
    let (low, high) = on_it.fold(([u32::MAX; 2], [0; 2]), |(low, high), l| {
        ([0, 1].map(|k| low[k].min(l.place[k])), [0, 1].map(|k| high[k].max(l.place[k])))
    });
    [0, 1].into_iter().all(|k| high[k].saturating_sub(low[k]) >= DITHERED)
}

/// An edge as a curve in its strip.
#[derive(Debug, Clone)]
pub(super) struct Edge {
    strip: DevelopedStrip,
    side_face: SideFace,
    posterior: Posterior,
    /// Half the angle that a beam sees, radians.
    footprint: f64,
    contrast: Contrast,
    /// Coverage by the crossings that agree with it.
    pub(super) seen: Coverage,
    pub(super) from: f64,
    pub(super) to: f64,
}

impl Edge {
    /// Fits the edge to its crossings. `footprint` is half the angle that a beam sees, radians; with `own` that of this edge is estimated from it.
    ///
    /// # Errors
    /// [`OutlineError::Edge`] when too little of it is seen.
    pub(super) fn fit(
        data: EdgeData,
        footprint: f64,
        own: bool,
        sampling: Sampling,
    ) -> Result<Self, OutlineError> {
        let Sampling { step, noise, .. } = sampling;
        let EdgeData { strip, side_face, lines, dithered, from, to } = data;
        let (start, end) = strip.span();
        let axis = UniformKnots::new(start, end, ((end - start) / SPAN).ceil() as usize);
        let prior = CurveFit::with_prior(axis, Roughness::Curvature, CURVATURE.0, CURVATURE.1);
        let too_few = || strip.too_few();
        let fit = |beam: BeamModel| {
            let used: Vec<EdgeLikelihood> = lines.iter().map(|l| l.likelihood(beam, noise)).collect();
            let (curve, precision) = most_likely(&prior, &used, step)?;
            Some((used, curve, precision))
        };
        let mut beam = BeamModel::of(footprint);
        let (mut used, mut curve, mut precision) = fit(beam).ok_or_else(too_few)?;
        for _ in 0..FOOTPRINT_ROUNDS {
            let last = beam.footprint;
            if own && footprint > 0.0 {
                beam.footprint = footprint::at_edge(&lines, |along| curve.at(along), footprint);
            }
            // The same footprint gives the same curve, and that one the same footprint.
            if beam.footprint == last {
                break;
            }
            (used, curve, precision) = fit(beam).ok_or_else(too_few)?;
        }
        let (from, to) = (strip.flatten(from).x, strip.flatten(to).x);
        let posterior = if dithered {
            Posterior::laplace(curve, &precision)
        } else {
            Posterior::sampled(&curve, &prior, &lines, [from, to], footprint, sampling).ok_or_else(too_few)?
        };
        let agreeing = used.iter().filter(|b| b.agrees(posterior.curve.at(b.along), step));
        let seen = Coverage::new(agreeing.map(|b| b.along), step);
        let contrast = Contrast::of(&lines, dithered, noise);
        Ok(Self { strip, side_face, posterior, footprint: beam.footprint, contrast, seen, from, to })
    }

    /// Returns the point of the edge at a distance along it.
    pub(super) fn point(&self, along: f64) -> Vec3 {
        let at = self.posterior.curve.at(along);
        let [inwards, _] = self.bias(along, self.strip.lift(Vector2::new(along, at)));
        self.strip.lift(Vector2::new(along, at - inwards))
    }

    /// Returns the place along the edge nearest to a point.
    pub(super) fn along(&self, point: Vec3) -> f64 {
        self.strip.flatten(point).x
    }

    /// Returns the length of the edge's parallel at a depth below the face, metres.
    pub(super) fn length_below(&self, depth: f64) -> f64 {
        const PARTS: usize = 256;
        let at = |i: usize| {
            let along = self.from + (self.to - self.from) * i as f64 / PARTS as f64;
            self.point(along) - self.strip.normal(along) * depth
        };
        (0..PARTS).map(|i| (at(i + 1) - at(i)).norm()).sum()
    }

    /// Returns the standard deviation across the edge, metres.
    pub(super) fn sigma(&self, along: f64) -> f64 {
        self.posterior.variance(along).sqrt().hypot(COMMON).hypot(self.contrast_sigma(along))
    }

    /// Returns the part of it that the contrast has, in which all edges of a plate are off to the same side, metres.
    pub(super) fn contrast_sigma(&self, along: f64) -> f64 {
        let [_, sigma] = self.bias(along, self.point(along));
        sigma
    }

    /// Returns by how much the contrast places the edge too far inwards at one of its points, and the standard deviation, metres.
    fn bias(&self, along: f64, point: Vec3) -> [f64; 2] {
        let (normal, inward) = (self.strip.normal(along), self.strip.inward(along));
        if self.side_face.is_seen(point, normal, inward) {
            return [0.0; 2];
        }
        let seen = self.footprint * lattice_line::inwards_per_radian(point, normal, inward);
        let cosine = normal.dot(&-point.normalize()).max(LEAST_COSINE);
        self.contrast.inwards(cosine).map(|share| share * seen)
    }
}

/// Maximises the likelihood by Newton's method from the middles of the intervals: first one step for each of ever less widened
/// likelihoods (continuation), which have a slope far from the edge. It never starts from the curve of another footprint:
/// with 2 mm of noise that one may lie at a lesser maximum, 1 mm off, and the footprint estimated there would keep it.
fn most_likely(
    prior: &CurveFit,
    lines: &[EdgeLikelihood],
    step: f64,
) -> Option<(SplineCurve, Cholesky<f64, Dyn>)> {
    let mut normal = prior.clone();
    for line in lines {
        let (to, weight) = line.middle(step);
        normal.add(line.along, to, weight);
    }
    let (mut curve, _) = normal.solve()?;
    for round in 0..WIDENED_ROUNDS {
        (curve, _) = newton_step(prior, lines, &curve, 2.0 * step * 0.5_f64.powi(round))?;
    }
    let mut rounds = 0;
    loop {
        let (next, precision) = newton_step(prior, lines, &curve, 0.0)?;
        rounds += 1;
        if next.distance(&curve) < STILL || rounds == ROUNDS {
            return Some((next, precision));
        }
        curve = next;
    }
}

/// One Newton step of a curve.
fn newton_step(
    prior: &CurveFit,
    lines: &[EdgeLikelihood],
    curve: &SplineCurve,
    least_soft: f64,
) -> Option<(SplineCurve, Cholesky<f64, Dyn>)> {
    let mut normal = prior.clone();
    for line in lines {
        let (to, weight) = line.newton_step(curve.at(line.along), least_soft);
        normal.add(line.along, to, weight);
    }
    normal.solve()
}
