//! Guard against bending too far: a planned bend is reduced while it could exceed the target.
//!
//! A bend backwards requires the plate to be turned over. A bend is therefore made smaller until the plate can still be
//! finished if the bend comes out larger than intended.

use super::{Adviser, LEAST_BEND, P95};
use crate::learner::LEAST_ANGLE;

/// Number of standard deviations up to which a bend may come out larger than intended; this covers 99.5 % of the bends.
const GUARD: f64 = 2.6;
/// Share of the angle that the first stroke aims at, when neither like plates nor earlier strokes are known.
const CAUTIOUS: f64 = 0.6;
/// Share by which a bend is made smaller in each step.
const SMALLER: f64 = 0.85;

impl Adviser<'_> {
    /// Returns the planned bend, reduced until the plate can be finished even if the bend comes out larger than
    /// intended. Where even a small bend is too much, as near the end of a plate, returns the small bend on any line
    /// that helps with the least hazard.
    pub(super) fn safe(&self, (line, planned): (usize, f64)) -> (usize, f64) {
        let mut angle = planned.min(self.settings.largest * 1.03);
        let nothing_known = self.history.like.is_none() && self.history.strokes.is_empty();
        if nothing_known {
            angle *= CAUTIOUS;
        }
        if !self.settings.guard {
            return (line, angle.max(LEAST_BEND));
        }
        let finishes = |angle: f64| self.finishes(line, angle + GUARD * self.sigma(line, angle));
        while angle > LEAST_BEND {
            if finishes(angle) {
                return (line, angle);
            }
            angle *= SMALLER;
        }
        match finishes(LEAST_BEND) {
            true => (line, LEAST_BEND),
            false => self.least_hazard().unwrap_or((line, LEAST_BEND)),
        }
    }

    /// Returns the smallest bend that lowers the largest gap and that, if it came out larger than intended and beside
    /// its line, would exceed the limits of the boards on the side of too much bending by the least. `None` where no
    /// such bend helps.
    fn least_hazard(&self) -> Option<(usize, f64)> {
        let now = self.planner.worst(&self.heights)?.excess;
        // Deeper after each consecutive stroke that left no bend.
        let idle = self.history.strokes.iter().rev().take_while(|stroke| stroke.bends.is_empty()).count();
        let small = LEAST_ANGLE * (1.0 + 0.4 * idle as f64);
        let large = |line| small + GUARD * self.sigma(line, small);
        let places = [-P95, 0.0, P95].map(|off| off * self.place_sigma());
        let hazard = |line: usize| {
            let expected = self.planner.worst(&self.planner.bent(&self.heights, line, small))?.excess;
            let far = places.map(|off| {
                self.planner.too_far(&self.planner.bent_off(&self.heights, line, off, large(line)))
            });
            (expected < now).then_some(expected + far.into_iter().fold(0.0, f64::max))
        };
        let least = |anywhere: bool| {
            let lines = (0..self.planner.grid.len())
                .filter(|line| self.may_bend(*line) && (anywhere || !self.is_old(*line)));
            lines.filter_map(|line| Some((line, hazard(line)?))).min_by(|a, b| a.1.total_cmp(&b.1))
        };
        least(false).or_else(|| least(true)).map(|(line, _)| (line, small))
    }

    /// Returns whether the plate can still be finished by bends of one side after this one.
    fn finishes(&self, line: usize, angle: f64) -> bool {
        let before = self.planner.least_excess(&self.heights).max(0.0);
        let after = self.planner.bent(&self.heights, line, angle);
        self.planner.least_excess(&after) <= before
    }

    /// Returns the largest intended angle with which the plate can still be finished if the bend comes out at its 99 %
    /// value.
    pub(super) fn deepest(&self, line: usize, angle: f64) -> f64 {
        let finishes = |angle: f64| self.finishes(line, angle + GUARD * self.sigma(line, angle));
        let (mut low, mut high) = (angle, 2.0 * angle + 0.02);
        if finishes(high) {
            return high;
        }
        for _ in 0..8 {
            let middle = 0.5 * (low + high);
            if finishes(middle) { low = middle } else { high = middle }
        }
        low
    }
}
