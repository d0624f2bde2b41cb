//! Bicubic tensor-product splines: evaluation, derivatives, and least-squares approximation of a given function.

use nalgebra::{DMatrix, SVector};

use crate::uniform_knots::UniformKnots;

/// A bicubic tensor-product spline from (u, v) to `D` components.
#[derive(Debug, Clone, PartialEq)]
pub struct TensorSpline<const D: usize> {
    /// Knots of u.
    pub u: UniformKnots,
    /// Knots of v.
    pub v: UniformKnots,
    /// Control values, v outer, u inner: index `k * u.n_coefficients() + i`.
    pub control: Vec<[f64; D]>,
}

/// Value and derivatives of a spline at one place; a field's name states the variables of differentiation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jet<const D: usize> {
    /// Value.
    pub p: [f64; D],
    /// Derivative by u.
    pub u: [f64; D],
    /// Derivative by v.
    pub v: [f64; D],
    /// Second derivative by u.
    pub uu: [f64; D],
    /// Mixed derivative.
    pub uv: [f64; D],
    /// Second derivative by v.
    pub vv: [f64; D],
}

impl<const D: usize> TensorSpline<D> {
    /// Builds the spline that is 0 everywhere.
    #[must_use]
    pub fn zeros(u: UniformKnots, v: UniformKnots) -> Self {
        Self { u, v, control: vec![[0.0; D]; u.n_coefficients() * v.n_coefficients()] }
    }

    /// Approximates `f` by least squares on a regular grid of two samples per span (and the ends).
    #[must_use]
    pub fn approximate(u: UniformKnots, v: UniformKnots, mut f: impl FnMut(f64, f64) -> [f64; D]) -> Self {
        let (us, pu) = grid_projection(&u);
        let (vs, pv) = grid_projection(&v);
        let samples: Vec<Vec<[f64; D]>> = vs.iter().map(|&y| us.iter().map(|&x| f(x, y)).collect()).collect();
        let mut spline = Self::zeros(u, v);
        for d in 0..D {
            let values = DMatrix::from_fn(us.len(), vs.len(), |i, k| samples[k][i][d]);
            let control = &pu * values * pv.transpose();
            for (slot, value) in spline.control.iter_mut().zip(control.iter()) {
                slot[d] = *value;
            }
        }
        spline
    }

    /// Returns the value at (u, v).
    #[must_use]
    pub fn point(&self, u: f64, v: f64) -> [f64; D] {
        let ((i, bu), (k, bv)) = (self.u.values(u), self.v.values(v));
        let mut p = [0.0; D];
        for (row, wv) in bv.iter().enumerate() {
            for (c, wu) in self.row(i, k + row).iter().zip(&bu) {
                for d in 0..D {
                    p[d] += wv * wu * c[d];
                }
            }
        }
        p
    }

    /// Returns value and first derivatives at (u, v): p, p_u, p_v.
    #[must_use]
    pub fn frame(&self, u: f64, v: f64) -> [[f64; D]; 3] {
        let (su, sv) = (self.u.local_basis(u), self.v.local_basis(v));
        let mut out = [[0.0; D]; 3];
        for row in 0..4 {
            let (mut along, mut slope) = ([0.0; D], [0.0; D]);
            for (i, c) in self.row(su.first, sv.first + row).iter().enumerate() {
                for d in 0..D {
                    along[d] += su.value[i] * c[d];
                    slope[d] += su.d1[i] * c[d];
                }
            }
            for d in 0..D {
                out[0][d] += sv.value[row] * along[d];
                out[1][d] += sv.value[row] * slope[d];
                out[2][d] += sv.d1[row] * along[d];
            }
        }
        out
    }

    /// Returns value and derivatives to second order at (u, v).
    #[must_use]
    #[inline(always)]
    pub fn jet(&self, u: f64, v: f64) -> Jet<D> {
        let (su, sv) = (self.u.local_basis(u), self.v.local_basis(v));
        let mut jet = Jet { p: [0.0; D], u: [0.0; D], v: [0.0; D], uu: [0.0; D], uv: [0.0; D], vv: [0.0; D] };
        for row in 0..4 {
            let (mut along, mut slope, mut bend) = ([0.0; D], [0.0; D], [0.0; D]);
            for (i, c) in self.row(su.first, sv.first + row).iter().enumerate() {
                for d in 0..D {
                    along[d] += su.value[i] * c[d];
                    slope[d] += su.d1[i] * c[d];
                    bend[d] += su.d2[i] * c[d];
                }
            }
            for d in 0..D {
                jet.p[d] += sv.value[row] * along[d];
                jet.u[d] += sv.value[row] * slope[d];
                jet.v[d] += sv.d1[row] * along[d];
                jet.uu[d] += sv.value[row] * bend[d];
                jet.uv[d] += sv.d1[row] * slope[d];
                jet.vv[d] += sv.d2[row] * along[d];
            }
        }
        jet
    }

    /// Returns the four control values of row `k` for the span that starts at coefficient `i`.
    #[inline(always)]
    fn row(&self, i: usize, k: usize) -> &[[f64; D]] {
        let start = k * self.u.n_coefficients() + i;
        &self.control[start..start + 4]
    }

    /// Returns the polynomial of the span (i, k) in coordinates s (along u) and t (along v) from its middle: `[q][p]`
    /// is the coefficient of s^p t^q.
    #[cfg(feature = "solvers")]
    pub(crate) fn polynomial(&self, i: usize, k: usize) -> [[[f64; D]; 4]; 4] {
        let mut bicubic = [[[0.0; D]; 4]; 4];
        for (b, along_v) in crate::uniform_knots::BASIS.iter().enumerate() {
            // Row k + b of the spline as a polynomial in s.
            let mut row = [[0.0; D]; 4];
            for (control, along_u) in self.row(i, k + b).iter().zip(&crate::uniform_knots::BASIS) {
                for (slot, f) in row.iter_mut().zip(along_u) {
                    (0..D).for_each(|d| slot[d] += f * control[d]);
                }
            }
            for (slots, f) in bicubic.iter_mut().zip(along_v) {
                for (slot, x) in slots.iter_mut().zip(&row) {
                    (0..D).for_each(|d| slot[d] += f * x[d]);
                }
            }
        }
        bicubic
    }
}

/// Returns the coefficients of the spline curve nearest to `f`, as [`TensorSpline::approximate`] for a surface.
pub fn approximate_curve<const D: usize>(
    knots: UniformKnots,
    f: impl FnMut(f64) -> SVector<f64, D>,
) -> Vec<SVector<f64, D>> {
    let (at, projection) = grid_projection(&knots);
    let samples: Vec<SVector<f64, D>> = at.into_iter().map(f).collect();
    let coefficient = |row: usize| projection.row(row).iter().zip(&samples).map(|(w, p)| p * *w).sum();
    (0..knots.n_coefficients()).map(coefficient).collect()
}

/// Returns the sample places of one direction, two per span and the end, and the matrix that maps samples to
/// least-squares coefficients.
fn grid_projection(knots: &UniformKnots) -> (Vec<f64>, DMatrix<f64>) {
    let n = 2 * knots.n_spans().max(3);
    let at: Vec<f64> =
        (0..=n).map(|j| knots.start() + (knots.end() - knots.start()) * j as f64 / n as f64).collect();
    let mut basis = DMatrix::zeros(n + 1, knots.n_coefficients());
    for (j, x) in at.iter().enumerate() {
        let (first, values) = knots.values(*x);
        for (i, value) in values.iter().enumerate() {
            basis[(j, first + i)] = *value;
        }
    }
    let projection = (basis.transpose() * &basis).cholesky().map(|c| c.solve(&basis.transpose()));
    (at, projection.unwrap_or_else(|| DMatrix::zeros(knots.n_coefficients(), n + 1)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cubic(u: f64, v: f64) -> [f64; 2] {
        [u * u * u * v - v * v, 1.0 + u * v * v * v + u * u]
    }

    #[test]
    fn bicubics_are_reproduced_with_their_derivatives() {
        let spline =
            TensorSpline::approximate(UniformKnots::new(0.0, 2.0, 6), UniformKnots::new(-1.0, 1.0, 5), cubic);
        for (u, v) in [(0.0, -1.0), (0.7, 0.3), (2.0, 1.0), (1.99, -0.2)] {
            let jet = spline.jet(u, v);
            let frame = spline.frame(u, v);
            let close = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).abs() + (a[1] - b[1]).abs() < 1e-10;
            assert!(close(jet.p, cubic(u, v)) && close(spline.point(u, v), jet.p) && close(frame[0], jet.p));
            assert!(close(jet.u, [3.0 * u * u * v, v * v * v + 2.0 * u]) && close(frame[1], jet.u));
            assert!(close(jet.v, [u * u * u - 2.0 * v, 3.0 * u * v * v]) && close(frame[2], jet.v));
            assert!(close(jet.uu, [6.0 * u * v, 2.0]) && close(jet.uv, [3.0 * u * u, 3.0 * v * v]));
            assert!(close(jet.vv, [-2.0, 6.0 * u * v]));
        }
    }

    #[test]
    fn a_smooth_function_is_met_with_the_fourth_order() {
        let error = |n: usize| {
            let f = |u: f64, v: f64| [(3.0 * u).sin() * (2.0 * v).cos()];
            let spline =
                TensorSpline::approximate(UniformKnots::new(0.0, 1.0, n), UniformKnots::new(0.0, 1.0, n), f);
            (0..400)
                .map(|k| (f64::from(k % 20) / 19.0, f64::from(k / 20) / 19.0))
                .map(|(u, v)| (spline.point(u, v)[0] - f(u, v)[0]).abs())
                .fold(0.0, f64::max)
        };
        let order = (error(8) / error(16)).log2();
        assert!((3.5..4.7).contains(&order), "order {order}");
    }
}
