//! Range noise from the scan itself: median absolute third difference of the inverse range, block by block.
//!
//! Third differences of the inverse range down a column vanish on every smooth surface at any incidence; the remainder
//! is noise. Its median absolute value in a block gives a robust standard deviation, which heavy tails, mixed pixels
//! and edges hardly change.
//!
//! In: the inverse ranges of a window. Out: the standard deviation of the range by cell, metres.

use super::window::Window;

/// Size of a block, columns and rows: small compared with a plate, large enough for a median.
const BLOCK: (usize, usize) = (16, 32);

/// Least number of differences in a block; a block with fewer takes the pooled value.
const LEAST_COUNT: usize = 64;

/// Lower bound of the estimate, metres: zero, as in a simulated scan without noise, would leave no room for a plate's
/// curvature.
const LEAST: f32 = 1e-4;

/// Median of |x| of a normal variable of unit variance.
const NORMAL_MEDIAN_ABS: f32 = 0.674_489_75;

/// Third differences of white noise have 1 + 9 + 9 + 1 times its variance.
const THIRD_DIFFERENCE_GAIN: f32 = 20.0;

/// Standard deviation of the range over a window.
#[derive(Debug, Clone)]
pub(super) struct Noise {
    /// Standard deviation over all blocks, metres.
    pub(super) pooled: f32,
    block: Vec<f32>,
    blocks_down: usize,
    n_rows: usize,
}

impl Noise {
    /// Estimates the noise from the usable cells. Returns the lower bound when there are none.
    pub(super) fn estimate(window: &Window, usable: &[bool]) -> Self {
        let (n_columns, n_rows) = (window.n_columns, window.n_rows);
        let blocks_down = n_rows.div_ceil(BLOCK.1);
        let mut block = vec![f32::NAN; n_columns.div_ceil(BLOCK.0) * blocks_down];
        let mut all = Vec::new();
        let mut here = Vec::new();
        for (number, value) in block.iter_mut().enumerate() {
            let (across, down) = (number / blocks_down * BLOCK.0, number % blocks_down * BLOCK.1);
            here.clear();
            for column in across..(across + BLOCK.0).min(n_columns) {
                let start = column * n_rows + down;
                let end = start + BLOCK.1.min(n_rows - down);
                third_differences(&window.inverse[start..end], &usable[start..end], &mut here);
            }
            if here.len() >= LEAST_COUNT {
                *value = median(&mut here);
            }
            all.extend_from_slice(&here);
        }
        let scale = 1.0 / (NORMAL_MEDIAN_ABS * THIRD_DIFFERENCE_GAIN.sqrt());
        let pooled = if all.is_empty() { LEAST } else { (median(&mut all) * scale).max(LEAST) };
        for value in &mut block {
            *value = if value.is_finite() { (*value * scale).max(LEAST) } else { pooled };
        }
        Self { pooled, block, blocks_down, n_rows }
    }

    /// Estimates the noise of the background, that is, of all measured cells off the component.
    pub(super) fn of_background(window: &Window) -> Self {
        let off = window.own.iter().zip(&window.inverse).map(|(own, inverse)| !own && *inverse > 0.0);
        Self::estimate(window, &off.collect::<Vec<bool>>())
    }

    /// Returns the standard deviation at a cell, metres.
    pub(super) fn at(&self, index: usize) -> f32 {
        self.of(index / self.n_rows, index % self.n_rows)
    }

    /// Returns the standard deviation at a cell given by column and row, metres.
    #[inline]
    pub(super) fn of(&self, column: usize, row: usize) -> f32 {
        self.block[column / BLOCK.0 * self.blocks_down + row / BLOCK.1]
    }
}

/// Appends |third difference of 1/r| r^2, which is that of the range to first order, in metres.
fn third_differences(inverse: &[f32], usable: &[bool], out: &mut Vec<f32>) {
    for (q, ok) in inverse.windows(4).zip(usable.windows(4)) {
        if ok.iter().all(|ok| *ok) {
            out.push(((q[3] - q[0]) - 3.0 * (q[2] - q[1])).abs() / (q[1] * q[2]));
        }
    }
}

fn median(values: &mut [f32]) -> f32 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}
