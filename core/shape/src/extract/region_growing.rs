//! Cells of the selected face, by erosion and region growing on the raw ranges.
//!
//! Normals of the low-pass copy separate faces but do not locate their ends: the normals turn over a few cells, and
//! where a side face is only a few cells wide the region extends onto it. The region is therefore eroded first, then
//! grown cell by cell as far as the raw ranges continue the surface (`local_quadric`).
//!
//! In: the region found by the normals. Out: the face, as a mask over the cells of the window. Own; Masuda et al. keep
//! the region of the normals.

use std::collections::{BTreeMap, VecDeque};

use super::connected_components::{NO_LABEL, label_components};
use super::local_quadric::LocalQuadric;
use super::range_noise::Noise;
use super::smoothed_normals::{Normal, cos_between};
use super::window::Window;

/// Number of cells by which the region is eroded beyond the reach of slopes: half of the widest bridge to a side face.
const WEAR: usize = 1;

/// Largest residual of a cell of the face, in standard deviations of its prediction.
const RESIDUAL_BOUND: f64 = 4.0;

/// Number of last rings that are left out of the fit used to test a cell.
const UNTRUSTED_RINGS: usize = 1;

/// Cosine of 72 degrees: a cell whose normal in the low-pass copy differs by more belongs to a side face, whatever its
/// range.
const COS_OTHER_FACE: f32 = 0.3;

/// Upper limit of the leverage (variance of a prediction in units of that of a sample) in the bound of a residual.
const MOST_LEVERAGE: f64 = 0.5;

/// Erodes `region` and returns its largest connected component: the core of the face. `slope_reach` is that of the
/// normals by which the region was found.
pub(super) fn erode(window: &Window, region: &[bool], slope_reach: usize) -> Vec<bool> {
    let near_edge = widen(&obstacles(window, region), window.n_rows, slope_reach + WEAR);
    let core: Vec<bool> = region.iter().zip(&near_edge).map(|(region, near)| *region && !*near).collect();
    largest_component(&core, window.n_rows)
}

/// Marks the valid cells outside of the region, except specks inside of it.
fn obstacles(window: &Window, region: &[bool]) -> Vec<bool> {
    let n_rows = window.n_rows;
    let is_speck = |index: usize| {
        let (column, row) = (index / n_rows, index % n_rows);
        if column < 2 || row < 2 || column + 2 >= window.n_columns || row + 2 >= n_rows {
            return false;
        }
        let around = (column - 2..=column + 2).flat_map(|c| (row - 2..=row + 2).map(move |r| c * n_rows + r));
        // Beside a straight edge 10 of the 25 cells are in the region, in a notch of a right angle 16.
        around.filter(|&i| region[i]).count() > 16
    };
    (0..region.len()).map(|i| window.cells[i].valid && !region[i] && !is_speck(i)).collect()
}

/// Sets all cells within `by` rows and columns of a cell that is set.
fn widen(mask: &[bool], n_rows: usize, by: usize) -> Vec<bool> {
    let along = |mask: &[bool], stride: usize| {
        let mut wide = mask.to_vec();
        for k in 1..=by {
            let shift = k * stride;
            let shift = shift.min(mask.len());
            wide[shift..].iter_mut().zip(mask).for_each(|(wide, set)| *wide |= *set);
            wide.iter_mut().zip(&mask[shift..]).for_each(|(wide, set)| *wide |= *set);
        }
        wide
    };
    along(&along(mask, 1), n_rows)
}

fn largest_component(mask: &[bool], n_rows: usize) -> Vec<bool> {
    let (label, n) = label_components(mask, n_rows);
    let mut sizes = vec![0_usize; n];
    label.iter().filter(|label| **label != NO_LABEL).for_each(|label| sizes[*label as usize] += 1);
    // Of components of equal size the first.
    let largest = (0..n as u32).rev().max_by_key(|label| sizes[*label as usize]);
    label.iter().map(|label| Some(*label) == largest).collect()
}

/// Returns the four neighbours of a cell, as far as they exist. Windows have margins, so columns do not run into each
/// other.
fn neighbours(at: usize, n_rows: usize, n: usize) -> impl Iterator<Item = usize> {
    [at.checked_sub(n_rows), at.checked_sub(1), Some(at + 1), Some(at + n_rows)]
        .into_iter()
        .flatten()
        .filter(move |i| *i < n)
}

/// Grows `core`, ring by ring, over all neighbouring cells whose ranges continue it within the noise.
///
/// - A cell is tested when it first touches the face, by a quadratic fit to the face around it. A cell rejected by a
///   fit of high leverage is tested again when it touches the face elsewhere.
/// - The last rings are left out of the fit: a side face whose first cells lie within the noise must not bend it.
/// - A cell whose normal is that of another face than the cell of the core from which it was reached is rejected.
pub(super) fn grow(window: &Window, noise: &Noise, normals: &[Normal], core: Vec<bool>) -> Vec<bool> {
    let n_rows = window.n_rows;
    let mut rings: VecDeque<Vec<usize>> = VecDeque::new();
    let mut origin: Vec<u32> = (0..core.len() as u32).collect();
    let mut trusted = core.clone();
    let mut judged = core.clone();
    let mut face = core;
    let at_rim = |i: &usize| face[*i] && neighbours(*i, n_rows, face.len()).any(|next| !face[next]);
    let mut ring: Vec<usize> = (0..face.len()).filter(at_rim).collect();
    while !ring.is_empty() {
        let mut by_tile: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
        for (at, next) in
            ring.iter().flat_map(|&at| neighbours(at, n_rows, face.len()).map(move |next| (at, next)))
        {
            if !judged[next] {
                judged[next] = true;
                origin[next] = origin[at];
                let other_face = is_other_face(normals, next, origin[at] as usize);
                if window.cells[next].valid && window.cells[next].inside && !other_face {
                    by_tile.entry(LocalQuadric::tile(window, next)).or_default().push(next);
                }
            }
        }
        ring.clear();
        for (tile, cells) in &by_tile {
            if let Some(fit) = LocalQuadric::fit(window, noise, &trusted, *tile) {
                let judgement = judge(window, noise, &fit, cells);
                ring.extend(judgement.continuing);
                judgement.open.into_iter().for_each(|cell| judged[cell] = false);
            }
        }
        for &cell in &ring {
            face[cell] = true;
        }
        rings.push_back(ring.clone());
        if rings.len() > UNTRUSTED_RINGS {
            for cell in rings.pop_front().into_iter().flatten() {
                trusted[cell] = true;
            }
        }
    }
    face
}

/// Returns true when a cell has the normal of another face than a cell of the core; cells beyond the component have no
/// normal.
fn is_other_face(normals: &[Normal], cell: usize, core: usize) -> bool {
    cos_between(&normals[cell], &normals[core]).is_some_and(|cos| cos < COS_OTHER_FACE)
}

/// Result of testing cells against a fit.
struct Judgement {
    /// Cells that continue the face.
    continuing: Vec<usize>,
    /// Cells rejected where the prediction itself is uncertain; they are tested again.
    open: Vec<usize>,
}

/// Tests which cells continue a fit: each within its own noise, and their mean within the noise of the mean. Single
/// cells in the first row of a side face may be within the noise, the row as a whole is not.
fn judge(window: &Window, noise: &Noise, fit: &LocalQuadric, cells: &[usize]) -> Judgement {
    let residuals = cells.iter().filter_map(|&cell| {
        let (x, y) = window.place_of(cell);
        let predicted = fit.at(window, x, y)?;
        let sigma = f64::from(noise.at(cell));
        let residual = (f64::from(window.cells[cell].range_m) - predicted.range) / sigma;
        Some((cell, residual, fit.leverage(&predicted).min(MOST_LEVERAGE)))
    });
    let (within, outside): (Vec<_>, Vec<_>) =
        residuals.partition(|(_, residual, known)| residual.abs() <= RESIDUAL_BOUND * (1.0 + known).sqrt());
    let n = within.len() as f64;
    let mean = within.iter().map(|(_, residual, _)| residual).sum::<f64>() / n;
    let known = within.iter().map(|(_, _, known)| known).sum::<f64>() / n;
    let (continuing, refused) = if mean.abs() > RESIDUAL_BOUND * (1.0 / n + known).sqrt() {
        (Vec::new(), [within, outside].concat())
    } else {
        (within, outside)
    };
    let open = refused.into_iter().filter(|(_, _, known)| *known >= MOST_LEVERAGE);
    Judgement {
        continuing: continuing.into_iter().map(|(cell, _, _)| cell).collect(),
        open: open.map(|(cell, _, _)| cell).collect(),
    }
}
