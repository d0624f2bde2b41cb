//! Situation of a plate, the input of the planner: bend lines, boards with heights, and curvature of the blank.

use platen_model::{CannotAdvise, PlateHistory};
use platen_shape::{Surface, TargetSurface};

use crate::bend_lines::BendLines;
use crate::board::{Board, STEP};
use crate::press_law::sag_of_bends;

/// Sine of the angle to the bends below which a board is not changed by them.
const ALONG: f64 = 0.5;
/// Longest part of a board's line that may be unseen, metres.
const UNSEEN: f64 = 0.2;

/// Situation of a plate between two strokes.
#[derive(Debug, Clone)]
pub struct Situation {
    /// Lines along which the plate is bent.
    pub lines: BendLines,
    /// Templates across the lines.
    pub boards: Vec<Board>,
    /// 1 when bends turn towards the scanner, else -1.
    pub side: f64,
    /// Curvature of the blank across the lines in steps of [`STEP`] along x, positive in the sense in which the target
    /// bends, 1/m. Empty for a flat blank.
    pub blank: Vec<f64>,
}

impl Situation {
    /// Returns the situation of a plate with a cylinder or cone as its target, from its surface and that of the blank.
    /// A blank that was not scanned counts as flat.
    ///
    /// # Errors
    /// The reason why nothing can be advised.
    pub fn of_surfaces(
        record: &PlateHistory,
        now: &Surface,
        blank: Option<&Surface>,
    ) -> Result<Self, CannotAdvise> {
        let task = &record.task;
        let target = task.target.as_ref().ok_or(CannotAdvise::NoTarget)?;
        let target = TargetSurface::new(target, task.width, task.height, task.thickness)
            .map_err(|_| CannotAdvise::NoTarget)?;
        let lines = BendLines::of_task(task).ok_or(CannotAdvise::NoTarget)?;
        let mut boards = Vec::new();
        for template in &task.templates {
            let line = task.reference_lines.iter().find(|line| line.name == template.line);
            let line = line.ok_or(CannotAdvise::NoTemplate)?;
            let length = line.length();
            let along = [0, 1].map(|k| (line.to[k] - line.from[k]) / length);
            let middle = [0, 1].map(|k| 0.5 * (line.from[k] + line.to[k]));
            let bends = lines.direction(lines.coordinate(middle));
            if (along[0] * bends[1] - along[1] * bends[0]).abs() < ALONG {
                continue;
            }
            if longest_unseen(now, line.from, along, length) > UNSEEN {
                return Err(CannotAdvise::Unseen);
            }
            let found = record.templates.iter().find(|found| found.name == template.name);
            let uncertainty = found.map_or(0.0, |found| found.uncertainty);
            let difference =
                |_, [u, v]: [f64; 2]| now.curvature(u, v).along(along) - target.curvature(u, v).along(along);
            boards.push(Board::new(template, uncertainty, line.from, line.to, difference));
        }
        if boards.is_empty() {
            return Err(CannotAdvise::NoTemplate);
        }
        let side = target.side();
        let blank = blank.map_or_else(Vec::new, |blank| curvature_across(&lines, blank, side));
        Ok(Self { lines, boards, side, blank })
    }

    /// Returns the sag of the plate at the line x in a die of this opening, metres, due to the blank's curvature and
    /// the sharp bends since, each as (x, angle).
    #[must_use]
    pub fn sag(&self, x: f64, opening: f64, bends: &[(f64, f64)]) -> f64 {
        let blank =
            self.blank.iter().enumerate().map(|(k, curvature)| (STEP * k as f64 - x, STEP * curvature));
        sag_of_bends(opening, blank.chain(bends.iter().map(|(at, angle)| (at - x, *angle))))
    }
}

/// Returns the length of the longest unseen part of a line, metres.
fn longest_unseen(now: &Surface, from: [f64; 2], along: [f64; 2], length: f64) -> f64 {
    let (mut longest, mut run) = (0, 0);
    let n = (length / STEP).round() as usize;
    for k in 0..=n {
        let s = length * k as f64 / n.max(1) as f64;
        let seen = now.mask().seen(from[0] + s * along[0], from[1] + s * along[1]);
        run = if seen { 0 } else { run + 1 };
        longest = longest.max(run);
    }
    longest as f64 * STEP
}

/// Returns the curvature across the lines at the middle of each line.
fn curvature_across(lines: &BendLines, surface: &Surface, side: f64) -> Vec<f64> {
    let n = (lines.length() / STEP).round() as usize;
    let across = |k: usize| {
        let x = STEP * k as f64;
        lines.ends(x).map_or(0.0, |[a, b]| {
            let [c, s] = lines.direction(x);
            let [u, v] = [0, 1].map(|k| 0.5 * (a[k] + b[k]));
            side * surface.curvature(u, v).along([-s, c])
        })
    };
    (0..=n).map(across).collect()
}
