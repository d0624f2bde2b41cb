//! Longest boundary loop of the mesh of lattice neighbours, by shortest paths (Masuda et al., 3.2).
//!
//! In: the cells of the face. Out: the loop as a cycle of cells, in whole lattice steps; later modules locate the edge
//! between the cells. Gaps caused by an object in front of the plate are filled first, so that a chain does not cut the
//! plate in two.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap};

use crate::extract::{Beyond, Patch, Sample};

/// A cell of the grid, by its index.
type Cell = u32;

/// Length of a side and of a diagonal of a lattice square, in fifths: close to 1 : sqrt 2 and exact.
const SIDE: u32 = 5;
const DIAGONAL: u32 = 7;

/// A lattice square with all four cells.
const ALL: u8 = 0b1111;

/// The cells of the face in their bounding rectangle, with one empty column and row around them, at the index `column *
/// n_rows + row`. Hidden cells and cells without a return belong to the face when they lie between two cells of it;
/// holes in the plate do not.
#[derive(Debug, Clone)]
pub(super) struct Grid {
    n_rows: usize,
    /// Number of the sample plus one; 0 where there is none.
    sample: Vec<u32>,
    inside: Vec<bool>,
}

impl Grid {
    pub(super) fn of(patch: &Patch) -> Self {
        let ends = [patch.samples.first(), patch.samples.last()];
        let [first_column, last_column] = ends.map(|sample| sample.map_or(0, |s| s.column));
        let rows = patch.samples.iter().map(|s| s.row);
        let (first_row, last_row) =
            rows.fold((u32::MAX, 0), |(low, high), row| (low.min(row), high.max(row)));
        let n_columns = (last_column - first_column) as usize + 3;
        let n_rows = last_row.saturating_sub(first_row) as usize + 3;
        let n = n_columns * n_rows;
        let mut grid = Self { n_rows, sample: vec![0; n], inside: vec![false; n] };
        let cell = |sample: &Sample| {
            let (column, row) = (sample.column - first_column + 1, sample.row - first_row + 1);
            column as usize * n_rows + row as usize
        };
        for (number, sample) in (1..).zip(&patch.samples) {
            grid.sample[cell(sample)] = number;
            grid.inside[cell(sample)] = true;
        }
        grid.fill_hidden(patch, cell);
        grid
    }

    /// Maps samples on a loop or next to it to their place on the loop. Neighbours are included since a single
    /// protruding cell belongs to no triangle, hence to no loop.
    pub(super) fn places(&self, cells: &[Cell]) -> BTreeMap<u32, u32> {
        let n_rows = self.n_rows as isize;
        let beside = [-n_rows - 1, -n_rows, -n_rows + 1, -1, 1, n_rows - 1, n_rows, n_rows + 1];
        let sample = |cell: isize| {
            let number = usize::try_from(cell).ok().and_then(|cell| self.sample.get(cell));
            number.and_then(|number| number.checked_sub(1))
        };
        let around = |offsets: &[isize]| {
            let places = (0..).zip(cells).flat_map(|(place, &cell)| {
                offsets.iter().filter_map(move |by| Some((sample(cell as isize + by)?, place)))
            });
            places.collect::<Vec<(u32, u32)>>()
        };
        // A cell on the loop overrides one next to it.
        around(&beside).into_iter().chain(around(&[0])).collect()
    }

    /// Fills gaps along columns and rows, unless the plate visibly ends at one side of the gap.
    fn fill_hidden(&mut self, patch: &Patch, cell: impl Fn(&Sample) -> usize) {
        let mut ends: Vec<[bool; 4]> = vec![[false; 4]; patch.samples.len()];
        for crossing in patch.crossings.iter().filter(|c| c.beyond != Beyond::InFront) {
            ends[crossing.sample as usize][side(crossing.step)] = true;
        }
        let goes_on = |from: u32, to: u32, step: [i8; 2]| {
            let ends = |number: u32, step: [i8; 2]| ends[number as usize - 1][side(step)];
            !ends(from, step) && !ends(to, step.map(|s| -s))
        };
        // The last cell with a sample on this column and on each row; the border has none.
        let mut on_row = vec![0; self.n_rows];
        for samples in patch.samples.chunk_by(|a, b| a.column == b.column) {
            let mut on_column = 0;
            for cell in samples.iter().map(&cell) {
                let on_row = &mut on_row[cell % self.n_rows];
                for (last, stride, step) in [(on_column, 1, [0, 1]), (*on_row, self.n_rows, [1, 0])] {
                    if last != 0
                        && cell - last > stride
                        && goes_on(self.sample[last], self.sample[cell], step)
                    {
                        (last + stride..cell).step_by(stride).for_each(|gap| self.inside[gap] = true);
                    }
                }
                (on_column, *on_row) = (cell, cell);
            }
        }
    }

    /// Returns the lattice squares, each at the index of its corner of least column and row, with its four cells as
    /// bits in the order: that corner, below, next column below, next column. A square with fewer than three cells
    /// inside is 0: no triangle covers it.
    fn squares(&self) -> Vec<u8> {
        let (inside, n_rows) = (&self.inside, self.n_rows);
        let (below, next_below, next) = (&inside[1..], &inside[n_rows + 1..], &inside[n_rows..]);
        let corners = inside.iter().zip(below).zip(next_below.iter().zip(next));
        let bits = corners
            .map(|((a, b), (c, d))| u8::from(*a) | u8::from(*b) << 1 | u8::from(*c) << 2 | u8::from(*d) << 3);
        bits.map(|bits| if bits.count_ones() >= 3 { bits } else { 0 }).collect()
    }

    /// Returns the edges that belong to one triangle of the mesh only. Each lattice square with all four cells gives
    /// two triangles, one with three cells gives one.
    fn boundary_edges(&self) -> Vec<(Cell, Cell)> {
        let (n_rows, squares) = (self.n_rows, self.squares());
        let mut edges = Vec::new();
        let mut add = |a: usize, b: usize| edges.push((a.min(b) as Cell, a.max(b) as Cell));
        for (at, &here) in squares.iter().enumerate().skip(n_rows) {
            let (before, above) = (squares[at - n_rows], squares[at - 1]);
            if here == before && here == above && (here == 0 || here == ALL) {
                continue;
            }
            // The edges down and across from `at`, each shared with the square before it.
            let has = |square: u8, edge: u8| square & edge == edge;
            if has(here, 0b0011) != has(before, 0b1100) {
                add(at, at + 1);
            }
            if has(here, 0b1001) != has(above, 0b0110) {
                add(at, at + n_rows);
            }
            if here != 0 && here != ALL {
                let missing = here.trailing_ones() as usize;
                let square = [at, at + 1, at + n_rows + 1, at + n_rows];
                add(square[(missing + 1) % 4], square[(missing + 3) % 4]);
            }
        }
        edges
    }

    /// Returns the first boundary loop of at least `enough` lattice steps, else the longest one.
    ///
    /// As Masuda et al., 3.2: the shortest path along the boundary from one end of a boundary edge to the other closes
    /// a loop; repeated for edges that are on no loop yet.
    pub(super) fn longest_loop(&self, enough: f64) -> Vec<Cell> {
        let edges = self.boundary_edges();
        let mut neighbours: BTreeMap<Cell, Vec<(Cell, u32)>> = BTreeMap::new();
        for &(a, b) in &edges {
            let weight = if self.is_diagonal(a, b) { DIAGONAL } else { SIDE };
            neighbours.entry(a).or_default().push((b, weight));
            neighbours.entry(b).or_default().push((a, weight));
        }
        let mut used = BTreeSet::new();
        let (mut best, mut best_length) = (Vec::new(), 0);
        for &(a, b) in &edges {
            if used.contains(&(a, b)) {
                continue;
            }
            let Some((length, way)) = shortest_path(&neighbours, a, b) else { continue };
            for pair in way.windows(2) {
                used.insert((pair[0].min(pair[1]), pair[0].max(pair[1])));
            }
            if length > best_length {
                (best, best_length) = (way, length);
            }
            if f64::from(best_length) >= enough * f64::from(SIDE) {
                break;
            }
        }
        best
    }

    fn is_diagonal(&self, a: Cell, b: Cell) -> bool {
        let apart = a.abs_diff(b) as usize;
        apart != 1 && apart != self.n_rows
    }
}

fn side(step: [i8; 2]) -> usize {
    match step {
        [0, -1] => 0,
        [0, _] => 1,
        [-1, _] => 2,
        _ => 3,
    }
}

/// Returns the shortest path (Dijkstra) from `a` to `b` that does not use the edge between them.
fn shortest_path(
    neighbours: &BTreeMap<Cell, Vec<(Cell, u32)>>,
    a: Cell,
    b: Cell,
) -> Option<(u32, Vec<Cell>)> {
    let mut reached: BTreeMap<Cell, (u32, Cell)> = BTreeMap::from([(a, (0, a))]);
    let mut front = BinaryHeap::from([Reverse((0, a))]);
    while let Some(Reverse((length, at))) = front.pop() {
        if at == b {
            let mut way = vec![b];
            let mut here = b;
            while here != a {
                here = reached[&here].1;
                way.push(here);
            }
            return Some((length, way));
        }
        if length > reached[&at].0 {
            continue;
        }
        for &(next, weight) in &neighbours[&at] {
            if (at, next) == (a, b) {
                continue;
            }
            let longer = length + weight;
            if reached.get(&next).is_none_or(|(known, _)| longer < *known) {
                reached.insert(next, (longer, at));
                front.push(Reverse((longer, next)));
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;
    use crate::extract::{Crossing, PlaneSet};

    fn patch(cells: impl Iterator<Item = (u32, u32)>) -> Patch {
        let sample = |(column, row)| Sample { point: Vec3::zeros(), column, row, sigma: 1e-3, intensity: 0 };
        Patch { samples: cells.map(sample).collect(), ..Patch::default() }
    }

    #[test]
    fn the_loop_runs_around_dropouts_and_along_the_rim() {
        let mut seed = platen_numerics::random::Random::new(7);
        let cells = (0..40).flat_map(|c| (0..30).map(move |r| (c, r)));
        let patch =
            patch(cells.filter(|&(c, r)| seed.unit() > 0.1 || c == 0 || r == 0 || c == 39 || r == 29));
        let grid = Grid::of(&patch);
        assert_eq!(grid.longest_loop(1000.0).len(), 2 * (39 + 29));
    }

    #[test]
    fn a_hole_in_the_plate_stays_and_a_hidden_strip_is_bridged() {
        let hole = |c: u32, r: u32| (10..14).contains(&c) && (10..14).contains(&r);
        let strip = |c: u32| (20..24).contains(&c);
        let cells = (0..40_u32).flat_map(|c| (0..30).map(move |r| (c, r)));
        let mut patch = patch(cells.filter(|&(c, r)| !hole(c, r) && !strip(c)));
        let samples = patch.samples.clone();
        for (number, s) in (0..).zip(&samples) {
            for step in [[0_i8, 1_i8], [0, -1], [1, 0], [-1, 0]] {
                let (c, r) =
                    (s.column.wrapping_add_signed(step[0].into()), s.row.wrapping_add_signed(step[1].into()));
                let beyond = if strip(c) {
                    Beyond::InFront
                } else if hole(c, r) || c > 39 || r > 29 {
                    Beyond::Behind
                } else {
                    continue;
                };
                let zero = Vec3::zeros();
                let crossing = Crossing {
                    sample: number,
                    step,
                    inside: zero,
                    outside: zero,
                    normal: zero,
                    cells: 1,
                    mixed: None,
                    complete: true,
                    surely_mixed: None,
                    strips: PlaneSet::default(),
                    excess: 0.0,
                    noise: [0.0; 2],
                    background: None,
                    beyond,
                };
                patch.crossings.push(crossing);
            }
        }
        let grid = Grid::of(&patch);
        assert_eq!(grid.longest_loop(f64::MAX).len(), 2 * (39 + 29));
        let at = |c: usize, r: usize| (c + 1) * grid.n_rows + r + 1;
        assert!(grid.inside[at(22, 15)] && !grid.inside[at(12, 12)]);
    }
}
