//! Outlook: largest gap after a bend, with its interval, metres.

use super::{Adviser, P95};

/// Half width of the interval of the middle of a bend about the punch, metres: a bend extends over a third of the die
/// to both sides, and farther to the side where no earlier bend has hardened the steel.
const BESIDE: f64 = 0.018;
/// Largest error of the height by linear theory, share of a gap: a chord of 2 m on a radius of 9 m has 0.3 % more
/// sagitta than its parabola, and the face lies half a thickness, 0.2 % of the radius, off the middle.
const SECOND_ORDER: f64 = 0.006;
/// Number of half waves along a board, and sign, of height errors that may decide between two seats.
const WAVES: [(f64, f64); 4] = [(1.0, 1.0), (1.0, -1.0), (2.0, 1.0), (2.0, -1.0)];

impl Adviser<'_> {
    /// Returns the largest gap after the bend (lower end of its interval, expected value, upper end) and the board
    /// under which it is expected.
    pub(super) fn gap_after(&self, line: usize, angle: f64, sigma: f64) -> ([f64; 3], usize) {
        let off = (P95 * self.place_sigma()).hypot(BESIDE);
        let worst = |angle: f64, off: f64| {
            self.planner.worst(&self.planner.bent_off(&self.heights, line, off, angle))
        };
        let middle = worst(angle, 0.0);
        let board = middle.map_or(0, |it| it.board);
        let mut gaps = [middle.map_or(0.0, |it| it.gap.gap); 3];
        for angle in [angle - P95 * sigma, angle, angle + P95 * sigma] {
            for off in [-off, 0.0, off] {
                let gap = worst(angle, off).map_or(0.0, |it| it.gap.gap);
                gaps = [gaps[0].min(gap), gaps[1], gaps[2].max(gap)];
            }
        }
        // On a plate that is far too flat a board may rest in either of two seats; errors of the heights decide which.
        let bent = self.planner.bent(&self.heights, line, angle);
        for (waves, sign) in WAVES {
            let gap =
                self.planner.worst(&self.planner.waved(&bent, waves, sign)).map_or(0.0, |it| it.gap.gap);
            gaps = [gaps[0].min(gap), gaps[1], gaps[2].max(gap)];
        }
        // Heights are linear in the angles only up to terms of second order.
        let known_to = |gap: f64| self.situation.boards[board].uncertainty + SECOND_ORDER * gap;
        let [low, gap, high] = gaps;
        ([(low - known_to(low)).max(0.0), gap, high + known_to(high)], board)
    }
}
