//! Coons patch of the four edge curves (Coons 1967): first approximation of the plate's face, and its coordinates (a,
//! b).
//!
//! The edges are smoothing splines through their ends (Masuda et al., 3.2, fit B-spline curves to the edges). In: the
//! outline. Out: a bicubic spline over the rectangle, metres.

use nalgebra::{DMatrix, DVector};
use platen_numerics::tensor_spline::{TensorSpline, approximate_curve};
use platen_numerics::uniform_knots::UniformKnots;

use crate::{EdgeCurve, Outline, Vec3};

/// Approximate length of a span of an edge's spline, metres: the cut edge of a plate has no finer detail *within* its
/// surface. Detail across the surface (narrow bends) is added later, from the samples inside.
const SPAN: f64 = 0.25;
/// Wavelength, metres, below which detail of an edge is taken for noise.
const SMOOTH_BELOW: f64 = 1.0;
/// Weight of a bridged point of an edge: sufficient to guide the curve, too small to bend it against seen points.
const BRIDGED: f64 = 0.01;
/// Weight that fixes the corners.
const CORNER: f64 = 1e6;

/// An edge as a smooth curve over [0, 1].
struct Edge {
    axis: UniformKnots,
    control: DMatrix<f64>,
}

impl Edge {
    /// Fits a spline to the points of the curve by penalised least squares, through both of its ends.
    fn fit(curve: &EdgeCurve) -> Self {
        let n = curve.points.len();
        let length: f64 = curve.points.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
        let axis = UniformKnots::new(0.0, 1.0, ((length / SPAN).ceil() as usize).clamp(3, 64));
        let n_coefficients = axis.n_coefficients();
        let mut normal = DMatrix::zeros(n_coefficients, n_coefficients);
        let mut rhs = DMatrix::zeros(n_coefficients, 3);
        for (j, point) in curve.points.iter().enumerate() {
            let end = j == 0 || j == n - 1;
            let seen = curve.seen.get(j).copied().unwrap_or(false);
            let weight = if end {
                CORNER
            } else if seen {
                1.0
            } else {
                BRIDGED
            };
            let (first, values) = axis.values(j as f64 / (n - 1) as f64);
            for (a, x) in values.iter().enumerate() {
                for (b, y) in values.iter().enumerate() {
                    normal[(first + a, first + b)] += weight * x * y;
                }
                (0..3).for_each(|d| rhs[(first + a, d)] += weight * x * point[d]);
            }
        }
        // At this wavelength the penalty's weight equals that of the points: n / (2 pi / wavelength)^6.
        let penalty = n as f64 * (SMOOTH_BELOW / length / std::f64::consts::TAU).powi(6);
        for (i, row) in axis.roughness().iter().enumerate() {
            for (k, value) in row.iter().enumerate().filter(|(k, _)| i + k < n_coefficients) {
                normal[(i, i + k)] += penalty * value;
                if k > 0 {
                    normal[(i + k, i)] += penalty * value;
                }
            }
        }
        let control = normal.cholesky().map_or_else(|| DMatrix::zeros(n_coefficients, 3), |c| c.solve(&rhs));
        Self { axis, control }
    }

    fn point(&self, s: f64) -> Vec3 {
        let (first, values) = self.axis.values(s);
        let weights = DVector::from_row_slice(&values);
        (self.control.rows(first, 4).transpose() * weights).fixed_rows::<3>(0).into_owned()
    }
}

/// Computes the Coons patch of the outline over `[0, width] x [0, height]`: bilinearly blended edges, whose sum
/// reproduces every surface of second order, however it is bent or turned. With an inset the outline lies that far
/// inside the rectangle, and the patch continues beyond the outline.
pub(crate) fn coons_patch(
    outline: &Outline,
    width: f64,
    height: f64,
    inset: f64,
    axes: [UniformKnots; 2],
) -> TensorSpline<3> {
    let corner = |k: usize| outline.corners[k].point;
    let share = |d: usize, at: f64| (at - inset) / ([width, height][d] - 2.0 * inset);
    // Control values along u of the edges v = 0 and v = H, along v of those at u = W and u = 0.
    let control = |k: usize| {
        let edge = Edge::fit(&outline.edges[k]);
        let share = |at: f64| if k < 2 { share(k % 2, at) } else { 1.0 - share(k % 2, at) };
        approximate_curve(axes[k % 2], |at| edge.point(share(at)))
    };
    let [bottom, right, top, left] = [0, 1, 2, 3].map(control);
    // Blending is linear; so the control values are blended, at the abscissas of the B-splines.
    let mut patch = TensorSpline::zeros(axes[0], axes[1]);
    let n_u = axes[0].n_coefficients();
    for (c, slot) in patch.control.iter_mut().enumerate() {
        let (i, k) = (c % n_u, c / n_u);
        let (x, y) = (share(0, axes[0].abscissa(i)), share(1, axes[1].abscissa(k)));
        let along_v = bottom[i] * (1.0 - y) + top[i] * y;
        let along_u = left[k] * (1.0 - x) + right[k] * x;
        let twice =
            (corner(0) * (1.0 - x) + corner(1) * x) * (1.0 - y) + (corner(3) * (1.0 - x) + corner(2) * x) * y;
        *slot = (along_v + along_u - twice).into();
    }
    patch
}
