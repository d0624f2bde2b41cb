//! Mask of the parts of the plate that were seen, as cells of the original rectangle.

/// Cells of the original rectangle, each marked if samples lie in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Mask {
    n_u: usize,
    n_v: usize,
    /// Cells per metre along u and along v.
    per_metre: [f64; 2],
    seen: Vec<bool>,
}

impl Mask {
    /// Builds a mask without any part seen, in cells of about `cell` metres.
    #[must_use]
    pub fn unseen(width: f64, height: f64, cell: f64) -> Self {
        let count = |length: f64| ((length / cell).ceil() as usize).clamp(1, 4096);
        let (n_u, n_v) = (count(width), count(height));
        Self::of(width, height, [n_u, n_v], vec![false; n_u * n_v])
    }

    /// Builds a mask from its cells, v outer, u inner; `None` when their number does not fit.
    #[must_use]
    pub fn from_cells(width: f64, height: f64, cells: [usize; 2], seen: Vec<bool>) -> Option<Self> {
        let [n_u, n_v] = cells;
        let fits = n_u > 0 && n_u.checked_mul(n_v) == Some(seen.len()) && !seen.is_empty();
        fits.then(|| Self::of(width, height, cells, seen))
    }

    fn of(width: f64, height: f64, [n_u, n_v]: [usize; 2], seen: Vec<bool>) -> Self {
        Self { n_u, n_v, per_metre: [n_u as f64 / width, n_v as f64 / height], seen }
    }

    /// Returns the number of cells along u and along v.
    #[must_use]
    pub fn cells(&self) -> [usize; 2] {
        [self.n_u, self.n_v]
    }

    /// Returns, per cell, whether it was seen; v outer, u inner.
    #[must_use]
    pub fn seen_cells(&self) -> &[bool] {
        &self.seen
    }

    /// Returns whether the cell around (u, v) was seen; places outside count for the nearest cell.
    #[must_use]
    pub fn seen(&self, u: f64, v: f64) -> bool {
        self.seen[self.index(u, v)]
    }

    /// Returns the share of the cells that were seen.
    #[must_use]
    pub fn coverage(&self) -> f64 {
        self.seen.iter().filter(|s| **s).count() as f64 / self.seen.len() as f64
    }

    /// Marks the cell around (u, v).
    pub fn mark(&mut self, u: f64, v: f64) {
        let index = self.index(u, v);
        self.seen[index] = true;
    }

    /// Marks the cells between two neighbouring samples.
    pub fn mark_between(&mut self, from: [f64; 2], to: [f64; 2]) {
        let cells = (0..2).map(|d| ((to[d] - from[d]) * self.per_metre[d]).abs()).fold(0.0, f64::max);
        if cells <= 0.5 {
            return;
        }
        let n = (2.0 * cells).ceil().min(256.0) as usize;
        for k in 1..n {
            let f = k as f64 / n as f64;
            self.mark(from[0] + f * (to[0] - from[0]), from[1] + f * (to[1] - from[1]));
        }
    }

    fn index(&self, u: f64, v: f64) -> usize {
        let cell = |x: f64, n: usize| (x.max(0.0) as usize).min(n - 1);
        cell(v * self.per_metre[1], self.n_v) * self.n_u + cell(u * self.per_metre[0], self.n_u)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hole_stays_unseen_and_its_surroundings_are_seen() {
        let mut mask = Mask::unseen(1.0, 0.5, 0.1);
        assert_eq!(mask.cells(), [10, 5]);
        mask.mark_between([0.05, 0.05], [0.35, 0.05]);
        mask.mark(0.95, 2.0);
        assert!(mask.seen(0.15, 0.05) && mask.seen(0.25, 0.09) && mask.seen(0.99, 0.49));
        assert!(!mask.seen(0.65, 0.05) && !mask.seen(0.15, 0.15));
        assert!((mask.coverage() - 5.0 / 50.0).abs() < 0.021);
    }
}
