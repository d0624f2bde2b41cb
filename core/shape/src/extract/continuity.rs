//! Continuity criterion between lattice neighbours (Masuda et al., 3.1, eq. 1 and 2), without trigonometry per cell.
//!
//! In: the ranges of two neighbouring samples, metres. Out: whether both lie on one surface. Limits: an incidence of 72
//! degrees; down a column 82 degrees where the ranges change evenly.

use platen_scan::ScanHeader;

/// 1 / (2 cos 0.4 pi): neighbours on one surface seen at an incidence below 0.4 pi (72 degrees) lie nearer to
/// each other than this factor times the sum of their ranges times the angle between them (Masuda et al., eq. 1).
const FACTOR: f64 = 1.618_033_988_749_895;

/// The same factor at 82 degrees, an incidence at which a strongly bent plate may be seen. Down a column two cells are
/// joined up to this incidence if the ranges before and behind them change at nearly the same rate, which they do not
/// at an edge.
const STEEP_FACTOR: f64 = 3.59;
const STEEP_RATES: f32 = 2.0;

/// Least bound between columns, in parts of the bound between rows. Beams of neighbouring columns converge towards the
/// zenith and the nadir; without this limit the bound would fall below the range noise.
const LEAST_PART_OF_ROW_STEP: f64 = 0.25;

/// The criterion between two beams a fixed angle t apart.
///
/// With ranges a and b the squared distance is (a - b)^2 + a b 2 (1 - cos t), the squared bound
/// (1.62 d)^2 (a + b)^2, where d is t itself (eq. 2 is printed with |p1| + |p2| on the left, a misprint).
#[derive(Debug, Clone, Copy)]
pub(super) struct Link {
    chord: f32,
    bound: f32,
}

impl Link {
    fn new(angle: f64, bound: f64) -> Self {
        Self { chord: (2.0 * (1.0 - angle.cos())) as f32, bound: bound.powi(2) as f32 }
    }

    /// Returns true when samples at ranges `a` and `b` (metres) are on one surface.
    #[inline]
    pub(super) fn joins(self, a: f32, b: f32) -> bool {
        let difference = a - b;
        let sum = a + b;
        difference * difference + a * b * self.chord < self.bound * (sum * sum)
    }
}

/// The criterion in both directions of a lattice, each with its own step.
#[derive(Debug, Clone)]
pub(super) struct Continuity {
    /// Between a cell and the one below it: up to 72 degrees of incidence, and up to 82 degrees.
    down: Link,
    steep: Link,
    /// Per row, between a cell and the one in the next column.
    pub(super) across: Vec<Link>,
}

impl Continuity {
    pub(super) fn new(header: &ScanHeader) -> Self {
        let row_step = header.elevation_step;
        let across = (0..header.n_rows)
            .map(|row| {
                let elevation = header.elevation_start - row_step * f64::from(row);
                let angle = header.azimuth_step * elevation.cos().abs();
                Link::new(angle, FACTOR * angle.max(LEAST_PART_OF_ROW_STEP * row_step))
            })
            .collect();
        Self {
            down: Link::new(row_step, FACTOR * row_step),
            steep: Link::new(row_step, STEEP_FACTOR * row_step),
            across,
        }
    }

    /// Returns true when two consecutive ranges down a column are on one surface; `beyond` gives the ranges before and
    /// behind them.
    #[inline]
    pub(super) fn joins_down(
        &self,
        [here, next]: [f32; 2],
        beyond: impl FnOnce() -> [Option<f32>; 2],
    ) -> bool {
        if self.down.joins(here, next) {
            return true;
        }
        let [Some(before), Some(behind)] = beyond() else { return false };
        let rates = [here - before, next - here, behind - next];
        let [least, most] = [
            rates.map(f32::abs).into_iter().fold(f32::MAX, f32::min),
            rates.map(f32::abs).into_iter().fold(0.0, f32::max),
        ];
        let same_way = rates.iter().all(|r| *r > 0.0) || rates.iter().all(|r| *r < 0.0);
        same_way && most < STEEP_RATES * least && self.steep.joins(here, next)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Neighbours on a plane are joined at an incidence just below 0.4 pi and not joined just above.
    #[test]
    fn the_limit_is_an_incidence_of_72_degrees() {
        let step = 8e-4_f64;
        let link = Link::new(step, FACTOR * step);
        for (incidence, joined) in [(0.398, true), (0.402, false)] {
            // Beams `step` apart on a plane at distance 4 m from the scanner.
            let incidence = incidence * std::f64::consts::PI;
            let range = |angle: f64| (4.0 / angle.cos()) as f32;
            let (a, b) = (range(incidence - step / 2.0), range(incidence + step / 2.0));
            assert_eq!(link.joins(a, b), joined, "incidence {incidence}");
        }
    }
}
