//! Mixed pixels by second differences of the inverse range: beams that straddle an edge return a range between that of the
//! plate and that of what lies behind it. Own; Masuda et al. do not treat them.

use super::range_noise::Noise;
use super::window::Window;

/// Bound of a second difference, in its standard deviations. A sound cell is lost with a probability of 6e-7 in one
/// difference, and is only lost when none of those that explain it holds.
const BOUND: f32 = 5.0;

/// The same in parts of the jump between the surfaces on both sides: what is farther away is often noisier than the plate.
const LEAST_SHARE: f32 = 0.005;

/// Class of a cell by its neighbours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Pixel {
    /// No return, or too few neighbours.
    #[default]
    Unknown,
    /// Part of a surface along its row and along its column.
    Sound,
    /// Part of no surface.
    Mixed,
}

/// Classifies the cells of a window. Mixed are cells whose range, along the row or along the column, departs by more than the noise allows
/// from the straight continuation of the two cells on either side and from the middle between its neighbours.
///
/// Straight means in inverse range, so that no limit of the incidence enters.
pub(super) fn classify(window: &Window, noise: &Noise) -> Vec<Pixel> {
    let n_rows = window.n_rows;
    let mut pixels = vec![Pixel::Unknown; window.cells.len()];
    for (column, rows) in window.inner_spans(2) {
        for row in rows {
            let index = column * n_rows + row;
            let here = window.inverse[index];
            if here > 0.0 {
                let bound = BOUND * 6.0_f32.sqrt() * noise.of(column, row) * here * here;
                let down = along(&window.inverse, index, 1, bound);
                let across = along(&window.inverse, index, n_rows, bound);
                pixels[index] = match (down, across) {
                    (Pixel::Mixed, _) | (_, Pixel::Mixed) => Pixel::Mixed,
                    (Pixel::Sound, Pixel::Sound) => Pixel::Sound,
                    _ => Pixel::Unknown,
                };
            }
        }
    }
    pixels
}

/// Classifies a cell along one direction of the lattice: mixed when both sides were measured and nothing explains it.
#[inline]
fn along(inverse: &[f32], index: usize, stride: usize, bound: f32) -> Pixel {
    let q = [
        inverse[index - 2 * stride],
        inverse[index - stride],
        inverse[index],
        inverse[index + stride],
        inverse[index + 2 * stride],
    ];
    let known = q.map(|q| q > 0.0);
    let small = |i: usize| (q[i] - 2.0 * q[i + 1] + q[i + 2]).abs() <= bound;
    let (before, behind) = (known[0] && known[1], known[3] && known[4]);
    if (before && small(0)) || (known[1] && known[3] && small(1)) || (behind && small(2)) {
        Pixel::Sound
    } else if before && behind {
        let off = |i: usize| (q[i] - 2.0 * q[i + 1] + q[i + 2]).abs();
        if off(0).min(off(2)) < LEAST_SHARE * (off(0) + off(2)) {
            return Pixel::Sound;
        }
        Pixel::Mixed
    } else {
        Pixel::Unknown
    }
}
