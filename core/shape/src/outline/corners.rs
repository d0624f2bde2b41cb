//! Corners of the plate, to a millimetre, as intersections of straight lines fitted by RANSAC (Masuda et al., 3.2).
//!
//! 1. A boundary point is a candidate where the directions to its k-th neighbours on both sides enclose a small angle.
//! 2. A straight line is fitted to the boundary on each side of a candidate by RANSAC (Fischler and Bolles 1981).
//! 3. The two lines are intersected.
//!
//! In: points of the visible boundary in the mean plane. Out: four corners, the starting points of `edge`.
//!
//! Own: k scales with the lattice; hidden parts of the loop add nothing to its length; of more than four candidates the
//! four are selected whose quadrilateral follows most of the loop.

use nalgebra::Vector2;
use platen_numerics::random::Random;

use super::{OutlineError, SEED};

type Vec2 = Vector2<f64>;

/// Angle to the k-th neighbours on both sides below which a place is a candidate, degrees (Masuda et al., 3.2).
const CORNER_ANGLE: f64 = 150.0;

/// k = 128 of Masuda et al. at 6.3 mm spans 0.8 m of a 4 m plate: this part of the shorter side.
const NEIGHBOUR_PART: f64 = 0.2;

/// RANSAC: number of pairs tried per line, and the largest distance of a point that supports a line, in lattice steps.
/// The points of a pair are at least `PAIR_SUPPORTS` such distances apart, or `PAIR_PART` of the reach where that is
/// less.
const TRIALS: usize = 96;
const SUPPORT_STEPS: f64 = 1.5;
const PAIR_SUPPORTS: f64 = 4.0;
const PAIR_PART: f64 = 0.4;

/// Points to either side over which the loop is levelled before its length is measured.
const LEVELLED: usize = 4;

/// Neighbouring points farther apart than this many lattice steps have a hidden part between them. It adds nothing to
/// the length of the loop, so that the points beyond a hidden corner are among its neighbours.
const GAP_STEPS: f64 = 8.0;

/// Angles at which two edges may meet, degrees, seen along the plate's mean normal: bending changes a right angle by a
/// few degrees only.
const CROSSING_ANGLE: std::ops::RangeInclusive<f64> = 60.0..=120.0;

/// Largest distance of a bent plate's edge from the straight line between its corners, seen along the mean normal, in
/// parts of that line's length.
const BULGE: f64 = 0.03;

/// A corner in the plane, and the place on the loop where its two edges part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Corner {
    pub(super) point: Vec2,
    /// Index into the loop.
    pub(super) at: usize,
}

/// Finds the four corners of a loop of seen boundary points, counter-clockwise in the plane.
///
/// `step` is the spacing of points, `shorter` the shorter side of the plate, metres.
///
/// # Errors
/// [`OutlineError::Corners`] when there are not four.
pub(super) fn find(points: &[Vec2], step: f64, shorter: f64) -> Result<[Corner; 4], OutlineError> {
    let reach = NEIGHBOUR_PART * shorter;
    let around = Loop::new(points, GAP_STEPS * step);
    let mut candidates = Vec::new();
    for at in around.sharpest_turns(reach) {
        let mut random = Random::new(SEED ^ at as u64);
        let support = SUPPORT_STEPS * step;
        let apart = (PAIR_SUPPORTS * support).min(PAIR_PART * reach);
        let before = line(&around.before(at, reach), support, apart, &mut random);
        let after = line(&around.after(at, reach), support, apart, &mut random);
        if let (Some(before), Some(after)) = (before, after) {
            candidates.extend(intersect(&before, &after).map(|point| Corner { point, at }));
        }
    }
    best_four(points, &candidates).ok_or(OutlineError::Corners { found: candidates.len() })
}

/// Selects the four candidates, in their order, whose connecting straight lines follow most of the loop.
fn best_four(points: &[Vec2], candidates: &[Corner]) -> Option<[Corner; 4]> {
    let n = candidates.len();
    let mut best: Option<(usize, [Corner; 4])> = None;
    for a in 0..n {
        for b in a + 1..n {
            for c in b + 1..n {
                for d in c + 1..n {
                    let four = [a, b, c, d].map(|i| candidates[i]);
                    let support = support(points, &four);
                    if best.is_none_or(|(known, _)| support > known) {
                        best = Some((support, four));
                    }
                }
            }
        }
    }
    // Where three of four corners are right, a quarter of the loop or more has no line.
    best.filter(|(support, _)| 4 * support > 3 * points.len()).map(|(_, four)| four)
}

/// Counts the points near their side of the quadrilateral.
fn support(points: &[Vec2], corners: &[Corner; 4]) -> usize {
    let mut near = 0;
    for side in 0..4 {
        let (from, to) = (corners[side], corners[(side + 1) % 4]);
        let chord = to.point - from.point;
        let length = chord.norm();
        let mut at = from.at;
        while at != to.at {
            let off = chord.perp(&(points[at] - from.point)) / length;
            near += usize::from(off.abs() < BULGE * length);
            at = (at + 1) % points.len();
        }
    }
    near
}

struct Loop<'a> {
    points: &'a [Vec2],
    /// Length of the loop up to each point, and its whole length last.
    length: Vec<f64>,
}

impl<'a> Loop<'a> {
    fn new(points: &'a [Vec2], gap: f64) -> Self {
        let n = points.len();
        let to_next = |i: usize| {
            let step = points[(i + 1) % n] - points[i % n];
            if step.norm() > gap { Vec2::zeros() } else { step }
        };
        // Points lie up to half a step to either side of the edge: the way from point to point is longer than the edge.
        let levelled = |i: usize| {
            let around = (0..=2 * LEVELLED).map(|k| to_next(i + k + LEVELLED * (n - 1)));
            around.sum::<Vec2>() / (2 * LEVELLED + 1) as f64
        };
        let mut length = vec![0.0];
        for i in 0..n {
            length.push(length[i] + levelled(i).norm());
        }
        Self { points, length }
    }

    fn n(&self) -> usize {
        self.points.len()
    }

    /// Returns the places where the loop turns left most sharply, one for each stretch that turns enough.
    fn sharpest_turns(&self, reach: f64) -> Vec<usize> {
        let limit = CORNER_ANGLE.to_radians();
        let angles: Vec<f64> = (0..self.n()).map(|at| self.angle(at, reach)).collect();
        let Some(start) = angles.iter().position(|a| *a >= limit) else { return Vec::new() };
        let mut sharpest = Vec::new();
        let mut best: Option<usize> = None;
        for at in (0..=self.n()).map(|i| (start + i) % self.n()) {
            if angles[at] < limit {
                best = best.filter(|b| angles[*b] <= angles[at]).or(Some(at));
            } else {
                sharpest.extend(best.take());
            }
        }
        sharpest.sort_unstable();
        sharpest
    }

    /// Returns the angle at a point between the points `reach` before and behind it; a right turn counts as none.
    fn angle(&self, at: usize, reach: f64) -> f64 {
        let off =
            |count: usize, stride: usize| self.points[(at + count * stride) % self.n()] - self.points[at];
        let before = off(self.n_before(at, reach), self.n() - 1);
        let after = off(self.n_after(at, reach), 1);
        if after.perp(&before) <= 0.0 { std::f64::consts::PI } else { before.angle(&after) }
    }

    /// Returns the points from `at` backwards over `reach`, at least one.
    fn before(&self, at: usize, reach: f64) -> Vec<Vec2> {
        (1..=self.n_before(at, reach)).map(|k| self.points[(at + self.n() - k) % self.n()]).collect()
    }

    /// Returns the points from `at` forwards over `reach`, at least one.
    fn after(&self, at: usize, reach: f64) -> Vec<Vec2> {
        (1..=self.n_after(at, reach)).map(|k| self.points[(at + k) % self.n()]).collect()
    }

    fn n_after(&self, at: usize, reach: f64) -> usize {
        let (n, whole) = (self.n(), self.length[self.n()]);
        let to = self.length[at] + reach;
        let last = if to < whole {
            self.length[..n].partition_point(|l| *l <= to) - 1
        } else {
            n - 1 + self.length[..n].partition_point(|l| *l <= to - whole)
        };
        (last - at).clamp(1, n - 1)
    }

    fn n_before(&self, at: usize, reach: f64) -> usize {
        let (n, whole) = (self.n(), self.length[self.n()]);
        let to = self.length[at] - reach;
        let back = if to >= 0.0 {
            at - self.length[..n].partition_point(|l| *l < to)
        } else {
            at + n - self.length[..n].partition_point(|l| *l < to + whole)
        };
        back.clamp(1, n - 1)
    }
}

/// A line by a point and a unit direction.
struct Line {
    point: Vec2,
    direction: Vec2,
}

/// Fits a line: the one through most of the points (RANSAC, from pairs at least `apart`), then least squares through
/// those.
fn line(points: &[Vec2], support: f64, apart: f64, random: &mut Random) -> Option<Line> {
    let off = |line: &Line, p: &Vec2| line.direction.perp(&(p - line.point)).abs();
    let mut best: Option<(usize, Line)> = None;
    for _ in 0..TRIALS {
        let (a, b) = (points[random.below(points.len())], points[random.below(points.len())]);
        let Some(direction) = (b - a).try_normalize(apart) else { continue };
        let trial = Line { point: a, direction };
        let count = points.iter().filter(|p| off(&trial, p) < support).count();
        if best.as_ref().is_none_or(|(known, _)| count > *known) {
            best = Some((count, trial));
        }
    }
    let (_, rough) = best?;
    let near: Vec<&Vec2> = points.iter().filter(|p| off(&rough, p) < support).collect();
    let centre = near.iter().copied().sum::<Vec2>() / near.len() as f64;
    let spread: nalgebra::Matrix2<f64> = near.iter().map(|p| (*p - centre) * (*p - centre).transpose()).sum();
    let eigen = spread.symmetric_eigen();
    let direction = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
    Some(Line { point: centre, direction })
}

fn intersect(a: &Line, b: &Line) -> Option<Vec2> {
    let sine = a.direction.perp(&b.direction);
    let angle = sine.abs().atan2(a.direction.dot(&b.direction)).to_degrees();
    CROSSING_ANGLE
        .contains(&angle)
        .then(|| a.point + a.direction * ((b.point - a.point).perp(&b.direction) / sine))
}
