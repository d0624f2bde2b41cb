//! A low-pass copy of the inverse range and the normals it gives.
//!
//! Taubin's filter (A signal processing approach to fair surface design, 1995; reference 7 of the paper): steps
//! of diffusion with a positive and a slightly larger negative factor in turn. Filtering the inverse range and
//! not the positions moves samples along their beams only and leaves planes where they are. The copy serves the
//! normals and nothing else.

use super::continuity::Continuity;
use super::window::Window;

/// Factors of the two half steps; their pass band ends at 1 / 0.5 - 1 / 0.53 = 0.11.
const FACTORS: [f32; 2] = [0.5, -0.53];

/// Pairs of half steps. Ten bring the noise of a slope down to a quarter (flat, unit lattice).
const PAIRS: usize = 10;

/// Smoothed inverse ranges of the cells where `usable` holds; those of the others are left as they are.
pub(super) fn low_pass(window: &Window, usable: &[bool], continuity: &Continuity) -> Vec<f32> {
    let n_rows = window.n_rows;
    let n = window.cells.len();
    // Weight of the link to the cell below, and to the cell in the next column.
    let mut down = vec![0.0_f32; n];
    let mut across = vec![0.0_f32; n];
    for index in 0..n - n_rows {
        if !usable[index] {
            continue;
        }
        let row = index % n_rows;
        let range = |i: usize| window.cells[i].range_m;
        let known = |i: Option<usize>| i.filter(|i| usable[*i]).map(range);
        let below = |k: usize| known((row + k < n_rows).then_some(index + k));
        if continuity.joins_down([known((row > 0).then(|| index - 1)), below(0), below(1), below(2)]) {
            down[index] = 1.0;
        }
        let link = continuity.across[window.first_row as usize + row];
        if usable[index + n_rows] && link.joins(range(index), range(index + n_rows)) {
            across[index] = 1.0;
        }
    }
    let per_link: Vec<f32> = (0..n)
        .map(|i| {
            let up = if i > 0 { down[i - 1] } else { 0.0 };
            let back = if i >= n_rows { across[i - n_rows] } else { 0.0 };
            1.0 / (down[i] + across[i] + up + back).max(1.0)
        })
        .collect();
    let mut from = window.inverse.clone();
    let mut to = from.clone();
    for factor in std::iter::repeat_n(FACTORS, PAIRS).flatten() {
        diffuse(&from, &mut to, &down, &across, &per_link, n_rows, factor);
        std::mem::swap(&mut from, &mut to);
    }
    from
}

/// One half step. The first and the last column of a window are margin and stay as they are.
fn diffuse(
    from: &[f32],
    to: &mut [f32],
    down: &[f32],
    across: &[f32],
    per_link: &[f32],
    n_rows: usize,
    factor: f32,
) {
    let n = from.len();
    let span = n_rows..n - n_rows;
    let len = span.len();
    let (here, below, above) = (&from[span.clone()], &from[n_rows + 1..][..len], &from[n_rows - 1..][..len]);
    let (next, previous) = (&from[2 * n_rows..][..len], &from[..len]);
    let (w_below, w_above) = (&down[span.clone()], &down[n_rows - 1..][..len]);
    let (w_next, w_previous) = (&across[span.clone()], &across[..len]);
    let (per_link, to) = (&per_link[span.clone()], &mut to[span]);
    for i in 0..len {
        let q = here[i];
        let sum = w_below[i] * (below[i] - q)
            + w_above[i] * (above[i] - q)
            + w_next[i] * (next[i] - q)
            + w_previous[i] * (previous[i] - q);
        to[i] = q + factor * per_link[i] * sum;
    }
}

/// Noise of the range in parts of the spacing of samples from which slopes are taken over more cells; and most cells.
const NOISE_PER_CELL: f32 = 0.1;
const MOST_CELLS: usize = 4;

/// Cells on each side over which slopes are taken, so that noise turns normals by a few degrees at most.
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

/// Unit normals towards the scanner, zero where a cell is not usable or has no neighbour. Slopes are taken over
/// `reach` cells on each side, where there are as many.
pub(super) fn normals(
    window: &Window,
    smooth: &[f32],
    usable: &[bool],
    reach: usize,
) -> Vec<nalgebra::Vector3<f32>> {
    let n_rows = window.n_rows;
    let (per_azimuth, per_elevation) =
        (1.0 / window.header.azimuth_step, -1.0 / window.header.elevation_step);
    let mut normals = vec![nalgebra::Vector3::zeros(); smooth.len()];
    for column in reach..window.n_columns.saturating_sub(reach) {
        for row in reach..n_rows.saturating_sub(reach) {
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
            normals[index] = normal.unwrap_or_default().cast();
        }
    }
    normals
}

/// Difference per cell between the farthest usable neighbours within `reach`.
#[inline]
fn slope(values: &[f32], usable: &[bool], index: usize, stride: usize, reach: usize) -> Option<f32> {
    let behind = (1..=reach).rev().find(|k| usable[index + k * stride]).unwrap_or(0);
    let before = (1..=reach).rev().find(|k| usable[index - k * stride]).unwrap_or(0);
    let apart = behind + before;
    (apart > 0).then(|| (values[index + behind * stride] - values[index - before * stride]) / apart as f32)
}
