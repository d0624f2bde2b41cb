//! Normals of a low-pass copy of the inverse range, by Taubin's filter (Masuda et al., 3.1).
//!
//! The filter takes diffusion steps with a positive and a slightly larger negative factor in turn. The inverse range is
//! filtered instead of the positions: samples then move along their beams only, and planes stay where they are. The
//! filtered copy serves the normals only.
//!
//! In: a window and the cells to use. Out: unit normals towards the scanner. Source: Taubin, "A signal processing
//! approach to fair surface design" (1995), reference 7 of Masuda et al.

use std::ops::Range;

use platen_numerics::simd::dispatch_simd;

use super::continuity::Continuity;
use super::window::Window;

/// Factors of the two half steps; their pass band ends at 1 / 0.5 - 1 / 0.53 = 0.11.
const FACTORS: [f32; 2] = [0.5, -0.53];

/// Number of pairs of half steps. Ten pairs reduce the noise of a slope to a quarter (flat, unit lattice).
const PAIRS: usize = 10;

/// Returns the inverse ranges, smoothed at the cells where `usable` is true; those of the other cells are left
/// unchanged.
pub(super) fn low_pass(window: &Window, usable: &[bool], continuity: &Continuity) -> Vec<f32> {
    let n_rows = window.n_rows;
    // The first and the last column are margin and stay as they are.
    let spans: Vec<(usize, Range<usize>)> =
        (1..window.n_columns - 1).map(|c| (c, window.spans[c].clone())).collect();
    let links = Links::of(window, usable, continuity, &spans);
    let mut copies = [window.inverse.clone(), window.inverse.clone()];
    // A half step of a column requires the previous half step of both neighbours. The half steps follow each other
    // through the columns, one column apart, so that the values required are still in the cache.
    dispatch_simd(
        #[inline(always)]
        || {
            for front in 0..spans.len() + 2 * PAIRS {
                for step in 0..(2 * PAIRS).min(front + 1) {
                    let Some((column, rows)) = spans.get(front - step) else { continue };
                    let [even, odd] = &mut copies;
                    let (from, to) = if step % 2 == 0 { (&*even, odd) } else { (&*odd, even) };
                    let cells = column * n_rows + rows.start..column * n_rows + rows.end;
                    links.diffuse(from, to, cells, n_rows, FACTORS[step % 2]);
                }
            }
        },
    );
    let [smooth, _] = copies;
    smooth
}

/// Weights of the links to the cell below and to the cell in the next column, and one over the sum of a cell's weights.
struct Links {
    down: Vec<f32>,
    across: Vec<f32>,
    per_link: Vec<f32>,
}

impl Links {
    /// Determines the links of the usable cells of `columns`, given with their rows.
    fn of(
        window: &Window,
        usable: &[bool],
        continuity: &Continuity,
        columns: &[(usize, Range<usize>)],
    ) -> Self {
        let (n, n_rows) = (window.cells.len(), window.n_rows);
        // A range of 0 is joined to no other.
        let mut ranges = vec![0.0_f32; n];
        for (column, rows) in columns {
            let cells = column * n_rows + rows.start..column * n_rows + rows.end;
            let of_cells = window.cells[cells.clone()].iter().zip(&usable[cells.clone()]);
            let of_cells = of_cells.map(|(cell, usable)| if *usable { cell.range_m } else { 0.0 });
            ranges[cells].iter_mut().zip(of_cells).for_each(|(range, of_cell)| *range = of_cell);
        }
        let (mut down, mut across) = (vec![0.0_f32; n], vec![0.0_f32; n]);
        let known = |i: usize| Some(ranges[i]).filter(|range| *range > 0.0);
        for (column, rows) in columns {
            let first = column * n_rows;
            let cells = first + rows.start..first + rows.end;
            let links = &continuity.across[window.first_row as usize + rows.start..];
            let pairs = ranges[cells.clone()].iter().zip(&ranges[cells.start + n_rows..]);
            for ((across, (a, b)), link) in across[cells.clone()].iter_mut().zip(pairs).zip(links) {
                *across = link.joins(*a, *b).into();
            }
            let last = first + n_rows - 1;
            for (i, down) in (cells.start..).zip(&mut down[cells.start..cells.end.min(last)]) {
                if let (Some(here), Some(below)) = (known(i), known(i + 1)) {
                    let before = || if i > first { known(i - 1) } else { None };
                    let beyond = || [before(), if i + 1 < last { known(i + 2) } else { None }];
                    *down = continuity.joins_down([here, below], beyond).into();
                }
            }
        }
        let mut per_link = vec![1.0_f32; n];
        for (column, rows) in columns {
            let cells = column * n_rows + rows.start..column * n_rows + rows.end;
            let start = cells.start;
            let of_cell = down[start..].iter().zip(&across[start..]);
            let of_others = down[start - 1..].iter().zip(&across[start - n_rows..]);
            for ((per_link, a), b) in per_link[cells].iter_mut().zip(of_cell).zip(of_others) {
                *per_link = 1.0 / (a.0 + a.1 + b.0 + b.1).max(1.0);
            }
        }
        Self { down, across, per_link }
    }

    /// Performs one half step on some cells of a column.
    #[inline(always)]
    fn diffuse(&self, from: &[f32], to: &mut [f32], cells: Range<usize>, n_rows: usize, factor: f32) {
        let (start, len) = (cells.start, cells.len());
        let (here, below, above) =
            (&from[start..][..len], &from[start + 1..][..len], &from[start - 1..][..len]);
        let (next, previous) = (&from[start + n_rows..][..len], &from[start - n_rows..][..len]);
        let (w_below, w_above) = (&self.down[start..][..len], &self.down[start - 1..][..len]);
        let (w_next, w_previous) = (&self.across[start..][..len], &self.across[start - n_rows..][..len]);
        let (per_link, to) = (&self.per_link[start..][..len], &mut to[start..][..len]);
        for i in 0..len {
            let q = here[i];
            let sum = w_below[i] * (below[i] - q)
                + w_above[i] * (above[i] - q)
                + w_next[i] * (next[i] - q)
                + w_previous[i] * (previous[i] - q);
            to[i] = q + factor * per_link[i] * sum;
        }
    }
}

/// Noise of the range, in parts of the spacing of samples, for which a slope is taken over one more cell; and the
/// largest number of cells.
const NOISE_PER_CELL: f32 = 0.1;
const MOST_CELLS: usize = 4;

/// Returns the number of cells on each side over which slopes are taken, such that noise turns normals by a few degrees
/// at most.
pub(super) fn slope_reach(window: &Window, noise: f32) -> usize {
    let (sum, n) = window
        .inverse
        .iter()
        .zip(&window.own)
        .filter(|(_, own)| **own)
        .fold((0.0, 0), |(s, n), (q, _)| (s + q, n + 1));
    let spacing = (window.header.azimuth_step * window.header.elevation_step).sqrt() as f32;
    let noise_in_spacings = noise * sum / (n.max(1) as f32 * spacing);
    ((noise_in_spacings / NOISE_PER_CELL).ceil() as usize).clamp(1, MOST_CELLS)
}

/// A unit normal, zero where there is none.
pub(super) type Normal = [f32; 3];

/// Returns the cosine of the angle between two normals; `None` where one is missing.
#[inline]
pub(super) fn cos_between(a: &Normal, b: &Normal) -> Option<f32> {
    let both = *a != Normal::default() && *b != Normal::default();
    both.then(|| a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
}

/// Returns unit normals towards the scanner, zero where a cell is not usable or has no neighbour. Slopes are taken over
/// `reach` cells on each side, where there are as many.
pub(super) fn normals(window: &Window, smooth: &[f32], usable: &[bool], reach: usize) -> Vec<Normal> {
    let n_rows = window.n_rows;
    let (per_azimuth, per_elevation) =
        (1.0 / window.header.azimuth_step, -1.0 / window.header.elevation_step);
    let mut normals = vec![Normal::default(); smooth.len()];
    for (column, rows) in window.inner_spans(reach) {
        for row in rows {
            let index = column * n_rows + row;
            if !usable[index] {
                continue;
            }
            let slope = |stride: usize| slope(smooth, usable, index, stride, reach);
            let (Some(q_down), Some(q_next)) = (slope(1), slope(n_rows)) else { continue };
            let normal = window.nominal(column, row).normal(
                f64::from(smooth[index]),
                per_azimuth * f64::from(q_next),
                per_elevation * f64::from(q_down),
            );
            normals[index] = normal.map_or(Normal::default(), |n| <[f64; 3]>::from(n).map(|x| x as f32));
        }
    }
    normals
}

/// Returns the difference per cell between the farthest usable neighbours within `reach`.
#[inline]
fn slope(values: &[f32], usable: &[bool], index: usize, stride: usize, reach: usize) -> Option<f32> {
    let behind = (1..=reach).rev().find(|k| usable[index + k * stride]).unwrap_or(0);
    let before = (1..=reach).rev().find(|k| usable[index - k * stride]).unwrap_or(0);
    let apart = behind + before;
    (apart > 0).then(|| (values[index + behind * stride] - values[index - before * stride]) / apart as f32)
}
