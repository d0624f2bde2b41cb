//! Connected components of the lattice under the continuity criterion, joined while columns arrive (Masuda et al.,
//! 3.1).
//!
//! A column is divided into *runs* of cells that are continuous downwards. Runs of neighbouring columns are joined when
//! any of their cells are continuous across. Components are sets of runs. All sums over a component are integers, so
//! that neither the sums nor the components depend on the order of arrival.

use std::ops::Range;

use platen_numerics::union_find::UnionFind;

use crate::extract::continuity::Link;

/// Consecutive cells of one column, each continuous with the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::extract) struct Run {
    pub(in crate::extract) column: u32,
    pub(in crate::extract) first_row: u32,
    /// One past the last row.
    pub(in crate::extract) end_row: u32,
}

/// Size and bounds of a component.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::extract) struct Extent {
    /// Area across the beams, a lower bound of the surface's area, square millimetres.
    pub(in crate::extract) area_mm2: u64,
    pub(in crate::extract) cells: u64,
    pub(in crate::extract) columns: (u32, u32),
    pub(in crate::extract) rows: (u32, u32),
}

impl Extent {
    fn merge(&mut self, other: Self) {
        self.area_mm2 += other.area_mm2;
        self.cells += other.cells;
        self.columns = (self.columns.0.min(other.columns.0), self.columns.1.max(other.columns.1));
        self.rows = (self.rows.0.min(other.rows.0), self.rows.1.max(other.rows.1));
    }
}

/// Runs of cells and the components that they form.
#[derive(Debug, Clone, Default)]
pub(in crate::extract) struct Components {
    runs: Vec<Run>,
    sets: UnionFind,
    extent: Vec<Extent>,
}

impl Components {
    /// Adds a run as a component of its own and returns its number.
    pub(in crate::extract) fn add(&mut self, run: Run, area_mm2: u64) -> u32 {
        self.runs.push(run);
        self.extent.push(Extent {
            area_mm2,
            cells: u64::from(run.end_row - run.first_row),
            columns: (run.column, run.column),
            rows: (run.first_row, run.end_row - 1),
        });
        self.sets.push()
    }

    pub(in crate::extract) fn run(&self, number: u32) -> Run {
        self.runs[number as usize]
    }

    pub(in crate::extract) fn n_runs(&self) -> u32 {
        self.runs.len() as u32
    }

    /// Returns the members of `runs` that belong to components given by their roots.
    pub(in crate::extract) fn runs_of(&mut self, roots: &[u32], runs: Range<u32>) -> Vec<Run> {
        let mut own = Vec::new();
        for number in runs {
            if roots.contains(&self.root(number)) {
                own.push(self.run(number));
            }
        }
        own
    }

    /// Returns the component of a run, as the number of its root.
    pub(in crate::extract) fn root(&mut self, number: u32) -> u32 {
        self.sets.find(number)
    }

    pub(in crate::extract) fn extent(&self, root: u32) -> Extent {
        self.extent[root as usize]
    }

    /// Returns the extent of several components together.
    pub(in crate::extract) fn extent_of_all(&self, roots: &[u32]) -> Extent {
        let none = Extent { area_mm2: 0, cells: 0, columns: (u32::MAX, 0), rows: (u32::MAX, 0) };
        roots.iter().fold(none, |mut all, &root| {
            all.merge(self.extent(root));
            all
        })
    }

    fn join(&mut self, a: u32, b: u32) {
        if let Some((root, joined)) = self.sets.union(a, b) {
            let joined = self.extent[joined as usize];
            self.extent[root as usize].merge(joined);
        }
    }

    /// Joins the runs of a column and of the next one where their cells are continuous by `across`.
    ///
    /// `range_a(row)` and `range_b(row)` give ranges inside the runs. Overlapping runs are joined at the first row that
    /// links them; the rest of the overlap is skipped.
    pub(in crate::extract) fn join_columns(
        &mut self,
        a: Range<u32>,
        b: Range<u32>,
        across: &[Link],
        range_a: impl Fn(u32) -> f32,
        range_b: impl Fn(u32) -> f32,
    ) {
        let (mut i, mut j) = (a.start, b.start);
        while i < a.end && j < b.end {
            let (left, right) = (self.run(i), self.run(j));
            let overlap = left.first_row.max(right.first_row)..left.end_row.min(right.end_row);
            if overlap.clone().any(|row| across[row as usize].joins(range_a(row), range_b(row))) {
                self.join(i, j);
            }
            if left.end_row <= right.end_row {
                i += 1;
            } else {
                j += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_do_not_depend_on_the_order_of_joins() {
        let build = |order: &[(u32, u32)]| {
            let mut regions = Components::default();
            for column in 0..5 {
                regions.add(Run { column, first_row: column, end_row: column + 2 }, 10 + u64::from(column));
            }
            for &(a, b) in order {
                regions.join(a, b);
            }
            let roots: Vec<_> = (0..5).map(|n| regions.root(n)).collect();
            roots.into_iter().map(|root| regions.extent(root)).collect::<Vec<_>>()
        };
        let one = build(&[(0, 1), (1, 2), (3, 4)]);
        assert_eq!(one, build(&[(3, 4), (0, 2), (2, 1)]));
        assert_eq!(one[0], Extent { area_mm2: 33, cells: 6, columns: (0, 2), rows: (0, 3) });
        assert_ne!(one[0], one[3]);
    }
}
