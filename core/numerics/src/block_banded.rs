//! Cholesky factor of a tensor spline's normal matrix: its layout, and variances computed from it.
//!
//! Coefficients are ordered row after row of the control net along its longer axis. The support of a B-spline overlaps
//! those of the three previous rows. The matrix therefore has half-bandwidth 3 in blocks of one row, and so has its
//! factor, which `block_banded_cholesky` computes.

/// Number of previous rows of the net with which a B-spline overlaps.
pub(crate) const REACH: usize = 3;

/// Layout of the coefficients of a net in blocks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Layout {
    pub(crate) n_u: usize,
    pub(crate) n_v: usize,
}

impl Layout {
    /// Returns true when blocks follow each other along v, the longer axis.
    pub(crate) fn v_is_outer(self) -> bool {
        self.n_v >= self.n_u
    }

    pub(crate) fn n_rows(self) -> usize {
        self.n_u.max(self.n_v)
    }

    pub(crate) fn block(self) -> usize {
        self.n_u.min(self.n_v)
    }

    /// Returns the place (outer, inner) of the coefficient (i along u, k along v).
    pub(crate) fn place(self, i: usize, k: usize) -> (usize, usize) {
        if self.v_is_outer() { (k, i) } else { (i, k) }
    }

    /// Returns the index in block order of the coefficient with index `c` in the net's order (v outer).
    pub(crate) fn index(self, c: usize) -> usize {
        let (row, inner) = self.place(c % self.n_u, c / self.n_u);
        row * self.block() + inner
    }

    pub(crate) fn len(self) -> usize {
        self.n_rows() * (REACH + 1) * self.block() * self.block()
    }

    /// Returns the range of the block that couples row `row` to row `row - back`.
    pub(crate) fn range(self, row: usize, back: usize) -> std::ops::Range<usize> {
        let size = self.block() * self.block();
        let start = (row * (REACH + 1) + back) * size;
        start..start + size
    }
}

/// Lower Cholesky factor of a matrix that couples each row of a net with itself and the three previous rows, in the
/// same layout.
#[derive(Debug, Clone, PartialEq)]
pub struct BlockBandedFactor {
    pub(crate) layout: Layout,
    pub(crate) blocks: Vec<f64>,
}

impl BlockBandedFactor {
    /// Builds a factor from its blocks; `None` when their number does not fit the coefficients.
    #[must_use]
    pub fn from_blocks(n_u: usize, n_v: usize, blocks: Vec<f64>) -> Option<Self> {
        let layout = Layout { n_u, n_v };
        (blocks.len() == layout.len()).then_some(Self { layout, blocks })
    }

    /// Returns the blocks, to be stored or sent.
    #[must_use]
    pub fn blocks(&self) -> &[f64] {
        &self.blocks
    }

    /// Returns the variance `f' A^-1 f` of a linear functional with coefficients `f` in the net's order.
    #[must_use]
    pub fn variance(&self, f: &[f64]) -> f64 {
        let columns: Vec<[f64; 1]> = f.iter().map(|x| [*x]).collect();
        self.forward(&columns).iter().map(|[x]| x * x).sum()
    }

    /// Returns `L'^-1 Z` in the net's order, by backward substitution: columns of independent standard normal numbers
    /// become draws of coefficients with the covariance A^-1.
    #[must_use]
    pub fn draws<const D: usize>(&self, mut z: Vec<[f64; D]>) -> Vec<[f64; D]> {
        let (layout, m) = (self.layout, self.layout.block());
        for row in (0..layout.n_rows()).rev() {
            let (rest, known) = z.split_at_mut((row + 1) * m);
            let target = &mut rest[row * m..];
            for ahead in 1..=REACH.min(layout.n_rows() - 1 - row) {
                let block = &self.blocks[layout.range(row + ahead, ahead)];
                for (target, column) in target.iter_mut().zip(block.chunks_exact(m)) {
                    subtract_products(target, column, &known[(ahead - 1) * m..][..m]);
                }
            }
            let diagonal = &self.blocks[layout.range(row, 0)];
            for (c, column) in diagonal.chunks_exact(m).enumerate().rev() {
                let (target, solved) = target.split_at_mut(c + 1);
                subtract_products(&mut target[c], &column[c + 1..], solved);
                target[c] = target[c].map(|x| x / column[c]);
            }
        }
        (0..z.len()).map(|c| z[layout.index(c)]).collect()
    }

    /// Returns L^-1 B in block order, by forward substitution.
    pub(crate) fn forward<const D: usize>(&self, b: &[[f64; D]]) -> Vec<[f64; D]> {
        let (layout, m) = (self.layout, self.layout.block());
        let mut work = vec![[0.0; D]; b.len()];
        b.iter().enumerate().for_each(|(c, row)| work[layout.index(c)] = *row);
        for row in 0..layout.n_rows() {
            let (done, rest) = work.split_at_mut(row * m);
            let target = &mut rest[..m];
            for back in 1..=REACH.min(row) {
                let known = &done[(row - back) * m..][..m];
                let block = &self.blocks[layout.range(row, back)];
                block.chunks_exact(m).zip(known).for_each(|(column, x)| subtract(target, column, x));
            }
            let diagonal = &self.blocks[layout.range(row, 0)];
            for (c, column) in diagonal.chunks_exact(m).enumerate() {
                let solved = target[c].map(|x| x / column[c]);
                target[c] = solved;
                subtract(&mut target[c + 1..], &column[c + 1..], &solved);
            }
        }
        work
    }
}

/// Subtracts the products of a column and the components of `x`.
fn subtract<const D: usize>(target: &mut [[f64; D]], column: &[f64], x: &[f64; D]) {
    for (target, factor) in target.iter_mut().zip(column) {
        for d in 0..D {
            target[d] -= factor * x[d];
        }
    }
}

/// Subtracts the products of a column with each component of `x`.
fn subtract_products<const D: usize>(target: &mut [f64; D], column: &[f64], x: &[[f64; D]]) {
    for (factor, x) in column.iter().zip(x) {
        for d in 0..D {
            target[d] -= factor * x[d];
        }
    }
}
