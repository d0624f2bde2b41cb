//! Normal equations of a penalised tensor spline fit, accumulated as moments per cell of the knot grid.
//!
//! The 16 B-splines of a cell are polynomials of degree 3 x 3, so that every product of two is a polynomial of degree 6
//! x 6. Thus 49 weighted moments per cell contain the same information as 136 products per point. Each point only adds
//! its moments; the normal matrix is computed from the cells once, whatever the number of points.

use nalgebra::{Matrix4, Vector4};

use crate::block_banded_cholesky::BlockBandedMatrix;
use crate::reml::{GAUSS, GridValues};
use crate::simd::dispatch_simd;
use crate::tensor_spline::TensorSpline;
use crate::uniform_knots::{BASIS, UniformKnots, multiply, pairs};

/// Weighted sums over the points of one cell.
#[derive(Debug, Clone, Copy)]
struct Cell<const D: usize> {
    /// Sum of w s^p t^q at `[q][p]`, with one slot more than powers, to fill vector registers.
    gram: [[f64; 8]; 7],
    /// Sum of w s^p t^q y at `[q][component][p]`.
    rhs: [[[f64; 4]; D]; 4],
    n_points: u32,
}

/// Least number of points of a cell for its own values: twice the coefficients.
const LEAST_POINTS: u32 = 8;
/// Powers (of u, of v) of a bilinear function.
const BILINEAR: [(usize, usize); 4] = [(0, 0), (1, 0), (0, 1), (1, 1)];

impl<const D: usize> Cell<D> {
    /// Returns the coefficients of the least-squares bilinear function of the component along `direction`.
    fn bilinear(&self, direction: [f64; D]) -> Option<Vector4<f64>> {
        let gram =
            Matrix4::from_fn(|a, b| self.gram[BILINEAR[a].1 + BILINEAR[b].1][BILINEAR[a].0 + BILINEAR[b].0]);
        let rhs = Vector4::from_fn(|a, _| {
            let sums = &self.rhs[BILINEAR[a].1];
            sums.iter().zip(&direction).map(|(x, y)| x[BILINEAR[a].0] * y).sum()
        });
        // Points spread over the whole cell give pivots down to 1/144 of their mass; a quarter of that is accepted.
        let cholesky = gram.cholesky()?;
        let least = cholesky.l_dirty().diagonal().iter().fold(f64::INFINITY, |a, x| a.min(x * x));
        (least > self.gram[0][0] / 576.0).then(|| cholesky.solve(&rhs))
    }
}

/// Sums over all points of a fit of `D` components.
#[derive(Debug, Clone)]
pub(crate) struct CellMoments<const D: usize> {
    pub(crate) u: UniformKnots,
    pub(crate) v: UniformKnots,
    cells: Vec<Cell<D>>,
    /// Sum of w y^2 over points and components.
    pub(crate) square: f64,
    /// Sum of the weights.
    pub(crate) weight: f64,
    /// Number of points with a positive weight.
    pub(crate) n_points: usize,
}

impl<const D: usize> CellMoments<D> {
    /// Returns the sums of no points.
    pub(crate) fn empty(u: UniformKnots, v: UniformKnots) -> Self {
        let empty = Cell { gram: [[0.0; 8]; 7], rhs: [[[0.0; 4]; D]; 4], n_points: 0 };
        Self { u, v, cells: vec![empty; u.n_spans() * v.n_spans()], square: 0.0, weight: 0.0, n_points: 0 }
    }

    /// Adds the point `y` at (u, v) with weight `w`; weight 0 adds nothing.
    #[inline(always)]
    pub(crate) fn add(&mut self, u: f64, v: f64, y: [f64; D], w: f64) {
        if w <= 0.0 {
            return;
        }
        let ((i, s), (k, t)) = (self.u.locate(u), self.v.locate(v));
        // If the compiler knew the constant 1 in it, it would split the loops over slots into scalars.
        let (p, q) = (std::hint::black_box(powers(s)), powers(t));
        let cell = &mut self.cells[k * self.u.n_spans() + i];
        cell.n_points += 1;
        for (row, tq) in cell.gram.iter_mut().zip(q) {
            let f = w * tq;
            for (slot, sp) in row.iter_mut().zip(p) {
                *slot += f * sp;
            }
        }
        for (rows, tq) in cell.rhs.iter_mut().zip(q) {
            for (row, y) in rows.iter_mut().zip(y) {
                let f = w * tq * y;
                for (slot, sp) in row.iter_mut().zip(p) {
                    *slot += f * sp;
                }
            }
        }
        self.square += w * y.iter().map(|x| x * x).sum::<f64>();
        self.weight += w;
        self.n_points += 1;
    }

    /// Returns the same sums, to the last bits, over cells of twice the length along those of (u, v) that `coarser`
    /// selects.
    pub(crate) fn joined(&self, coarser: [bool; 2]) -> Self {
        let axis = |axis: UniformKnots, coarser: bool| if coarser { (axis.coarser(), 2) } else { (axis, 1) };
        let ((u, of_u), (v, of_v)) = (axis(self.u, coarser[0]), axis(self.v, coarser[1]));
        let shift = |coarser: bool, cell: usize| if coarser { &HALVES[cell % 2] } else { &WHOLE };
        let mut cells = Self::empty(u, v).cells;
        for (index, cell) in self.cells.iter().enumerate() {
            let (i, k) = (index % self.u.n_spans(), index / self.u.n_spans());
            let shifts = [shift(coarser[0], i), shift(coarser[1], k)];
            let joined = &mut cells[k / of_v * u.n_spans() + i / of_u];
            joined.n_points += cell.n_points;
            add_moved(joined.gram.each_mut(), cell.gram, shifts);
            for d in 0..D {
                add_moved(
                    joined.rhs.each_mut().map(|rows| &mut rows[d]),
                    cell.rhs.map(|rows| rows[d]),
                    shifts,
                );
            }
        }
        Self { u, v, cells, ..*self }
    }

    /// Returns the normal matrix and the right-hand sides, in the net's order of control values.
    pub(crate) fn normal_equations(&self) -> (BlockBandedMatrix, Vec<[f64; D]>) {
        dispatch_simd(
            #[inline(always)]
            || self.normal_equations_here(),
        )
    }

    #[inline(always)]
    fn normal_equations_here(&self) -> (BlockBandedMatrix, Vec<[f64; D]>) {
        let (n_u, n_v) = (self.u.n_coefficients(), self.v.n_coefficients());
        // Per coefficient, the sums with the coefficients up to three farther along v and along u.
        let mut sums = vec![[[0.0; 4]; 4]; n_u * n_v];
        let mut rhs = vec![[0.0; D]; n_u * n_v];
        let products: Vec<((usize, usize), [f64; 7])> =
            pairs().map(|(i, j)| ((i, j), multiply(&BASIS[i], &BASIS[j]))).collect();
        // By power, the coefficients of all pairs side by side; more slots than pairs, to fill vector registers.
        let mut by_power = [[0.0; 12]; 7];
        for (pair, (_, product)) in products.iter().enumerate() {
            (0..7).for_each(|p| by_power[p][pair] = product[p]);
        }
        for (index, cell) in self.cells.iter().enumerate().filter(|(_, c)| c.gram[0][0] > 0.0) {
            let (i, k) = (index % self.u.n_spans(), index / self.u.n_spans());
            self.add_right_hand_side(cell, i, k, &mut rhs);
            for ((a, b), pv) in &products {
                // Moments for this pair of v-splines, as a polynomial in u.
                let mut row = [0.0; 8];
                for (f, moments) in pv.iter().zip(&cell.gram) {
                    row.iter_mut().zip(moments).for_each(|(slot, moment)| *slot += f * moment);
                }
                let mut values = [0.0; 12];
                for (x, pairs) in row.iter().zip(&by_power) {
                    values.iter_mut().zip(pairs).for_each(|(value, f)| *value += x * f);
                }
                for (((c, d), _), value) in products.iter().zip(values) {
                    sums[(k + a) * n_u + i + c][b - a][d - c] += value;
                }
            }
        }
        let mut matrix = BlockBandedMatrix::zeros(n_u, n_v);
        for (c, sums) in sums.iter().enumerate() {
            let (i, k) = (c % n_u, c / n_u);
            for (dk, along_u) in sums.iter().enumerate().take(n_v - k) {
                for (di, value) in along_u.iter().enumerate().take(n_u - i) {
                    matrix.add_pair([i, i + di], [k, k + dk], *value);
                }
            }
        }
        (matrix, rhs)
    }

    /// Returns the weighted sum of squared distances of the points from `spline`, over all components.
    pub(crate) fn residual_square(&self, spline: &TensorSpline<D>) -> f64 {
        let mut sum = self.square;
        for (index, cell) in self.cells.iter().enumerate().filter(|(_, c)| c.n_points > 0) {
            let (i, k) = (index % self.u.n_spans(), index / self.u.n_spans());
            let polynomial = spline.polynomial(i, k);
            for d in 0..D {
                for (a, q) in (0..4).flat_map(|q| (0..4).map(move |p| (p, q))) {
                    // The polynomial's own image under the cell's moments, less twice the right-hand side.
                    let mut image = -2.0 * cell.rhs[q][d][a];
                    for (row, moments) in polynomial.iter().zip(&cell.gram[q..]) {
                        image += row.iter().zip(&moments[a..]).map(|(c, m)| c[d] * m).sum::<f64>();
                    }
                    sum += polynomial[q][a][d] * image;
                }
            }
        }
        sum.max(0.0)
    }

    /// Returns four values per cell of the component along `direction`: those of a bilinear function through the cell's
    /// points at the Gauss places, where the noise of the four is independent and equal. A cell with too few points, or
    /// badly spread ones, has none.
    pub(crate) fn grid_values(&self, direction: [f64; D]) -> GridValues {
        let n_u = 2 * self.u.n_spans();
        let mut values = vec![None; n_u * 2 * self.v.n_spans()];
        for (index, cell) in self.cells.iter().enumerate().filter(|(_, c)| c.n_points >= LEAST_POINTS) {
            let (i, k) = (index % self.u.n_spans(), index / self.u.n_spans());
            let Some(c) = cell.bilinear(direction) else { continue };
            for (b, y) in GAUSS.into_iter().enumerate() {
                for (a, x) in GAUSS.into_iter().enumerate() {
                    let value = c[0] + c[1] * x + c[2] * y + c[3] * x * y;
                    values[(2 * k + b) * n_u + 2 * i + a] = Some(value);
                }
            }
        }
        // Each of the four values of a cell takes a quarter of its weight.
        let n_seen = self.cells.iter().filter(|c| c.n_points >= LEAST_POINTS).count();
        GridValues {
            u: self.u,
            v: self.v,
            values,
            stated: 4.0 * n_seen as f64 / self.weight.max(f64::MIN_POSITIVE),
        }
    }

    #[inline(always)]
    fn add_right_hand_side(&self, cell: &Cell<D>, i: usize, k: usize, rhs: &mut [[f64; D]]) {
        for (b, bv) in BASIS.iter().enumerate() {
            for (a, bu) in BASIS.iter().enumerate() {
                let slot = &mut rhs[(k + b) * self.u.n_coefficients() + i + a];
                for (fv, sums) in bv.iter().zip(&cell.rhs) {
                    for (x, sums) in slot.iter_mut().zip(sums) {
                        *x += fv * bu.iter().zip(sums).map(|(fu, y)| fu * y).sum::<f64>();
                    }
                }
            }
        }
    }
}

/// Powers of a place s in a cell by those of the place t in a part of it: `[p][q]` is the coefficient of t^q in s^p.
type Shift = [[f64; 7]; 7];

/// Shift of a part that is the whole cell.
const WHOLE: Shift = shift(1.0, 0.0);

/// Shifts of the first and the second half of the cell.
const HALVES: [Shift; 2] = [shift(0.5, -0.25), shift(0.5, 0.25)];

/// Returns the shift for s = `scale` t + `middle`.
const fn shift(scale: f64, middle: f64) -> Shift {
    let mut powers = [[0.0; 7]; 7];
    powers[0][0] = 1.0;
    let mut p = 1;
    while p < 7 {
        let mut q = 0;
        while q < 7 {
            let shifted = if q > 0 { powers[p - 1][q - 1] } else { 0.0 };
            powers[p][q] = scale * shifted + middle * powers[p - 1][q];
            q += 1;
        }
        p += 1;
    }
    powers
}

/// Adds the sums over the points of a part of a cell, `[q][p]`, to those of the cell.
fn add_moved<const P: usize, const Q: usize>(
    sums: [&mut [f64; P]; Q],
    of_part: [[f64; P]; Q],
    [by_u, by_v]: [&Shift; 2],
) {
    let mut moved = [[0.0; P]; Q];
    for (row, of_part) in moved.iter_mut().zip(of_part) {
        for (slot, by_u) in row.iter_mut().zip(by_u) {
            *slot = by_u.iter().zip(of_part).map(|(f, sum)| f * sum).sum();
        }
    }
    for (sums, by_v) in sums.into_iter().zip(by_v) {
        for (f, row) in by_v.iter().zip(moved) {
            sums.iter_mut().zip(row).for_each(|(slot, sum)| *slot += f * sum);
        }
    }
}

#[inline(always)]
fn powers(t: f64) -> [f64; 8] {
    let (t2, t3) = (t * t, t * t * t);
    [1.0, t, t2, t3, t2 * t2, t2 * t3, t3 * t3, 0.0]
}
