//! Dimension checks as done with tape, square and sight line: edge lengths, diagonals, corner angles, twist.
//!
//! The figures are those of the measured outline, not of the rectangle to which it is mapped. They show by how many
//! millimetres a cut blank differs from its order. In: outline, surface, range error of the scanner. Out:
//! [`ShapeChecks`], each figure with its standard deviation.
//!
//! Standard deviations follow from those of the corners (propagation of uncertainty, JCGM 100:2008): within the surface
//! from the outline, across it from the fit, along the beam from the scanner's range error. Errors of different corners
//! count as independent, except that due to the contrast of face and background (`outline::edge`), which shifts all
//! edges of a plate inwards or all outwards.

use crate::outline::{Corner, EdgeCurve};
use crate::range_error::{RangeError, beam};
use crate::{Outline, Surface, Vec3};

/// Length of a square's arm, metres, or half the edge where that is shorter. Corner angles are those between the lines
/// fitted to the edges over this length.
const ARM: f64 = 1.0;

/// Dimension checks of one plate. Edges in the order v = 0, u = W, v = H, u = 0; corners (0,0), (W,0), (W,H), (0,H).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShapeChecks {
    /// The four edges.
    pub edges: [EdgeCheck; 4],
    /// Straight distances from corner to corner, as by a stretched string: from (0,0) to (W,H), from (W,0) to (0,H).
    /// Metres.
    pub diagonals: [Check; 2],
    /// The first diagonal less the second, metres: 0 on a plate that is square.
    pub diagonal_difference: Check,
    /// Inner angles between the edges in the plate's own surface, radians.
    pub angles: [Check; 4],
    /// Angle by which the far edge is turned clockwise against the near one, seen along u (from u = 0 to u = W) and
    /// along v, radians; 0 on a plate that lies flat on two winding sticks.
    pub twist: [Check; 2],
}

/// A figure and its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Check {
    /// Value, metres or radians.
    pub value: f64,
    /// Standard deviation.
    pub sigma: f64,
    /// False when the figure depends on a corner that was extrapolated.
    pub seen: bool,
}

/// One edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeCheck {
    /// Length of a tape laid along the edge of the scanned face, metres.
    pub face: Check,
    /// The same length on the mid-surface, which bending does not stretch, metres. It is to be compared with the cut
    /// size, for a bevelled plate less the face's inset at both ends.
    pub mid: Check,
    /// Straight distance from corner to corner, metres.
    pub chord: Check,
}

impl ShapeChecks {
    /// Computes the figures of a measured outline with its corners projected to the surface: the height of an outline's
    /// corner is that of a few cells, the height of the surface that of all. `range_error` is that of the scanner.
    #[must_use]
    pub fn new(outline: &Outline, surface: &Surface, range_error: RangeError) -> Self {
        let mut corners = outline.corners;
        for (corner, [u, v]) in corners.iter_mut().zip(CORNERS) {
            let [u, v] = [u * surface.width(), v * surface.height()];
            corner.point = projected(corner.point, surface.face(u, v), surface.normal(u, v));
        }
        Self::of_corners(&corners, outline, surface, range_error)
    }

    /// Computes the figures of an outline without projection, such as the true outline of a simulated plate. The
    /// surface gives normals and thickness.
    #[must_use]
    pub fn of_outline(outline: &Outline, surface: &Surface, range_error: RangeError) -> Self {
        Self::of_corners(&outline.corners, outline, surface, range_error)
    }

    fn of_corners(
        corners: &[Corner; 4],
        outline: &Outline,
        surface: &Surface,
        range_error: RangeError,
    ) -> Self {
        let normal = |u: f64, v: f64| surface.normal(u * surface.width(), v * surface.height());
        let sigma = |u: f64, v: f64| surface.sigma_point(u * surface.width(), v * surface.height());
        Self::with(corners, &outline.edges, 0.5 * surface.thickness(), &normal, &sigma, range_error)
    }

    /// Computes the figures from functions of the shares of the plate's sides: `normal`, and `sigma`, the standard
    /// deviation along it.
    fn with(
        outlined: &[Corner; 4],
        curves: &[EdgeCurve; 4],
        half_thickness: f64,
        normal: &dyn Fn(f64, f64) -> Vec3,
        sigma: &dyn Fn(f64, f64) -> f64,
        range_error: RangeError,
    ) -> Self {
        let corners = [0, 1, 2, 3].map(|k| {
            let [u, v] = CORNERS[k];
            let edges = [&curves[k], &curves[(k + 3) % 4]];
            Known::new(&outlined[k], edges, normal(u, v), sigma(u, v), range_error)
        });
        let straight = |from: usize, to: usize| {
            let way = corners[to].at - corners[from].at;
            check(
                way.norm(),
                variance_apart(&corners[from], &corners[to], way),
                &[&corners[from], &corners[to]],
            )
        };
        let edges = [0, 1, 2, 3].map(|k| {
            let next = (k + 1) % 4;
            let along = |share: f64| {
                let ([u0, v0], [u1, v1]) = (CORNERS[k], CORNERS[next]);
                normal(u0 + share * (u1 - u0), v0 + share * (v1 - v0))
            };
            let curve = &curves[k];
            let chord = straight(k, next);
            let length = |depth: f64| Check { value: arc(curve, &along, depth), ..chord };
            EdgeCheck { face: length(0.0), mid: length(half_thickness), chord }
        });
        let diagonals = [straight(0, 2), straight(1, 3)];
        let [first, second] = diagonals;
        Self {
            edges,
            diagonals,
            diagonal_difference: Check {
                value: first.value - second.value,
                sigma: first.sigma.hypot(second.sigma),
                seen: first.seen && second.seen,
            },
            angles: corners.each_ref().map(angle),
            twist: [twist(&corners, [0, 3], [1, 2]), twist(&corners, [0, 1], [3, 2])],
        }
    }
}

/// Places of the corners in shares of the plate's sides.
const CORNERS: [[f64; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];

/// A corner with the uncertainty of its place.
struct Known {
    at: Vec3,
    /// Unit directions of the leaving edge, of the arriving edge, of the normal, of the beam.
    axes: [Vec3; 4],
    /// Standard deviations along them.
    sigma: [f64; 4],
    /// Displacement of the corner by one standard deviation of the contrast, which all corners have in common.
    contrast: Vec3,
    /// Standard deviations of the two edges' directions, radians.
    tilt: [f64; 2],
    seen: bool,
}

impl Known {
    /// Builds a corner from the edges that leave it and arrive at it.
    fn new(
        corner: &Corner,
        edges: [&EdgeCurve; 2],
        normal: Vec3,
        across: f64,
        range_error: RangeError,
    ) -> Self {
        let Corner { point, sigma, contrast, seen } = *corner;
        let arm = |edge: &EdgeCurve, from_end: bool| Arm::new(edge, from_end, point, normal, range_error);
        let arms = [arm(edges[0], false), arm(edges[1], true)];
        let axes = [arms[0].direction, arms[1].direction, normal, beam(&point)];
        let [leaving, arriving] = [0, 1].map(|k| (sigma[k].powi(2) - contrast[k].powi(2)).max(0.0).sqrt());
        let sigma = [leaving, arriving, across, range_error.sigma()];
        // Both edges run from the corner inwards along the other one.
        let contrast = axes[0] * contrast[0] + axes[1] * contrast[1];
        Self { at: point, axes, sigma, contrast, tilt: arms.map(|arm| arm.tilt), seen }
    }

    /// Returns the variance of the place along a direction of any length, without that of the contrast.
    fn variance(&self, way: Vec3) -> f64 {
        let unit = way / way.norm().max(f64::MIN_POSITIVE);
        (0..4).map(|i| (unit.dot(&self.axes[i]) * self.sigma[i]).powi(2)).sum()
    }
}

/// Returns the variance of the vector from one corner to another along a direction of any length.
fn variance_apart(from: &Known, to: &Known, along: Vec3) -> f64 {
    let unit = along / along.norm().max(f64::MIN_POSITIVE);
    from.variance(along) + to.variance(along) + unit.dot(&(to.contrast - from.contrast)).powi(2)
}

/// Returns the point projected along the normal onto the plane through `face`.
fn projected(point: Vec3, face: Vec3, normal: Vec3) -> Vec3 {
    point + normal * normal.dot(&(face - point))
}

fn check(value: f64, variance: f64, corners: &[&Known]) -> Check {
    Check { value, sigma: variance.sqrt(), seen: corners.iter().all(|corner| corner.seen) }
}

/// Returns the length of an edge, `depth` below the face.
fn arc(curve: &EdgeCurve, normal: &dyn Fn(f64) -> Vec3, depth: f64) -> f64 {
    let last = (curve.points.len().max(2) - 1) as f64;
    let below: Vec<Vec3> =
        curve.points.iter().enumerate().map(|(i, p)| p - normal(i as f64 / last) * depth).collect();
    below.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum()
}

/// Direction in which an edge leaves a corner, in the tangent plane of the plate there.
struct Arm {
    /// Direction of the least-squares line through the edge's points within a square's arm; zero where there are none.
    direction: Vec3,
    /// Standard deviation of that direction, radians. It includes the edge's uncertainty, by which the ends of the arm
    /// may be off in opposite senses, the scatter of the points about the line, and the tilt by a range error.
    tilt: f64,
}

impl Arm {
    fn new(curve: &EdgeCurve, from_end: bool, corner: Vec3, normal: Vec3, range_error: RangeError) -> Self {
        let n = curve.points.len();
        let point = |i: usize| curve.points[if from_end { n - 1 - i } else { i }];
        let reach = ARM.min(0.5 * (curve.points[n - 1] - curve.points[0]).norm());
        let near: Vec<Vec3> = (0..n)
            .map(|i| point(i) - corner)
            .take_while(|way| way.norm() <= reach)
            .map(|way| way - normal * way.dot(&normal))
            .collect();
        let count = near.len().max(1) as f64;
        let mean = near.iter().sum::<Vec3>() / count;
        // Regression on the distance from the corner, which orders the points.
        let sum: Vec3 = near.iter().map(|p| (p - mean) * (p.norm() - mean.norm())).sum();
        let direction = if sum.norm() > 0.0 { sum.normalize() } else { Vec3::zeros() };
        let aside = |p: &Vec3| (p - mean).cross(&direction).norm_squared();
        let scatter = near.iter().map(aside).sum::<f64>() / count;
        let own = (2.0 * (curve.sigma.powi(2) + scatter)).sqrt() / reach;
        let by_range = range_error.tilt(&corner, &(direction * reach), &normal.cross(&direction));
        Self { direction, tilt: own.hypot(by_range) }
    }
}

/// Computes the angle between the edges of a corner.
fn angle(corner: &Known) -> Check {
    let ([leaving, arriving, ..], [a, b]) = (corner.axes, corner.tilt);
    check(leaving.angle(&arriving), a * a + b * b, &[corner])
}

/// Computes the turn from the near edge to the far one about the line from middle to middle, clockwise as seen along
/// it.
fn twist(corners: &[Known; 4], near: [usize; 2], far: [usize; 2]) -> Check {
    let middle = |[a, b]: [usize; 2]| (corners[a].at + corners[b].at) * 0.5;
    let sight = (middle(far) - middle(near)).normalize();
    let across = |[a, b]: [usize; 2]| {
        let way = corners[b].at - corners[a].at;
        way - sight * way.dot(&sight)
    };
    let (a, b) = (across(near), across(far));
    let value = a.cross(&b).dot(&sight).atan2(a.dot(&b));
    let tilt = |[from, to]: [usize; 2], way: Vec3| {
        let aside = sight.cross(&way);
        variance_apart(&corners[from], &corners[to], aside) / way.norm_squared()
    };
    check(value, tilt(near, a) + tilt(far, b), &[&corners[0], &corners[1], &corners[2], &corners[3]])
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    const W: f64 = 3.0;
    const H: f64 = 2.5;
    const HALF: f64 = 0.02;

    /// Computes the checks of a face given over shares of the sides, with its normals by differences.
    fn checks(face: impl Fn(f64, f64) -> Vec3, sigma: f64) -> ShapeChecks {
        checks_with(face, [sigma, 0.0], RangeError::default())
    }

    fn checks_with(
        face: impl Fn(f64, f64) -> Vec3,
        [sigma, contrast]: [f64; 2],
        range_error: RangeError,
    ) -> ShapeChecks {
        let corner = |k: usize| Corner {
            point: face(CORNERS[k][0], CORNERS[k][1]),
            sigma: [sigma, 2.0 * sigma],
            contrast: [contrast; 2],
            seen: k != 2,
        };
        let edge = |k: usize| {
            let ([u0, v0], [u1, v1]) = (CORNERS[k], CORNERS[(k + 1) % 4]);
            let at = |i: usize| i as f64 / 300.0;
            let points: Vec<Vec3> =
                (0..=300).map(|i| face(u0 + at(i) * (u1 - u0), v0 + at(i) * (v1 - v0))).collect();
            EdgeCurve { seen: vec![true; points.len()], points, sigma }
        };
        let normal = |u: f64, v: f64| {
            let d = 1e-5;
            let along_u = face(u + d, v) - face(u - d, v);
            let along_v = face(u, v + d) - face(u, v - d);
            along_u.cross(&along_v).normalize()
        };
        let (corners, edges) = ([0, 1, 2, 3].map(corner), [0, 1, 2, 3].map(edge));
        ShapeChecks::with(&corners, &edges, HALF, &normal, &|_, _| 3.0 * sigma, range_error)
    }

    fn near(found: f64, expected: f64, within: f64) {
        assert!((found - expected).abs() < within, "found {found}, expected {expected}");
    }

    #[test]
    fn a_flat_plate_has_its_own_measures() {
        let flat = checks(|u, v| Vec3::new(u * W, v * H, 0.0), 1e-4);
        for (edge, length) in flat.edges.iter().zip([W, H, W, H]) {
            near(edge.face.value, length, 1e-12);
            near(edge.mid.value, length, 1e-12);
            near(edge.chord.value, length, 1e-12);
        }
        near(flat.diagonals[0].value, W.hypot(H), 1e-12);
        near(flat.diagonal_difference.value, 0.0, 1e-12);
        for angle in flat.angles {
            near(angle.value, FRAC_PI_2, 1e-9);
        }
        near(flat.twist[0].value, 0.0, 1e-12);
        near(flat.twist[1].value, 0.0, 1e-12);
    }

    #[test]
    fn a_projected_corner_keeps_its_place_and_takes_the_height_of_the_surface() {
        let normal = Vec3::new(0.6, 0.0, 0.8);
        let (face, along) = (Vec3::new(1.0, 2.0, 3.0), Vec3::new(0.8, 0.1, -0.6));
        let found = projected(face + along + normal * 0.004, face, normal);
        assert!((found - face - along).norm() < 1e-12, "{found}");
    }

    #[test]
    fn uncertainties_follow_from_the_corners() {
        let flat = checks(|u, v| Vec3::new(u * W, v * H, 0.0), 1e-4);
        // An edge: along the leaving edge at one corner (1), along the arriving edge at the other (2).
        near(flat.edges[0].chord.sigma, 1e-4 * 5.0_f64.sqrt(), 1e-9);
        // Normals 3 at four corners, over the two edges that are sighted.
        near(flat.twist[0].sigma, 1e-4 * 3.0 * 2.0 / H, 1e-9);
        near(flat.twist[1].sigma, 1e-4 * 3.0 * 2.0 / W, 1e-9);
        // Two edges, each off at both ends of its arm.
        near(flat.angles[0].sigma, 1e-4 * 2.0 / ARM, 1e-9);
        assert!(flat.edges[3].chord.seen && !flat.edges[1].chord.seen && !flat.diagonals[0].seen);
        assert!(flat.diagonals[1].seen && !flat.twist[0].seen);
    }

    /// The contrast displaces both ends of an edge to the same side.
    #[test]
    fn a_contrast_is_that_of_all_corners() {
        let contrast = 1e-4;
        let flat =
            checks_with(|u, v| Vec3::new(u * W, v * H, 0.0), [contrast, contrast], RangeError::default());
        // Along the leaving edge the whole variance is that of the contrast, along the arriving one a quarter of it.
        near(flat.edges[0].chord.sigma, contrast * (3.0_f64 + 4.0).sqrt(), 1e-9);
        let unit = Vec3::new(W, H, 0.0) / W.hypot(H);
        // The arriving edges run along v at both ends.
        let own = 2.0 * 3.0 * unit.y.powi(2);
        near(flat.diagonals[0].sigma, contrast * (own + (2.0 * (unit.x + unit.y)).powi(2)).sqrt(), 1e-9);
    }

    /// A plate far below the scanner is moved along its normal: its twist is uncertain, its lengths are not. For a
    /// plate far to the side the beam runs along u, and the lengths along u are uncertain.
    #[test]
    fn a_range_error_counts_along_the_beam() {
        let range_error = RangeError::new(1e-3);
        let below = checks_with(|u, v| Vec3::new(u * W, v * H, -1e6), [0.0; 2], range_error);
        near(below.twist[0].sigma, 2e-3 / H, 1e-8);
        near(below.twist[1].sigma, 2e-3 / W, 1e-8);
        assert!(below.edges.iter().all(|edge| edge.chord.sigma < 1e-8));
        assert!(below.angles.iter().all(|angle| angle.sigma < 1e-8));
        let aside = checks_with(|u, v| Vec3::new(1e6 + u * W, v * H, 0.0), [0.0; 2], range_error);
        near(aside.edges[0].mid.sigma, 2.0_f64.sqrt() * 1e-3, 1e-8);
        assert!(aside.edges[1].mid.sigma < 1e-8 && aside.twist[0].sigma < 1e-8);
        // The edges along v are moved across at both ends of their arms.
        near(aside.angles[0].sigma, 2.0_f64.sqrt() * 1e-3 / ARM, 1e-8);
    }

    #[test]
    fn a_cylinder_keeps_its_size_on_the_mid_surface_alone() {
        let radius = 5.0;
        let face = |u: f64, v: f64| {
            let (sin, cos) = ((u - 0.5) * W / radius).sin_cos();
            let inside = radius - HALF;
            Vec3::new(inside * sin, v * H, radius - inside * cos)
        };
        let bent = checks(face, 0.0);
        near(bent.edges[0].mid.value, W, 2e-6);
        near(bent.edges[0].face.value, W * (radius - HALF) / radius, 2e-6);
        let chord = 2.0 * (radius - HALF) * (0.5 * W / radius).sin();
        near(bent.edges[0].chord.value, chord, 1e-12);
        near(bent.edges[1].face.value, H, 1e-12);
        near(bent.diagonals[0].value, chord.hypot(H), 1e-12);
        for angle in bent.angles {
            near(angle.value, FRAC_PI_2, 1e-6);
        }
        near(bent.twist[0].value, 0.0, 1e-12);
    }

    #[test]
    fn a_plate_out_of_square_shows_in_angles_and_diagonals() {
        let shear = 0.004_f64;
        let leaning = checks(|u, v| Vec3::new(u * W + shear * v * H, v * H, 0.0), 0.0);
        near(leaning.angles[0].value, FRAC_PI_2 - shear.atan(), 1e-9);
        near(leaning.angles[1].value, FRAC_PI_2 + shear.atan(), 1e-9);
        let expected = (W + shear * H).hypot(H) - (W - shear * H).hypot(H);
        near(leaning.diagonal_difference.value, expected, 1e-12);
    }

    #[test]
    fn a_screw_is_twisted_by_its_pitch_in_its_own_sense() {
        let turn = 0.03_f64;
        // Seen along +u, y turns towards z: clockwise for an observer who looks along x.
        let screw = |u: f64, v: f64| {
            let (sin, cos) = (turn * (u - 0.5)).sin_cos();
            Vec3::new(u * W, (v - 0.5) * H * cos, (v - 0.5) * H * sin)
        };
        near(checks(screw, 0.0).twist[0].value, turn, 1e-9);
        near(checks(|u, v| screw(1.0 - u, 1.0 - v), 0.0).twist[0].value, turn, 1e-9);
        // Along v the same plate winds the other way, by the turn of a hyperbolic paraboloid.
        assert!(checks(screw, 0.0).twist[1].value < -0.5 * turn);
    }
}
