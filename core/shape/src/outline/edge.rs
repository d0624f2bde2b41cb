//! Edge curve of maximum penalised likelihood in its developed strip, and its standard deviation.
//!
//! In: the projected crossings of one edge. Out: the edge as a spline curve, and its posterior.
//!
//! - The likelihood of the curve is the product of the interval-censored likelihoods of its lattice lines
//!   (`edge_likelihood`). The prior is Gaussian: the curvature that the membrane strain of the plate gives its edges, the
//!   camber of the cut, and white noise.
//! - The estimate is unbiased; the middle between two samples is not. Along a lattice row all lines have the same
//!   interval except at the few cells where the edge changes rows, and these cells locate it. Where the edge changes no
//!   row or column the posterior is sampled (`edge_posterior`).
//! - An edge is dithered when it crosses so many columns and rows that its position between them is practically random.
//! - The footprint of the beam and the curve are estimated in turn (`edge_fit`), the footprint from the mixed pixels
//!   (`footprint`).
//! - The error of the height field moves every crossing along its beam, neighbouring ones together. Its part of the
//!   standard deviation follows from the law of propagation of uncertainty (JCGM 100:2008, 5.2.2).
//! - The contrast of each plane of the background is estimated together with the edge, then once more with the results
//!   of the other edges as its prior (`contrast`).

use nalgebra::Vector2;
use platen_numerics::median::robust_deviation;
use platen_numerics::penalised_curve::{CurveFit, Roughness, SplineCurve};
use platen_numerics::uniform_knots::UniformKnots;

use super::background_strip;
use super::beam_shape::BeamShape;
use super::contrast::ContrastDistribution;
use super::coverage::Coverage;
use super::developed_strip::DevelopedStrip;
use super::edge_fit::EdgeFit;
use super::edge_posterior::Posterior;
use super::footprint;
use super::height_field::{HeightField, LEAST_COSINE};
use super::lattice_line::{self, BeamModel, LatticeLine};
use super::projected_crossing::ProjectedCrossing;
use super::side_face::SideFace;
use super::{OutlineError, Sampling, of_each};
use crate::Vec3;
use crate::extract::DITHERED;

/// Span of the curve, metres.
const SPAN: f64 = 0.25;

/// Prior of the curve: standard deviation of the curvature of white noise, 1/m, over a length, metres. A cut edge,
/// developed, is straight except for the membrane strain of the plate ([`strain_profile`]), the camber of the cut
/// ([`CAMBER`]), and its waviness: 0.4 mm over 3 m.
const WAVINESS: (f64, f64) = (0.001, 0.3);

/// Standard deviation of the curvature that an edge has from end to end, 1/m: 1 mm over 3 m. Heat shrinks a cut edge
/// the same all along, which bends the plate in its own plane.
const CAMBER: f64 = 8.0 * 1e-3 / (3.0 * 3.0);

/// Standard deviation of the curvature by membrane strain along an edge, in parts of its mean over all edges. Along the
/// long edges of a plate twice as long as wide this curvature is larger by a fifth, along the short ones smaller by a
/// fifth; the rest is for corners that pressing took out of square.
const STRAIN_SPREAD: f64 = 0.5;

/// Standard deviation of errors that all lines of an edge share, metres: squareness of the cut, shape of the footprint.
/// Of the corners of 500 random scenes, whose edges are cut square, 97 % are inside of their stated 95 % intervals, of
/// those of an independent simulator 93 %.
const COMMON: f64 = 6e-5;

/// Standard deviation of the bias that the contrast leaves, the same for all edges of a plate, in parts of the
/// footprint (half angle).
///
/// `CONTRAST_SPREAD` holds where mixed pixels determine the contrast, or ranges on a visible side face the edge. With
/// 0.01 the stated intervals of corners and edges of 200 random scenes hold in 97.7 %.
/// Elsewhere `UNKNOWN_SPREAD` is multiplied by the logarithm of one over the cosine of the incidence: the more
/// obliquely a face is seen, the darker it is.
const CONTRAST_SPREAD: f64 = 0.01;
const UNKNOWN_SPREAD: f64 = 0.1;

/// Number of places along an edge at which the standard deviation of the height field is computed.
const HEIGHTS: usize = 5;

/// Least number of mixed pixels that determine the contrast.
const LEAST_PIXELS: usize = 20;

/// Largest scatter of the positions of the edges by their mixed pixels before a smooth beam, in radii of the beam. Of
/// 120 random scenes with smooth beams 117 have 0.023 to 0.053, of 24 with a beam of 13 rays all have 0.058 to 0.122.
const SMOOTH_SCATTER: f64 = 0.055;

/// The crossings of an edge in its strip.
#[derive(Debug, Clone)]
pub(super) struct EdgeData {
    strip: DevelopedStrip,
    side_face: SideFace,
    crossings: Vec<ProjectedCrossing>,
    /// Curve of maximum penalised likelihood through the middles of the intervals: its direction is that of the edge.
    course: SplineCurve,
    lines: Vec<LatticeLine>,
    dithered: bool,
    prior: CurveFit,
    /// Places of the corners along the edge.
    from: f64,
    to: f64,
}

impl EdgeData {
    /// Develops the crossings along the edge from `from` to `to`.
    ///
    /// # Errors
    /// [`OutlineError::Edge`] when too little of it is seen.
    pub(super) fn new(
        crossings: Vec<ProjectedCrossing>,
        [from, to]: [Vec3; 2],
        thickness: f64,
        side_face: SideFace,
        mean_curvature: f64,
        sampling: Sampling,
    ) -> Result<Self, OutlineError> {
        let strip = DevelopedStrip::new(&crossings, [from, to], 0.5 * thickness, sampling)?;
        let [from, to] = [from, to].map(|corner| strip.flatten(corner).x);
        let prior = prior(strip.span(), [from, to], mean_curvature);
        let course = course(&strip, &crossings, &prior, sampling.step).ok_or_else(|| strip.too_few())?;
        let line =
            |crossing| LatticeLine::new(&strip, |at| slope(&course, at), crossing, &side_face, sampling);
        let lines: Vec<LatticeLine> = crossings.iter().map(line).collect();
        let dithered = is_dithered(&lines, |along| strip.base(along), sampling.step);
        Ok(Self { strip, side_face, crossings, course, lines, dithered, prior, from, to })
    }

    /// Fits the edge ([`EdgeFit::new`]).
    ///
    /// # Errors
    /// [`OutlineError::Edge`] when too little of it is seen.
    fn fit(
        &self,
        beam: (f64, BeamShape),
        own: bool,
        known: &ContrastDistribution,
        step: f64,
    ) -> Result<EdgeFit, OutlineError> {
        EdgeFit::new((&self.prior, &self.lines), beam, own, known, step).ok_or_else(|| self.strip.too_few())
    }

    /// Replaces lines, given by their numbers, by those beside a strip of background narrower than a beam.
    fn take_for_strip(&mut self, lines: impl IntoIterator<Item = usize>, sampling: Sampling) {
        for at in lines {
            let crossing = self.crossings[at].beside_strip();
            let slope = |at| slope(&self.course, at);
            self.lines[at] = LatticeLine::new(&self.strip, slope, &crossing, &self.side_face, sampling);
        }
    }
}

/// Returns the standard deviations across the edge that are due to the height field, at equal steps from corner to
/// corner. Its error moves each crossing along the beam, and neighbouring crossings together.
fn height_sigma(data: &EdgeData, fit: &EdgeFit, height_field: &HeightField) -> [f64; HEIGHTS] {
    let EdgeData { strip, course, crossings, from, to, .. } = data;
    let places = std::array::from_fn(|k| from + (to - from) * k as f64 / (HEIGHTS - 1) as f64);
    let lines = crossings.iter().zip(&fit.lines).zip(fit.influences(places));
    let terms = lines.map(|((ProjectedCrossing { crossing, .. }, line), influences)| {
        let point = 0.5 * (crossing.inside + crossing.outside);
        let inwards = strip.inward(line.along, slope(course, line.along)).dot(&point.normalize());
        (point, influences.map(|influence| influence * inwards))
    });
    height_field.range_sigmas(terms)
}

/// Returns the prior of an edge curve over a span, with the corners at `corners` along it. `mean_curvature` is that of
/// all edges of the plate by its membrane strain, 1/m, positive inwards.
fn prior((start, end): (f64, f64), corners: [f64; 2], mean_curvature: f64) -> CurveFit {
    let axis = UniformKnots::new(start, end, ((end - start) / SPAN).ceil() as usize);
    let amplitude = [mean_curvature, STRAIN_SPREAD * mean_curvature];
    CurveFit::with_prior(axis, Roughness::Curvature, WAVINESS.0, WAVINESS.1)
        .with_curvature(|at| strain_profile(at, corners), amplitude)
        .with_curvature(|_| 1.0, [0.0, CAMBER])
}

/// Fits a curve to the middles of the intervals near the strip's base curve.
fn course(
    strip: &DevelopedStrip,
    crossings: &[ProjectedCrossing],
    prior: &CurveFit,
    step: f64,
) -> Option<SplineCurve> {
    let mut fit = prior.clone();
    for ProjectedCrossing { crossing, .. } in crossings {
        let [inside, outside] = [crossing.inside, crossing.outside].map(|p| strip.flatten(p));
        let (middle, width) = (0.5 * (inside + outside), (inside.y - outside.y).abs().max(step));
        if (middle.y - strip.base(middle.x)).abs() < width {
            fit.add(middle.x, middle.y, 12.0 / (width * width));
        }
    }
    fit.solve().map(|(course, _)| course)
}

/// Returns the slope of a curve over half a span of its knots.
fn slope(curve: &SplineCurve, along: f64) -> f64 {
    (curve.at(along + 0.25 * SPAN) - curve.at(along - 0.25 * SPAN)) / (0.5 * SPAN)
}

/// Fits the four edges: first those at which the footprint can be estimated, then all of them.
///
/// - The footprint is counted from the mixed pixels, then estimated at each edge that has enough suitable lines. The
///   mean of these estimates is the start value of the second fit.
/// - The shape of the beam, the same at all edges, is that of the largest likelihood of these first fits, or that of a
///   few rays where the mixed pixels scatter as those of such a beam.
/// - The footprint is a property of the scanner, not of the edge. An edge with a far larger one than the others has a
///   strip of background beside it, whose far edge also mixes the beams. Such an edge is fitted with the footprint of
///   the others, and only with the mixed pixels that certainly see the plate. So is a part of an edge with mixed pixels
///   outside of its footprint. An edge with a far smaller one is also fitted with that of the others.
/// - In the second fit, the contrasts found at the other edges are the prior of those of an edge.
///
/// # Errors
/// [`OutlineError::Edge`] when too little of one is seen.
pub(super) fn fit_all(
    mut edges: [EdgeData; 4],
    height_field: &HeightField,
    sampling: Sampling,
) -> Result<[Edge; 4], OutlineError> {
    let shown = background_strip::shown(edges.each_ref().map(|edge| edge.lines.as_slice()));
    edges.iter_mut().zip(shown).for_each(|(edge, lines)| edge.take_for_strip(lines, sampling));
    // Along an edge that is not dithered all beams may be mixed, or none. Such edges count only where no edge is
    // dithered.
    let any = edges.iter().any(|edge| edge.dithered);
    let counting: Vec<&[LatticeLine]> =
        edges.iter().filter(|edge| edge.dithered || !any).map(|edge| edge.lines.as_slice()).collect();
    let counted = footprint::counted(&counting, sampling.angle);
    let showing = edges.each_ref().map(|edge| edge.dithered && footprint::is_shown(&edge.lines));
    let prior = &ContrastDistribution::PRIOR;
    let first_fits = |edges: &[EdgeData; 4], shape| -> Result<[Option<EdgeFit>; 4], OutlineError> {
        let fit = |k: usize| edges[k].fit((counted, shape), true, prior, sampling.step);
        let [a, b, c, d] = of_each(|k| showing[k].then(|| fit(k)).transpose());
        Ok([a?, b?, c?, d?])
    };
    let mut shape = BeamShape::most_likely(|shape| -> Result<f64, OutlineError> {
        Ok(first_fits(&edges, shape)?.iter().flatten().map(|edge| edge.log_likelihood).sum())
    })?;
    let mut first = first_fits(&edges, shape)?;
    if scatter(&first).is_some_and(|scatter| scatter > SMOOTH_SCATTER) {
        shape = BeamShape::of_few_rays();
        first = first_fits(&edges, shape)?;
    }
    let usual = footprint::usual(first.iter().flatten().map(|fit| fit.beam.footprint));
    for (fit, data) in first.iter_mut().zip(&mut edges) {
        if let Some(other) = fit.take_if(|fit| !usual.contains(&fit.beam.footprint)) {
            if other.beam.footprint > usual.end {
                data.take_for_strip(0..data.lines.len(), sampling);
            }
        } else if let Some(fit) = fit {
            let at = |along| fit.found.curve.at(along);
            let lines = background_strip::near_far_edges(&data.lines, at, fit.beam.footprint);
            data.take_for_strip(lines, sampling);
        }
    }
    let found: Vec<f64> = first.iter().flatten().map(|fit| fit.beam.footprint).collect();
    let common = if found.is_empty() { counted } else { found.iter().sum::<f64>() / found.len() as f64 };
    let [a, b, c, d] = of_each(|k| {
        let others = first.iter().enumerate().filter(|(other, _)| *other != k);
        let prior =
            ContrastDistribution::combined(others.filter_map(|(_, fit)| Some(&fit.as_ref()?.contrasts)));
        let own = first[k].is_some() || !showing[k];
        let fit = edges[k].fit((common, shape), own, &prior, sampling.step)?;
        Edge::new(&edges[k], fit, (common, &prior), height_field, sampling)
    });
    Ok([a?, b?, c?, d?])
}

/// Returns the scatter of the positions of edges by their mixed pixels, in radii of the beam; `None` for too few pixels.
fn scatter(fits: &[Option<EdgeFit>; 4]) -> Option<f64> {
    let offsets: Vec<f64> = fits.iter().flatten().flat_map(EdgeFit::mixed_offsets).collect();
    if offsets.len() < LEAST_PIXELS { None } else { robust_deviation(offsets) }
}

/// Returns true when the edge, approximately at `base`, is dithered: it crosses so many columns and rows of the lattice
/// that its position between them is practically random.
fn is_dithered(lines: &[LatticeLine], base: impl Fn(f64) -> f64, step: f64) -> bool {
    let on_it = lines.iter().filter(|l| l.is_near(base(l.along), step));
    LatticeLine::extent(on_it).iter().all(|count| *count >= DITHERED)
}

/// An edge as a curve in its strip.
#[derive(Debug, Clone)]
pub(super) struct Edge {
    strip: DevelopedStrip,
    side_face: SideFace,
    posterior: Posterior,
    /// Half the angle that a beam sees, radians.
    footprint: f64,
    /// Standard deviations across the edge by the height field, metres, at equal steps from corner to corner.
    height_sigma: [f64; HEIGHTS],
    /// True when its mixed pixels determine the contrasts.
    contrast_known: bool,
    /// Coverage by the crossings that agree with the curve.
    pub(super) seen: Coverage,
    pub(super) from: f64,
    pub(super) to: f64,
}

impl Edge {
    /// Builds the edge of a fit. `footprint` and `known` are those with which the fit began.
    ///
    /// # Errors
    /// [`OutlineError::Edge`] when too little of it is seen.
    fn new(
        data: &EdgeData,
        fit: EdgeFit,
        (footprint, known): (f64, &ContrastDistribution),
        height_field: &HeightField,
        Sampling { step, .. }: Sampling,
    ) -> Result<Self, OutlineError> {
        let height_sigma = height_sigma(data, &fit, height_field);
        let EdgeFit { lines, found, covariance, beam, .. } = fit;
        let EdgeData { strip, prior, from, to, .. } = data;
        let (from, to) = (*from, *to);
        let posterior = if data.dithered {
            Posterior::laplace(found.curve, &covariance)
        } else {
            let beam = BeamModel { footprint, ..beam };
            Posterior::sampled(&found.curve, prior, &data.lines, [from, to], beam, known, step)
                .ok_or_else(|| strip.too_few())?
        };
        let agreeing = lines.iter().filter(|b| b.agrees(posterior.curve.at(b.along), step));
        let seen = Coverage::new(agreeing.map(|b| b.along), step);
        let n_odds = data.lines.iter().filter(|line| line.has_odds()).count();
        Ok(Self {
            strip: strip.clone(),
            side_face: data.side_face,
            posterior,
            footprint: beam.footprint,
            height_sigma,
            contrast_known: data.dithered && beam.mixes_linearly() && n_odds >= LEAST_PIXELS,
            seen,
            from,
            to,
        })
    }

    /// Returns the point of the edge at a distance along it.
    pub(super) fn point(&self, along: f64) -> Vec3 {
        self.strip.lift(Vector2::new(along, self.posterior.curve.at(along)))
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
        let share = ((along - self.from) / (self.to - self.from)).clamp(0.0, 1.0) * (HEIGHTS - 1) as f64;
        let below = (share as usize).min(HEIGHTS - 2);
        let [low, high] = [self.height_sigma[below], self.height_sigma[below + 1]];
        let by_height = low + (share - below as f64) * (high - low);
        self.posterior.variance(along).sqrt().hypot(COMMON).hypot(self.contrast_sigma(along)).hypot(by_height)
    }

    /// Returns the part of the standard deviation that is due to the contrast, metres; its error has the same sign at
    /// all edges of a plate.
    pub(super) fn contrast_sigma(&self, along: f64) -> f64 {
        let (point, normal) = (self.point(along), self.strip.normal(along));
        let inward = self.strip.inward(along, slope(&self.posterior.curve, along));
        let seen = self.footprint * lattice_line::inwards_per_radian(point, normal, inward);
        let cosine = normal.dot(&-point.normalize()).clamp(LEAST_COSINE, 1.0);
        let by_range = self.side_face.is_seen(point, normal, inward);
        seen * if self.contrast_known || by_range { CONTRAST_SPREAD } else { -UNKNOWN_SPREAD * cosine.ln() }
    }
}

/// Returns the curvature by membrane strain at a place along an edge, in parts of its mean over the edge.
///
/// The stress vanishes at the corners, and with it the strain. For plates of least membrane energy (spheres and tori of
/// `sim/plate`) this parabola is right to a tenth of its height.
fn strain_profile(along: f64, [from, to]: [f64; 2]) -> f64 {
    let from_middle = (2.0 * along - from - to) / (to - from);
    1.5 * (1.0 - from_middle * from_middle).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::super::contrast::tests::crossing;
    use super::*;
    use crate::PlateSpec;
    use crate::extract::Crossing;

    /// An edge that crosses a column of the lattice every 0.4 m: the base curve follows the staircase of the middles.
    #[test]
    fn the_side_face_has_the_direction_of_the_edge() {
        let (step, turn) = (5e-3, 0.0125);
        let sampling = Sampling { step, angle: 6e-4, noise: 1e-3 };
        let spec = PlateSpec {
            width: 1.6,
            height: 2.0,
            thickness: 0.04,
            face_inset: 0.0,
            root_face: 0.0,
            u_axis: None,
            region: None,
        };
        let on_edge = |x: f64| Vec3::new(x, turn * x - 6.0, -3.0);
        let crossings = (-80..=80).map(|k| {
            let on_edge = on_edge(0.01 * f64::from(k));
            let at = |y: f64| Vec3::new(on_edge.x, y, on_edge.z);
            let inside = at(step * (on_edge.y / step).ceil());
            let outside = inside - Vec3::y() * step;
            let crossing = Crossing { inside, outside, mixed: None, ..crossing(0.5) };
            ProjectedCrossing { crossing, cell: inside, residual: 0.0, place: [0; 2] }
        });
        let ends = [on_edge(-0.8), on_edge(0.8)];
        let data =
            EdgeData::new(crossings.collect(), ends, spec.thickness, SideFace::of(&spec), 0.0, sampling)
                .unwrap();
        let across = Vec3::new(-turn, 1.0, 0.0).normalize();
        let most = |slope: &dyn Fn(f64) -> f64| {
            let off =
                |line: &LatticeLine| data.strip.inward(line.along, slope(line.along)).cross(&across).norm();
            data.lines.iter().map(off).fold(0.0, f64::max)
        };
        let base = |at: f64| (data.strip.base(at + step) - data.strip.base(at - step)) / (2.0 * step);
        let (by_course, by_base) = (most(&|at| slope(&data.course, at)), most(&base));
        assert!(by_course < 2.5e-3 && by_base > 4.0 * by_course, "{by_course} {by_base}");
        // All crossings moved alike move the edge by as much.
        let prior = ContrastDistribution::PRIOR;
        let fit = data.fit((1e-4, BeamShape::numbered(0)), false, &prior, step).unwrap();
        for along in [data.from, 0.5 * (data.from + data.to), data.to] {
            let whole: f64 = fit.influences([along]).iter().map(|[influence]| influence).sum();
            assert!((whole - 1.0).abs() < 3e-5, "{along}: {whole}");
        }
    }

    #[test]
    fn the_profile_of_the_strain_has_the_mean_one() {
        let ends = [0.3, 3.1];
        let at = |k: i32| ends[0] + (ends[1] - ends[0]) * (f64::from(k) + 0.5) / 1000.0;
        let mean = (0..1000).map(|k| strain_profile(at(k), ends)).sum::<f64>() / 1000.0;
        assert!((mean - 1.0).abs() < 1e-5, "{mean}");
        assert_eq!([0.0, 0.3, 3.1, 3.5].map(|along| strain_profile(along, ends)), [0.0; 4]);
    }
}
