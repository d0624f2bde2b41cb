//! Planner by non-negative least squares: the fewest bends, none of them backwards, with which every board passes.
//!
//! 1. Heights of the plate over the target are linear in the angles (see [`Board`]). The angles on given lines are the
//!    non-negative least-squares solution under all boards, with the rigid motion of each board projected out.
//! 2. With all lines of a fine grid this solution is the missing turn: the bend angle that is missing along each line,
//!    radians.
//! 3. The search for the fewest bends starts from lines at equal shares of the missing turn, which are moved while the
//!    fit improves.

use nalgebra::{DMatrix, DVector};

use crate::bend_lines::BendLines;
use crate::board::{Board, Gap};
use crate::nnls;

/// Spacing of the candidate lines, metres.
const GRID: f64 = 0.025;
/// Least distance of two bends, candidate lines: closer bends act as one.
const APART: usize = 3;
/// Moves of a line that are tried while the plan is improved, candidate lines.
const MOVES: [isize; 4] = [-3, -1, 1, 3];
/// Rounds of moves.
const ROUNDS: usize = 6;
/// Number of stroke counts that are tried beyond the fewest conceivable.
const MORE: usize = 7;
/// Search for a single bend: distance of the lines that are tried, candidate lines, and number of angles; the least
/// gain that counts, metres.
const SINGLE: (usize, usize) = (2, 6);
const SINGLE_GAIN: f64 = 0.1e-3;
/// Share by which bends may exceed the largest bend, so that a plan does not take another stroke for a small excess.
const OVER: f64 = 1.03;

/// The largest gap of the plate, relative to what passes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Worst {
    pub(crate) board: usize,
    pub(crate) gap: Gap,
    /// Gap and its uncertainty less the limit, metres; negative on a plate that passes.
    pub(crate) over: f64,
    /// The same for plans, which keep a larger distance from a plate that is bent too far ([`HOLLOW`]).
    pub(crate) excess: f64,
}

/// Additional distance that plans keep from a plate that is bent too far, compared with a plate that is not bent
/// enough, metres: the latter is corrected by another stroke, the former by turning the plate over.
const HOLLOW: f64 = 0.3e-3;

/// Bends that finish the plate: candidate line and angle, in the order of the lines.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    pub(crate) bends: Vec<(usize, f64)>,
    /// Excess after all bends, as [`Worst::excess`].
    pub(crate) excess: f64,
}

/// Lines, boards and their linear algebra.
#[derive(Debug)]
pub(crate) struct Planner<'a> {
    boards: &'a [Board],
    side: f64,
    /// Coordinates of the candidate lines.
    pub(crate) grid: Vec<f64>,
    /// Heights due to a unit bend along each candidate line, boards one after the other.
    ramps: Vec<DVector<f64>>,
    /// The same heights with the rigid motions of the boards projected out.
    projected: DMatrix<f64>,
    gram: DMatrix<f64>,
}

impl<'a> Planner<'a> {
    /// Prepares the lines from `edge` to the same distance from the other end. Bends act towards the scanner where
    /// `side` is 1, else away.
    pub(crate) fn new(lines: &BendLines, boards: &'a [Board], side: f64, edge: f64) -> Self {
        let n = ((lines.length() - 2.0 * edge) / GRID).floor().max(0.0) as usize;
        // The grid lies in the middle of the reach, so that a mirrored plate gets mirrored lines.
        let first = 0.5 * (lines.length() - n as f64 * GRID);
        let grid: Vec<f64> = (0..=n).map(|k| first + k as f64 * GRID).collect();
        let column = |x: &f64| {
            let heights = boards.iter().flat_map(|board| board.ramp(lines, *x));
            DVector::from_iterator(rows(boards), heights.map(|height| side * height))
        };
        let ramps: Vec<DVector<f64>> = grid.iter().map(column).collect();
        let mut projected = DMatrix::from_columns(&ramps);
        for mut column in projected.column_iter_mut() {
            project(boards, column.as_mut_slice());
        }
        let gram = projected.tr_mul(&projected);
        Self { boards, side, grid, ramps, projected, gram }
    }

    /// Returns the present heights, boards one after the other.
    pub(crate) fn heights(&self) -> DVector<f64> {
        DVector::from_iterator(
            rows(self.boards),
            self.boards.iter().flat_map(|board| board.height.iter().copied()),
        )
    }

    /// Returns the heights after a bend.
    pub(crate) fn bent(&self, heights: &DVector<f64>, line: usize, angle: f64) -> DVector<f64> {
        heights + &self.ramps[line] * angle
    }

    /// Returns the heights after a bend `off` metres beyond a candidate line, between the lines of the grid.
    pub(crate) fn bent_off(&self, heights: &DVector<f64>, line: usize, off: f64, angle: f64) -> DVector<f64> {
        let last = (self.grid.len() - 1) as f64;
        let at = (line as f64 + off / GRID).clamp(0.0, last);
        let (before, share) = (at.floor() as usize, at.fract());
        let mut bent = heights.clone();
        bent.axpy(angle * (1.0 - share), &self.ramps[before], 1.0);
        if share > 0.0 {
            bent.axpy(angle * share, &self.ramps[before + 1], 1.0);
        }
        bent
    }

    /// Returns the largest excess of a gap and its uncertainty over the limit on the side of too much bending, under
    /// any board at any place, metres; negative where the plate is bent too far nowhere.
    pub(crate) fn too_far(&self, heights: &DVector<f64>) -> f64 {
        let mut from = 0;
        let each = self.boards.iter().map(|board| {
            let to = from + board.height.len();
            let gap = board.largest(&heights.as_slice()[from..to], self.side > 0.0);
            from = to;
            gap + board.uncertainty - board.limit
        });
        each.fold(f64::NEG_INFINITY, f64::max)
    }

    /// Returns the heights with `waves` half waves added along each board, with an amplitude of the board's
    /// uncertainty.
    pub(crate) fn waved(&self, heights: &DVector<f64>, waves: f64, sign: f64) -> DVector<f64> {
        let wave = self.boards.iter().flat_map(|board| {
            let last = (board.height.len() - 1) as f64;
            let phase = move |k: usize| std::f64::consts::PI * waves * k as f64 / last;
            (0..board.height.len()).map(move |k| sign * board.uncertainty * phase(k).cos())
        });
        heights + DVector::from_iterator(heights.len(), wave)
    }

    /// Returns the largest gap, relative to the limits.
    pub(crate) fn worst(&self, heights: &DVector<f64>) -> Option<Worst> {
        let mut from = 0;
        let each = self.boards.iter().enumerate().map(|(index, board)| {
            let to = from + board.height.len();
            let gap = board.worst(&heights.as_slice()[from..to]);
            from = to;
            let over = gap.gap + board.uncertainty - board.limit;
            let reserve = if gap.hollow == (self.side > 0.0) { HOLLOW } else { 0.0 };
            Worst { board: index, gap, over, excess: over + reserve }
        });
        each.reduce(|a, b| if b.excess > a.excess { b } else { a })
    }

    /// Returns the missing turn along each candidate line, radians.
    pub(crate) fn missing(&self, heights: &DVector<f64>) -> Vec<f64> {
        let all: Vec<usize> = (0..self.grid.len()).collect();
        nnls::solve(&self.gram, &self.right(heights), &all)
    }

    /// Returns the excess that remains when every candidate line may be bent.
    pub(crate) fn least_excess(&self, heights: &DVector<f64>) -> f64 {
        let angles = self.missing(heights);
        self.excess_after(heights, angles.into_iter().enumerate())
    }

    /// Returns the plan with the fewest bends of at most `largest` after which every board passes with a reserve of
    /// `reserve(angle)`; without such a plan, the best of those tried. Lines for which `free` is false are left out.
    pub(crate) fn plan(
        &self,
        heights: &DVector<f64>,
        largest: f64,
        reserve: impl Fn(f64) -> f64,
        free: impl Fn(usize) -> bool,
    ) -> Plan {
        let missing = self.missing(heights);
        let total: f64 = missing.iter().sum();
        let right = self.right(heights);
        let fewest = ((total / largest - 0.3).ceil() as usize).max(1);
        let mut best = Plan { bends: Vec::new(), excess: f64::INFINITY };
        for n in fewest..=fewest + MORE {
            let Some(lines) = self.settled(&right, &missing, n, &free) else { continue };
            let angles = nnls::solve(&self.gram, &right, &lines);
            let bends: Vec<(usize, f64)> =
                lines.into_iter().zip(angles).filter(|bend| bend.1 > 0.0).collect();
            let Some(deepest) = bends.iter().map(|bend| bend.1).reduce(f64::max) else { continue };
            let excess = self.excess_after(heights, bends.iter().copied());
            let fits = deepest <= OVER * largest;
            if fits && excess < best.excess {
                best = Plan { bends, excess };
            }
            if fits && excess <= -reserve(deepest) {
                break;
            }
        }
        best
    }

    /// Returns the single bend of at most `largest` that lowers the largest gap most, by direct search; `None` where no
    /// bend lowers it. Near the end of a plate the least-squares solution may contain no bend while a gap is still too
    /// large.
    pub(crate) fn single(
        &self,
        heights: &DVector<f64>,
        least: f64,
        largest: f64,
        free: &dyn Fn(usize) -> bool,
    ) -> Option<Plan> {
        let now = self.worst(heights)?.excess;
        let mut best: Option<Plan> = None;
        for line in (0..self.grid.len()).step_by(SINGLE.0).filter(|line| free(*line)) {
            for k in 0..SINGLE.1 {
                let angle = least + (largest - least).max(0.0) * k as f64 / (SINGLE.1 - 1) as f64;
                let excess = self.excess_after(heights, std::iter::once((line, angle)));
                if excess < best.as_ref().map_or(now - SINGLE_GAIN, |best| best.excess) {
                    best = Some(Plan { bends: vec![(line, angle)], excess });
                }
            }
        }
        best
    }

    /// Returns two thirds of the reverse bend that helps most: candidate line and angle, negative.
    pub(crate) fn reverse(&self, heights: &DVector<f64>) -> Option<(usize, f64)> {
        let right = self.right(heights);
        let gain = |k: &usize| right[*k].powi(2) / self.gram[(*k, *k)];
        let lines = (0..self.grid.len()).filter(|&k| right[k] < 0.0);
        let best = lines.reduce(|a, b| if gain(&b) > gain(&a) { b } else { a })?;
        Some((best, right[best] / self.gram[(best, best)] * 2.0 / 3.0))
    }

    fn excess_after(&self, heights: &DVector<f64>, bends: impl Iterator<Item = (usize, f64)>) -> f64 {
        let mut after = heights.clone();
        for (line, angle) in bends {
            after.axpy(angle, &self.ramps[line], 1.0);
        }
        self.worst(&after).map_or(f64::NEG_INFINITY, |worst| worst.excess)
    }

    fn right(&self, heights: &DVector<f64>) -> DVector<f64> {
        -self.projected.tr_mul(heights)
    }

    /// Returns `n` lines at equal shares of the missing turn, moved while the fit improves; `None` where there is no
    /// room for them. The lines are moved in order from either end and the better result is selected, so that a
    /// mirrored plate gets mirrored lines.
    fn settled(
        &self,
        right: &DVector<f64>,
        missing: &[f64],
        n: usize,
        free: &impl Fn(usize) -> bool,
    ) -> Option<Vec<usize>> {
        let last = self.grid.len() - 1;
        let from_first = self.settled_in_order(right, missing, n, free, &|line| line);
        let mirrored: Vec<f64> = missing.iter().rev().copied().collect();
        let from_last = self.settled_in_order(right, &mirrored, n, free, &|line| last - line);
        let both = [from_first, from_last].into_iter().flatten();
        let (lines, _) = both.reduce(|a, b| if b.1 < a.1 { b } else { a })?;
        Some(lines)
    }

    /// Returns the lines, moved one after the other in the order of `line`, with their misfit. `line` gives the
    /// candidate line of an index; `missing` is in the same order.
    fn settled_in_order(
        &self,
        right: &DVector<f64>,
        missing: &[f64],
        n: usize,
        free: &impl Fn(usize) -> bool,
        line: &impl Fn(usize) -> usize,
    ) -> Option<(Vec<usize>, f64)> {
        let free = |index: usize| free(line(index));
        let sorted = |indices: &[usize]| {
            let mut lines: Vec<usize> = indices.iter().map(|index| line(*index)).collect();
            lines.sort_unstable();
            lines
        };
        let mut indices = self.spread(missing, n, &free)?;
        let mut fit = self.misfit(right, &sorted(&indices));
        for _ in 0..ROUNDS {
            let before = fit;
            for k in 0..indices.len() {
                let moves = MOVES.iter().filter_map(|step| indices[k].checked_add_signed(*step));
                let room = |index: &usize| {
                    let others = indices.iter().enumerate().filter(|(other, _)| *other != k);
                    *index < self.grid.len()
                        && free(*index)
                        && others.into_iter().all(|(_, other)| other.abs_diff(*index) >= APART)
                };
                let mut best = (fit, indices[k]);
                for index in moves.filter(room) {
                    let mut moved = indices.clone();
                    moved[k] = index;
                    let misfit = self.misfit(right, &sorted(&moved));
                    if misfit < best.0 {
                        best = (misfit, index);
                    }
                }
                (fit, indices[k]) = best;
            }
            if before - fit <= 1e-6 * before.abs() {
                break;
            }
        }
        Some((sorted(&indices), fit))
    }

    /// Returns the indices nearest to equal shares of the missing turn.
    fn spread(&self, missing: &[f64], n: usize, free: &impl Fn(usize) -> bool) -> Option<Vec<usize>> {
        let total: f64 = missing.iter().sum();
        let mut lines: Vec<usize> = Vec::new();
        for k in 0..n {
            let share = (k as f64 + 0.5) / n as f64 * total;
            let mut sum = 0.0;
            let middle = missing.iter().position(|angle| {
                sum += angle;
                sum >= share
            });
            let middle = middle.unwrap_or(missing.len().saturating_sub(1));
            let room = |line: &usize| free(*line) && lines.iter().all(|other| other.abs_diff(*line) >= APART);
            lines.push((0..self.grid.len()).filter(room).min_by_key(|line| line.abs_diff(middle))?);
        }
        lines.sort_unstable();
        Some(lines)
    }

    /// Returns half the sum of squares of the best angles on these lines, less a constant.
    fn misfit(&self, right: &DVector<f64>, lines: &[usize]) -> f64 {
        let angles = nnls::solve(&self.gram, right, lines);
        let mut misfit = 0.0;
        for (&i, a) in lines.iter().zip(&angles) {
            let taken: f64 = lines.iter().zip(&angles).map(|(&j, b)| self.gram[(i, j)] * b).sum();
            misfit += a * (0.5 * taken - right[i]);
        }
        misfit
    }
}

fn rows(boards: &[Board]) -> usize {
    boards.iter().map(|board| board.height.len()).sum()
}

/// Removes the best straight line of each board from stacked heights.
fn project(boards: &[Board], mut heights: &mut [f64]) {
    for board in boards {
        let (own, rest) = heights.split_at_mut(board.height.len());
        heights = rest;
        let n = own.len() as f64;
        let middle = 0.5 * (n - 1.0);
        let mean = own.iter().sum::<f64>() / n;
        let (mut up, mut along) = (0.0, 0.0);
        for (k, height) in own.iter().enumerate() {
            let x = k as f64 - middle;
            up += x * height;
            along += x * x;
        }
        for (k, height) in own.iter_mut().enumerate() {
            *height -= mean + up / along * (k as f64 - middle);
        }
    }
}
