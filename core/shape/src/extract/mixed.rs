//! Mixed pixels: beams that straddle an edge float between the plate and what lies behind it.

use super::noise::Noise;
use super::window::Window;

/// Bound of a second difference, in its standard deviations. A sound cell is lost with a probability of 6e-7 in one
/// difference, and is only lost when none of the three explains it.
const BOUND: f32 = 5.0;

/// Marks the valid cells that no surface explains: those for which, along the row or along the column, the range
/// departs by more than the noise allows from the straight continuation of the cells on either side and from the
/// middle between them. Where fewer than two neighbours are valid on each side nothing is said.
///
/// Straight means in inverse range, so that no limit of the incidence enters.
pub(super) fn mark(window: &Window, noise: &Noise) -> Vec<bool> {
    let n_rows = window.n_rows;
    let mut mixed = vec![false; window.cells.len()];
    for column in 2..window.n_columns.saturating_sub(2) {
        for row in 2..n_rows.saturating_sub(2) {
            let index = column * n_rows + row;
            let here = window.inverse[index];
            if here > 0.0 {
                let bound = BOUND * 6.0_f32.sqrt() * noise.at(index) * here * here;
                mixed[index] = departs(&window.inverse, index, 1, bound)
                    || departs(&window.inverse, index, n_rows, bound);
            }
        }
    }
    mixed
}

/// True when at least one second difference through `index` can be formed along `stride` and none is in bound.
#[inline]
fn departs(inverse: &[f32], index: usize, stride: usize, bound: f32) -> bool {
    let q = [
        inverse[index - 2 * stride],
        inverse[index - stride],
        inverse[index],
        inverse[index + stride],
        inverse[index + 2 * stride],
    ];
    let small = |a: f32, b: f32, c: f32| a > 0.0 && c > 0.0 && b > 0.0 && (a - 2.0 * b + c).abs() <= bound;
    let known = |a: f32, b: f32, c: f32| a > 0.0 && b > 0.0 && c > 0.0;
    let any = known(q[0], q[1], q[2]) || known(q[1], q[2], q[3]) || known(q[2], q[3], q[4]);
    any && !(small(q[0], q[1], q[2]) || small(q[1], q[2], q[3]) || small(q[2], q[3], q[4]))
}
