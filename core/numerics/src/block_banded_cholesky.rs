//! Block-banded Cholesky factorisation of the normal matrix of a tensor spline, and the band of its inverse.
//!
//! Coefficients are ordered row after row of the control net along its longer axis. The support of a B-spline overlaps
//! those of the three previous rows. The matrix therefore has half-bandwidth 3 in blocks of one row, and so has its
//! factor. The covariance of a spline's value at one place requires the inverse only inside the same band. It is
//! computed by the recursion of Takahashi, Fagan and Chen (1973), in blocks as in Golub and Plemmons (1980).
//!
//! All dense kernels run on one thread: the results do not depend on the machine's load, to the last bit.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::{Accum, Mat, MatMut, MatRef, Par};

use crate::block_banded::{BlockBandedFactor, Layout, REACH};
use crate::vector_registers::ClearVectorRegisters;

/// Symmetric matrix over the coefficients of a net: blocks (row, row - 0..=3), column-major, lower triangle.
#[derive(Debug, Clone, PartialEq)]
pub struct BlockBandedMatrix {
    layout: Layout,
    blocks: Vec<f64>,
}

/// Error: the matrix is not positive definite; some coefficients are determined neither by points nor by the penalty.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NotPositiveDefinite;

impl BlockBandedMatrix {
    /// Builds the zero matrix over `n_u` x `n_v` coefficients.
    #[must_use]
    pub fn zeros(n_u: usize, n_v: usize) -> Self {
        let layout = Layout { n_u, n_v };
        Self { layout, blocks: vec![0.0; layout.len()] }
    }

    /// Adds `value` for the product of coefficient pair `i` along u with pair `k` along v, both ascending: to the
    /// entries (i0,k0)-(i1,k1) and (i1,k0)-(i0,k1), once where they coincide.
    pub fn add_pair(&mut self, i: [usize; 2], k: [usize; 2], value: f64) {
        self.add((i[0], k[0]), (i[1], k[1]), value);
        if i[0] != i[1] && k[0] != k[1] {
            self.add((i[1], k[0]), (i[0], k[1]), value);
        }
    }

    /// Adds `weight` times the Kronecker product of two banded matrices given by their upper diagonals.
    pub fn add_kronecker(&mut self, along_u: &[[f64; 4]], along_v: &[[f64; 4]], weight: f64) {
        let (layout, m) = (self.layout, self.layout.block());
        let (outer, inner) = if layout.v_is_outer() { (along_v, along_u) } else { (along_u, along_v) };
        for row in 0..layout.n_rows() {
            for back in 0..=REACH.min(row) {
                let factor = weight * outer[row - back][back];
                let block = &mut self.blocks[layout.range(row, back)];
                for (low, diagonals) in inner.iter().enumerate() {
                    for (high, value) in (low..m).zip(diagonals) {
                        block[low * m + high] += factor * value;
                        // Only the lower triangle of a block on the diagonal is used.
                        if back > 0 && high > low {
                            block[high * m + low] += factor * value;
                        }
                    }
                }
            }
        }
    }

    fn add(&mut self, a: (usize, usize), b: (usize, usize), value: f64) {
        let (a, b) = (self.layout.place(a.0, a.1), self.layout.place(b.0, b.1));
        let (high, low) = if a >= b { (a, b) } else { (b, a) };
        let block = self.layout.range(high.0, high.0 - low.0).start;
        self.blocks[block + low.1 * self.layout.block() + high.1] += value;
    }

    /// Returns the product with a vector in the net's order.
    #[cfg(test)]
    fn times(&self, x: &[f64]) -> Vec<f64> {
        let (layout, m) = (self.layout, self.layout.block());
        let mut sorted = vec![0.0; x.len()];
        (0..x.len()).for_each(|c| sorted[layout.index(c)] = x[c]);
        let mut product = vec![0.0; x.len()];
        for row in 0..layout.n_rows() {
            for back in 0..=REACH.min(row) {
                let block = &self.blocks[layout.range(row, back)];
                for (c, column) in block.chunks_exact(m).enumerate() {
                    let first = if back == 0 { c } else { 0 };
                    for (r, value) in column.iter().enumerate().skip(first) {
                        let (i, j) = (row * m + r, (row - back) * m + c);
                        product[i] += value * sorted[j];
                        if i != j {
                            product[j] += value * sorted[i];
                        }
                    }
                }
            }
        }
        (0..x.len()).map(|c| product[layout.index(c)]).collect()
    }

    /// Factorises the matrix (Cholesky, left-looking over block rows).
    ///
    /// # Errors
    /// [`NotPositiveDefinite`].
    pub fn factor(mut self) -> Result<BlockBandedFactor, NotPositiveDefinite> {
        let _clear = ClearVectorRegisters;
        let (layout, m) = (self.layout, self.layout.block());
        let mut memory = MemBuffer::new(cholesky_in_place_scratch::<f64>(m, Par::Seq, Default::default()));
        for row in 0..layout.n_rows() {
            for back in (0..=REACH.min(row)).rev() {
                let column = row - back;
                // In memory the blocks of earlier rows precede this block; those of this row with larger `back` follow
                // it.
                let here = layout.range(row, back);
                let (before, rest) = self.blocks.split_at_mut(here.start);
                let (target, after) = rest.split_at_mut(here.len());
                let mut target = view_mut(target, m);
                let behind = |k: usize| {
                    let range = layout.range(row, row - k);
                    view(&after[range.start - here.end..range.end - here.end], m)
                };
                for k in row.saturating_sub(REACH)..column {
                    let right = if back == 0 {
                        behind(k)
                    } else {
                        view(&before[layout.range(column, column - k)], m)
                    };
                    matmul(target.as_mut(), Accum::Add, behind(k), right.transpose(), -1.0, Par::Seq);
                }
                if back == 0 {
                    let stack = MemStack::new(&mut memory);
                    cholesky_in_place(
                        target.as_mut(),
                        Default::default(),
                        Par::Seq,
                        stack,
                        Default::default(),
                    )
                    .map_err(|_| NotPositiveDefinite)?;
                    (0..m).for_each(|c| target.as_mut().col_mut(c).subrows_mut(0, c).fill(0.0));
                } else {
                    let diagonal = view(&before[layout.range(column, 0)], m);
                    solve_lower_triangular_in_place(diagonal, target.transpose_mut(), Par::Seq);
                }
            }
        }
        if self.blocks.iter().any(|x| !x.is_finite()) {
            return Err(NotPositiveDefinite);
        }
        Ok(BlockBandedFactor { layout, blocks: self.blocks })
    }
}

impl BlockBandedFactor {
    /// Solves A X = B in place; rows of `x` in the net's order, one column per component.
    pub fn solve<const D: usize>(&self, x: &mut [[f64; D]]) {
        let _clear = ClearVectorRegisters;
        let (layout, m) = (self.layout, self.layout.block());
        let forward = self.forward(x);
        let mut work = Mat::from_fn(x.len(), D, |place, d| forward[place][d]);
        for row in (0..layout.n_rows()).rev() {
            let (done, rest) = work.as_mut().split_at_row_mut((row + 1) * m);
            let mut target = done.subrows_mut(row * m, m);
            for ahead in 1..=REACH.min(layout.n_rows() - 1 - row) {
                let block = view(&self.blocks[layout.range(row + ahead, ahead)], m);
                let known = rest.as_ref().subrows((ahead - 1) * m, m);
                matmul(target.as_mut(), Accum::Add, block.transpose(), known, -1.0, Par::Seq);
            }
            let diagonal = view(&self.blocks[layout.range(row, 0)], m);
            solve_upper_triangular_in_place(diagonal.transpose(), target, Par::Seq);
        }
        for (c, row) in x.iter_mut().enumerate() {
            *row = std::array::from_fn(|d| work[(layout.index(c), d)]);
        }
    }

    /// Returns the inverse inside the band, per coefficient (i, k) of the net's order: covariances with the
    /// coefficients (i + di, k + dk) at `(dk + 3) * 7 + di + 3`, 0 where there is none.
    #[must_use]
    pub fn local_inverse(&self) -> Vec<[f64; 49]> {
        let _clear = ClearVectorRegisters;
        let (layout, m) = (self.layout, self.layout.block());
        let mut local = vec![[0.0; 49]; layout.n_u * layout.n_v];
        let mut recent = Recent::new(m);
        let mut work = Mat::<f64>::zeros(m, m);
        for row in (0..layout.n_rows()).rev() {
            let reach = REACH.min(layout.n_rows() - 1 - row);
            let diagonal = view(&self.blocks[layout.range(row, 0)], m);
            // U_k = L_(row+k, row) L_(row, row)^-1.
            let scaled: Vec<Mat<f64>> = (1..=reach)
                .map(|k| {
                    let mut u = view(&self.blocks[layout.range(row + k, k)], m).to_owned();
                    solve_upper_triangular_in_place(
                        diagonal.transpose(),
                        u.as_mut().transpose_mut(),
                        Par::Seq,
                    );
                    u
                })
                .collect();
            for j in (1..=reach).rev() {
                work.fill(0.0);
                for (k, u) in (1..=reach).zip(&scaled) {
                    let known = recent.block(row + j.min(k), j.abs_diff(k));
                    let known = if j >= k { known } else { known.transpose() };
                    matmul(work.as_mut(), Accum::Add, known, u.as_ref(), -1.0, Par::Seq);
                }
                recent.put(row, j, &work);
            }
            let mut own = Mat::<f64>::identity(m, m);
            solve_lower_triangular_in_place(diagonal, own.as_mut(), Par::Seq);
            matmul(work.as_mut(), Accum::Replace, own.transpose(), own.as_ref(), 1.0, Par::Seq);
            for (k, u) in (1..=reach).zip(&scaled) {
                let known = recent.block(row, k).transpose();
                matmul(work.as_mut(), Accum::Add, known, u.as_ref(), -1.0, Par::Seq);
            }
            // Rounding leaves a skew part, which the recursion would amplify since it uses blocks for their transposes.
            for c in 0..m {
                for r in 0..c {
                    let mean = 0.5 * (work[(r, c)] + work[(c, r)]);
                    (work[(r, c)], work[(c, r)]) = (mean, mean);
                }
            }
            recent.put(row, 0, &work);
            (0..=reach).for_each(|ahead| spread(layout, row, ahead, recent.block(row, ahead), &mut local));
        }
        local
    }
}

/// Blocks of the inverse that couple the last rows of the recursion with each other; no others are required.
struct Recent {
    blocks: Vec<Mat<f64>>,
}

impl Recent {
    fn new(m: usize) -> Self {
        Self { blocks: vec![Mat::zeros(m, m); (REACH + 1) * (REACH + 1)] }
    }

    fn place(row: usize, ahead: usize) -> usize {
        row % (REACH + 1) * (REACH + 1) + ahead
    }

    /// Returns the block that couples row `row + ahead`, down, to row `row`, across.
    fn block(&self, row: usize, ahead: usize) -> MatRef<'_, f64> {
        self.blocks[Self::place(row, ahead)].as_ref()
    }

    fn put(&mut self, row: usize, ahead: usize, block: &Mat<f64>) {
        self.blocks[Self::place(row, ahead)].copy_from(block);
    }
}

/// Copies the block that couples row `row + ahead`, down, to row `row`, across, into the 49 slots of each coefficient,
/// from both sides, as far as it lies inside the band along both axes.
fn spread(layout: Layout, row: usize, ahead: usize, block: MatRef<'_, f64>, local: &mut [[f64; 49]]) {
    let slot = |by_row: usize, by_inner: usize| {
        if layout.v_is_outer() { by_row * 7 + by_inner } else { by_inner * 7 + by_row }
    };
    let coefficient = |outer: usize, inner: usize| {
        let (i, k) = if layout.v_is_outer() { (inner, outer) } else { (outer, inner) };
        k * layout.n_u + i
    };
    for across in 0..layout.block() {
        let around = across.saturating_sub(REACH)..(across + REACH + 1).min(layout.block());
        for down in around {
            let value = block[(down, across)];
            local[coefficient(row + ahead, down)][slot(REACH - ahead, across + REACH - down)] = value;
            local[coefficient(row, across)][slot(REACH + ahead, down + REACH - across)] = value;
        }
    }
}

fn view(block: &[f64], m: usize) -> MatRef<'_, f64> {
    MatRef::from_column_major_slice(block, m, m)
}

fn view_mut(block: &mut [f64], m: usize) -> MatMut<'_, f64> {
    MatMut::from_column_major_slice_mut(block, m, m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::uniform_knots::UniformKnots;
    use nalgebra::DMatrix;

    /// Returns the Gram matrix plus penalty over a small net, as a band and as a dense matrix.
    fn example(spans_u: usize, spans_v: usize) -> (BlockBandedMatrix, DMatrix<f64>) {
        let (u, v) = (UniformKnots::new(0.0, 1.0, spans_u), UniformKnots::new(0.0, 1.3, spans_v));
        let mut band = BlockBandedMatrix::zeros(u.n_coefficients(), v.n_coefficients());
        band.add_kronecker(&u.gram(), &v.gram(), 1.0);
        band.add_kronecker(&u.roughness(), &v.gram(), 1e-7);
        let full = |diagonals: &[[f64; 4]]| {
            DMatrix::from_fn(diagonals.len(), diagonals.len(), |i, j| {
                let (low, high) = (i.min(j), i.max(j));
                if high - low > 3 { 0.0 } else { diagonals[low][high - low] }
            })
        };
        let dense = full(&v.gram()).kronecker(&full(&u.gram()))
            + full(&v.gram()).kronecker(&full(&u.roughness())) * 1e-7;
        (band, dense)
    }

    #[test]
    fn factor_solve_and_inverse_agree_with_dense_algebra() {
        for (spans_u, spans_v) in [(4, 6), (6, 4), (1, 5), (3, 3)] {
            let (band, dense) = example(spans_u, spans_v);
            let n = dense.nrows();
            let x: Vec<f64> = (0..n).map(|i| (i as f64 * 0.7).sin()).collect();
            let b = band.times(&x);
            let dense_b = &dense * DMatrix::from_column_slice(n, 1, &x);
            assert!(b.iter().zip(dense_b.iter()).all(|(p, q)| (p - q).abs() < 1e-12));

            let factor = band.factor().expect("positive definite");
            let mut solved: Vec<[f64; 2]> = b.iter().map(|y| [*y, -*y]).collect();
            factor.solve(&mut solved);
            assert!(solved.iter().zip(&x).all(|(s, x)| (s[0] - x).abs() < 1e-8 && (s[1] + x).abs() < 1e-8));

            let inverse = dense.try_inverse().expect("regular");
            let scale = inverse.amax();
            let (n_u, local) = (spans_u + 3, factor.local_inverse());
            for a in 0..n {
                for b in 0..n {
                    let (di, dk) = ((b % n_u) as i64 - (a % n_u) as i64, (b / n_u) as i64 - (a / n_u) as i64);
                    if di.abs() <= 3 && dk.abs() <= 3 {
                        let got = local[a][((dk + 3) * 7 + di + 3) as usize];
                        assert!(
                            (got - inverse[(a, b)]).abs() < 1e-9 * scale,
                            "{a} {b}: {got} {}",
                            inverse[(a, b)]
                        );
                    }
                }
            }
            let f: Vec<f64> = (0..n).map(|i| (i as f64 * 1.3).cos()).collect();
            let column = DMatrix::from_column_slice(n, 1, &f);
            let want = (column.transpose() * inverse * &column)[(0, 0)];
            assert!((factor.variance(&f) / want - 1.0).abs() < 1e-9);
        }
    }

    /// The recursion over many rows under a stiff penalty: a skew rounding error would grow fivefold per row.
    #[test]
    fn the_inverse_is_as_good_in_the_last_row_as_in_the_first() {
        let (u, v) = (UniformKnots::new(0.0, 3.0, 50), UniformKnots::new(0.0, 2.0, 33));
        let mut band = BlockBandedMatrix::zeros(u.n_coefficients(), v.n_coefficients());
        band.add_kronecker(&u.gram(), &v.gram(), 1.0);
        band.add_kronecker(&u.roughness(), &v.gram(), 1e-3);
        band.add_kronecker(&u.gram(), &v.roughness(), 1e-3);
        let factor = band.factor().expect("positive definite");
        let local = factor.local_inverse();
        for i in [0, 1, 10, 25, 40, 52] {
            let c = 15 * u.n_coefficients() + i;
            let mut unit = vec![[0.0]; local.len()];
            unit[c] = [1.0];
            factor.solve(&mut unit);
            assert!((local[c][24] / unit[c][0] - 1.0).abs() < 1e-9, "{i}: {} {}", local[c][24], unit[c][0]);
        }
    }

    #[test]
    fn an_undetermined_net_is_refused() {
        assert_eq!(BlockBandedMatrix::zeros(5, 6).factor().err(), Some(NotPositiveDefinite));
    }
}
