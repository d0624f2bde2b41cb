//! Boundary of the scanned face: four corners and four edge curves, by interval-censored maximum likelihood.
//!
//! A lattice line that crosses an edge gives an interval for the edge's position: between the last sample on the plate
//! and the first one beyond it (an interval-censored observation). Each edge is the smooth curve that is most likely
//! given all intervals of its lattice lines.
//!
//! Input: the [`Patch`] of `extract`. Output: the [`Outline`], on the scanned face, with standard deviations. The steps
//! in order:
//!
//! | module | step | source |
//! |---|---|---|
//! | `boundary_loop` | mesh of lattice neighbours, its longest boundary loop by shortest paths | Masuda et al., 3.2 |
//! | `visible_boundary` | boundary crossings along the loop, without those at objects that hide the plate | own |
//! | `corners` | corners: angle to the k-th neighbours, RANSAC lines, intersections | Masuda et al., 3.2 |
//! | `height_field` | the face as one smoothed height over its mean `plane` | own |
//! | `projected_crossing` | crossings moved along their beams onto that height field | own |
//! | `developed_strip` | each edge's surroundings developed into the plane | own |
//! | `lattice_line` | one lattice line across an edge as an observation: interval, mixed pixels, side face | own |
//! | `background_strip` | lattice lines beside a strip of background narrower than a beam | own |
//! | `edge_likelihood` | likelihood of an edge position given one lattice line (interval-censored observation) | own |
//! | `side_face` | square or bevelled side face beside an edge, as a beam meets it | own |
//! | `footprint` | angle that a beam sees, from the mixed pixels | own |
//! | `beam_shape` | position of an edge in a beam from the power on either side; truncation of the Gaussian beam by maximum likelihood | Siegman 1986, 17.1; own |
//! | `contrast` | position of an edge within a mixed pixel, by its range and the contrast of plate and background (linear mixing model) | own |
//! | `edge` | each edge as the penalised spline of largest likelihood, and its standard deviation | own |
//! | `edge_fit` | that spline by Newton's method, with footprint and contrasts in turn | own |
//! | `edge_posterior` | covariance: Laplace's method, or adaptive Metropolis along a lattice line | own |
//! | `coverage` | stretches along an edge where it was seen | own |
//!
//! Finally the edges are intersected, named from the u axis hint and compared with the plate's size. Masuda et al. fit
//! a spline to the boundary samples themselves, which lie up to a lattice step inside the plate; this module locates
//! the edge between the samples.
//!
//! Limits: four smooth edges that meet at 60 to 120 degrees; no hole that reaches an edge.

mod background_strip;
mod beam_shape;
mod boundary_loop;
mod contrast;
mod corners;
mod coverage;
mod developed_strip;
mod edge;
mod edge_fit;
mod edge_likelihood;
mod edge_posterior;
mod error;
mod footprint;
mod height_field;
mod lattice_line;
mod plane;
mod projected_crossing;
mod side_face;
mod visible_boundary;

pub use error::OutlineError;
pub use height_field::HeightField;
pub(crate) use height_field::{SPAN, biweight, per_sigma_across, thinned};

use platen_numerics::join::join;

use crate::extract::Patch;
use crate::{EXPANDED, PlateSpec, Vec3};
use edge::{Edge, EdgeData};
use plane::Plane;
use projected_crossing::ProjectedCrossing;
use side_face::SideFace;
use visible_boundary::VisibleBoundary;

/// A corner of the scanned face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corner {
    /// Position on the scanned face, metres, scanner frame.
    pub point: Vec3,
    /// Standard deviation along the edge that leaves the corner and along the one that arrives, metres.
    pub sigma: [f64; 2],
    /// Parts of these that the contrast of plate and background causes: all edges of a plate are off to the same side,
    /// inwards or outwards.
    pub contrast: [f64; 2],
    /// False when the corner's neighbourhood was hidden and its place was extrapolated from its edges.
    pub seen: bool,
}

impl Corner {
    /// Returns the larger of the expanded uncertainties (95 %) along its two edges, metres.
    #[must_use]
    pub fn uncertainty(&self) -> f64 {
        EXPANDED * self.sigma[0].max(self.sigma[1])
    }
}

/// One edge of the scanned face from its first to its last corner.
#[derive(Debug, Clone, PartialEq)]
pub struct EdgeCurve {
    /// Points on the edge at equal steps of arc length (at most 10 mm), first and last are the corners.
    pub points: Vec<Vec3>,
    /// Per point: true where the edge was seen, false where it was bridged.
    pub seen: Vec<bool>,
    /// Standard deviation across the edge, in the surface, metres.
    pub sigma: f64,
}

/// Boundary of the scanned face in the order (0,0), (W,0), (W,H), (0,H): edge k runs from corner k to corner k + 1.
///
/// Seen from the scanner the loop runs counter-clockwise: (u, v, towards the scanner) is right-handed.
#[derive(Debug, Clone, PartialEq)]
pub struct Outline {
    /// Corners.
    pub corners: [Corner; 4],
    /// Edges v = 0, u = W, v = H, u = 0.
    pub edges: [EdgeCurve; 4],
    /// The smoothed scanned face, on which corners and edges lie.
    pub height_field: HeightField,
}

/// Sampling of the plate by the beams.
#[derive(Debug, Clone, Copy)]
struct Sampling {
    /// Spacing of the samples, metres.
    step: f64,
    /// Angle between beams, radians.
    angle: f64,
    /// Noise of the range, metres.
    noise: f64,
}

/// Crossings nearer to a corner than this many lattice steps may belong to either edge.
const CORNER_STEPS: f64 = 2.5;

/// Seed of all random numbers: the same scan gives the same outline.
const SEED: u64 = 0x706c_6174_656e;

/// Spacing of the points of an edge curve, metres.
const POINT_SPACING: f64 = 0.01;

/// Largest angle between the u axis hint and an edge, degrees: a hint within 10 degrees of 45 does not distinguish the
/// corners.
const LARGEST_HINT_ANGLE: f64 = 35.0;

/// Relative difference between the length of an edge and the plate file above which the scan is one of another plate.
/// Cut blanks differ by millimetres, bending changes edges of the mid-surface by up to 11 mm.
const SIZE_TOLERANCE: f64 = 0.01;

/// A wrong size is reported as such where at least this part of the edge and of its two neighbours was seen; otherwise
/// as a hidden edge.
const REPORTED_PART: f64 = 0.75;

/// Locates corners and edges of a plate's scanned face.
///
/// Corners and edges are those of the face as it is seen, not of the nominal rectangle. The known size is used to
/// refuse another plate, never to move an edge.
///
/// # Errors
/// [`OutlineError`]: the corner, edge or side that could not be located, and why.
pub fn outline(patch: &Patch, spec: &PlateSpec) -> Result<Outline, OutlineError> {
    let visible = VisibleBoundary::of(patch, spec)?;
    let corners = corners::find(&visible.flat, visible.step, spec.width.min(spec.height))?;
    let near = corners.map(|corner| visible.lift(&corner));
    let height_field = HeightField::fit(patch, visible.plane.along(corners[1].point - corners[0].point))?;
    let sampling = Sampling {
        step: visible.step,
        angle: (patch.azimuth_step * patch.elevation_step).sqrt(),
        noise: patch.noise,
    };
    let side_face = SideFace::of(spec);
    let mean_curvature = edge_curvature(height_field.gaussian_curvature(&near), &near);
    let side = |k: usize| {
        let (from, to) = (near[k], near[(k + 1) % 4]);
        let margin = CORNER_STEPS * visible.step;
        let crossings = visible
            .between(corners[k].at, corners[(k + 1) % 4].at)
            .filter_map(|crossing| ProjectedCrossing::of(crossing, patch, &height_field))
            .filter(|s| [from, to].iter().all(|corner| (s.crossing.inside - corner).norm() > margin))
            .collect();
        EdgeData::new(crossings, [from, to], spec.thickness, side_face, mean_curvature, sampling)
    };
    let [a, b, c, d] = of_each(side);
    let mut edges = edge::fit_all([a?, b?, c?, d?], &height_field, sampling)?;
    let mut points = near;
    for k in 0..4 {
        let arriving = (k + 3) % 4;
        let (point, to, from) = meet(&edges[arriving], &edges[k], near[k]);
        points[k] = point;
        edges[arriving].to = to;
        edges[k].from = from;
    }
    let first = first_corner(&points, &visible.plane, spec.u_axis)?;
    edges.rotate_left(first);
    points.rotate_left(first);
    check_size(&edges, spec)?;
    let corner = |k: usize| {
        let (arriving, leaving) = (&edges[(k + 3) % 4], &edges[k]);
        Corner {
            point: points[k],
            sigma: [arriving.sigma(arriving.to), leaving.sigma(leaving.from)],
            contrast: [arriving.contrast_sigma(arriving.to), leaving.contrast_sigma(leaving.from)],
            seen: arriving.seen.at(arriving.to) && leaving.seen.at(leaving.from),
        }
    };
    let curve = |k: usize| curve(&edges[k], [points[k], points[(k + 1) % 4]]);
    Ok(Outline { corners: [0, 1, 2, 3].map(corner), edges: [0, 1, 2, 3].map(curve), height_field })
}

/// Returns the mean geodesic curvature of the edges of a rectangular blank that was bent to a Gaussian curvature, 1/m,
/// positive towards its middle.
///
/// The geodesic curvature of the boundary, the Gaussian curvature of the face and the turns at the corners add up to a
/// whole turn (Gauss-Bonnet theorem). The corners are taken as right angles, as they were cut. Then the integral along
/// the boundary is minus the Gaussian curvature times the area.
fn edge_curvature(gaussian: f64, corners: &[Vec3; 4]) -> f64 {
    let [a, b, c, d] = corners;
    let area = 0.5 * (c - a).cross(&(d - b)).norm();
    let perimeter: f64 = [b - a, c - b, d - c, a - d].iter().map(Vec3::norm).sum();
    -gaussian * area / perimeter
}

/// Evaluates `of` for the four edges, two on each of two threads; opposite edges take about the same time and go to
/// different threads. For speed only: benchmark `outline_of_the_face`.
fn of_each<T: Send>(of: impl Fn(usize) -> T + Sync) -> [T; 4] {
    let ([a, b], [c, d]) = join(|| [0, 1].map(&of), || [2, 3].map(&of));
    [a, b, c, d]
}

/// Intersects two edges by Gauss-Newton steps on the distance of the two curves. Returns the point and its place along
/// each.
fn meet(arriving: &Edge, leaving: &Edge, near: Vec3) -> (Vec3, f64, f64) {
    /// Number of steps: for nearly straight curves the third one is below rounding.
    const STEPS: usize = 5;
    const DIFFERENCE: f64 = 0.02;
    let (mut a, mut b) = (arriving.along(near), leaving.along(near));
    for _ in 0..STEPS {
        let apart = leaving.point(b) - arriving.point(a);
        let tangent = |edge: &Edge, at: f64| {
            (edge.point(at + DIFFERENCE) - edge.point(at - DIFFERENCE)) / (2.0 * DIFFERENCE)
        };
        let (t_a, t_b) = (tangent(arriving, a), tangent(leaving, b));
        // Least squares of a t_a - b t_b = apart.
        let (aa, bb, ab) = (t_a.norm_squared(), t_b.norm_squared(), t_a.dot(&t_b));
        let (ra, rb) = (t_a.dot(&apart), t_b.dot(&apart));
        let determinant = aa * bb - ab * ab;
        a += (ra * bb - ab * rb) / determinant;
        b += (ab * ra - aa * rb) / determinant;
    }
    (0.5 * (arriving.point(a) + leaving.point(b)), a, b)
}

/// Selects the corner (0, 0): the start of the edge that runs most along the hint. Without a hint, u runs to the right
/// as seen from the scanner.
fn first_corner(points: &[Vec3; 4], plane: &Plane, hint: Option<Vec3>) -> Result<usize, OutlineError> {
    let hint = hint.map_or_else(nalgebra::Vector2::x, |hint| plane.direction(hint));
    let angle = |k: usize| plane.direction(points[(k + 1) % 4] - points[k]).angle(&hint).to_degrees();
    let first = (0..4).min_by(|&a, &b| angle(a).total_cmp(&angle(b))).unwrap_or(0);
    let angle_deg = angle(first);
    if angle_deg > LARGEST_HINT_ANGLE || angle_deg.is_nan() {
        return Err(OutlineError::Hint { angle_deg });
    }
    Ok(first)
}

/// Compares the lengths of the mid-surface's edges with the plate file.
fn check_size(edges: &[Edge; 4], spec: &PlateSpec) -> Result<(), OutlineError> {
    let cut = spec.rectangle().face_edge_lengths(spec.face_inset);
    for (k, (side, expected)) in ["width", "height"].into_iter().cycle().zip(cut).enumerate() {
        let found = edges[k].length_below(0.5 * spec.thickness);
        if (found - expected).abs() > SIZE_TOLERANCE * expected {
            let (found_mm, expected_mm) = (found * 1000.0, expected * 1000.0);
            // The length of an edge depends on both neighbours: they cross it at its ends.
            let beside = [&edges[(k + 3) % 4], &edges[k], &edges[(k + 1) % 4]];
            let seen = beside.map(|edge| edge.seen.share(edge.from, edge.to)).into_iter().fold(1.0, f64::min);
            return Err(if seen < REPORTED_PART {
                OutlineError::Hidden { seen_percent: 100.0 * seen, side, found_mm, expected_mm }
            } else {
                OutlineError::WrongSize { side, found_mm, expected_mm }
            });
        }
    }
    Ok(())
}

/// Samples an edge at equal steps, ending in the corners.
fn curve(edge: &Edge, ends: [Vec3; 2]) -> EdgeCurve {
    let length = edge.to - edge.from;
    let n = (length / POINT_SPACING).ceil().max(1.0) as usize;
    let places: Vec<f64> = (0..=n).map(|i| edge.from + length * i as f64 / n as f64).collect();
    let mut points: Vec<Vec3> = places.iter().map(|&at| edge.point(at)).collect();
    (points[0], points[n]) = (ends[0], ends[1]);
    let mean_variance = places.iter().map(|&at| edge.sigma(at).powi(2)).sum::<f64>() / places.len() as f64;
    let seen = places.iter().map(|&at| edge.seen.at(at)).collect();
    EdgeCurve { points, seen, sigma: mean_variance.sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two meridians and two parallels of a sphere meet at right angles. A parallel at the latitude f turns by sin f per
    /// radian of longitude.
    #[test]
    fn the_edges_of_a_plate_turn_by_its_gaussian_curvature() {
        let (radius, width, south, north) = (10.0, 0.3, -0.1_f64, 0.25_f64);
        let at = |latitude: f64, longitude: f64| {
            let ([sin, cos], [east, north]) =
                ([latitude.sin(), latitude.cos()], [longitude.sin(), longitude.cos()]);
            Vec3::new(cos * north, cos * east, sin) * radius
        };
        let corners = [at(south, 0.0), at(south, width), at(north, width), at(north, 0.0)];
        let perimeter = radius * (2.0 * (north - south) + width * (north.cos() + south.cos()));
        let turn = edge_curvature(1.0 / (radius * radius), &corners) * perimeter;
        let expected = -width * (north.sin() - south.sin());
        // The straight sides enclose a little less.
        assert!((turn / expected - 1.0).abs() < 0.02, "{turn} {expected}");
    }
}
