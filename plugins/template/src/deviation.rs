//! Deviation of the plate from the whole target at every node: least-squares rigid fit, then one-sided contact by a linear program.
//!
//! The target's face is laid on the plate's face from the scanner's side, as a rigid surface. Its direction follows the
//! plate's (u, v), by the least-squares rigid fit of all material points that were seen. Its height and two small tilts then solve
//! the linear program "lowest over the middle of the plate, nowhere through the plate". On a plate that is not bent enough the tilt is
//! undetermined, as it is under a template: a target that rocks keeps the tilt of the fit.
//!
//! The uncertainty holds the difference to other seats: on the whole fitted surface where a part of it was not seen, and those in which the middle
//! of the target lies higher by no more than the plate's own uncertainty. A half-bent plate has such seats, as its target lies on a ridge; the
//! noise of the scan alone then decides whether it rocks. They are near-optimal vertices of the linear program, found with its objective moved beside the
//! middle.

use nalgebra::Matrix3;
use platen_sdk::{Error, ErrorKind, PlateGrid, Result};
use platen_shape::{EXPANDED, Placement, Surface, TargetSurface, Vec3};

use crate::bending_mode::{MODES, Mode};
use crate::linear_program;
use crate::scanner_sigma::ScannerSigma;

/// Target in its seat on the plate.
#[derive(Debug)]
pub(crate) struct Deviation {
    /// Places, v outer, u inner.
    pub(crate) uv: Vec<[f64; 2]>,
    /// Measured minus target along the target's normal, metres, positive towards the scanner. Never above zero where the
    /// plate was seen.
    pub(crate) value: Vec<f64>,
    /// The same in the best fit of all material points, of both signs.
    pub(crate) fitted: Vec<f64>,
    /// The plate was seen there.
    pub(crate) seen: Vec<bool>,
    /// The target rocks on the plate.
    pub(crate) rocks: bool,
    contacts: Vec<usize>,
    pose: Pose,
    /// Seats on the plate bent by its uncertainty.
    bent: Vec<BentSeat>,
    /// Movements to other seats that the plate's uncertainty does not tell from this one.
    other: Vec<Vec3>,
    /// Seat on the whole plate where a part of it was not seen: the surface continues there.
    whole: Option<Pose>,
}

/// Seat of the target on a plate that is bent in a mode by its 95 % uncertainty.
#[derive(Debug)]
struct BentSeat {
    mode: &'static Mode,
    /// Metres.
    by: f64,
    movement: Vec3,
}

/// Pose of the target: the rigid fit, and the small movement from there to the seat.
#[derive(Debug)]
struct Pose {
    placement: Placement,
    /// Rise of the target, metres, and its tilts about x and y, radians.
    movement: Vec3,
}

impl Deviation {
    /// Lays the target on the plate.
    ///
    /// # Errors
    /// [`ErrorKind::BadData`] when the visible part of the plate does not support the target; the error of `check`.
    pub(crate) fn new(
        now: &Surface,
        target: &TargetSurface,
        scanner: ScannerSigma,
        check: &dyn Fn() -> Result<()>,
    ) -> Result<Self> {
        let uv = PlateGrid::new(now).map(|u, v| [u, v]);
        let seen: Vec<bool> = uv.iter().map(|&[u, v]| now.mask().seen(u, v)).collect();
        let size = [now.width(), now.height()];
        let support = Support::new(now, target, &uv, (0..uv.len()).filter(|&i| seen[i]).collect());
        check()?;
        let Seat { movement, contacts, rocks, lowest } = support.seat(size, Vec3::x(), |_| 0.0)?;
        let mut bent = Vec::new();
        for mode in &MODES {
            check()?;
            let sigma = mode.sigma(now, scanner);
            for by in [-EXPANDED * sigma, EXPANDED * sigma] {
                // Without a seat there is nothing to compare with; the plate itself has one.
                let seat = support.seat(size, Vec3::x(), |at| by * mode.at(at, now));
                bent.extend(seat.map(|Seat { movement, .. }| BentSeat { mode, by, movement }));
            }
        }
        let by = bent.iter().map(|seat| seat.by).fold(0.0, f64::max);
        let other = support.seats_within(by, movement, lowest, size, check)?;
        check()?;
        let mut whole = None;
        if seen.contains(&false) {
            let support = Support::new(now, target, &uv, (0..uv.len()).collect());
            let seat = support.seat(size, Vec3::x(), |_| 0.0).ok();
            whole = seat.map(|Seat { movement, .. }| Pose { placement: support.placement, movement });
        }
        let Support { placement, fitted, index, .. } = support;
        let value = (0..uv.len()).map(|i| fitted[i] - row(target, uv[i]).dot(&movement)).collect();
        let contacts = contacts.into_iter().map(|i| index[i]).collect();
        let pose = Pose { placement, movement };
        Ok(Self { uv, value, fitted, seen, rocks, contacts, pose, bent, other, whole })
    }

    /// Returns measured minus target at one place, in the seat.
    pub(crate) fn at(&self, now: &Surface, target: &TargetSurface, at: [f64; 2]) -> f64 {
        self.pose.deviation(now, target, at)
    }

    /// Returns the standard deviation of the deviation at a place, from the fit's covariance and the scanner's
    /// errors there and at the contacts; at least what the seats on the bent plate make of it. The interval reaches as far beyond
    /// the deviation in any other seat that the plate's uncertainty allows, and in the seat on the whole plate.
    pub(crate) fn sigma(
        &self,
        now: &Surface,
        target: &TargetSurface,
        at: [f64; 2],
        scanner: ScannerSigma,
    ) -> f64 {
        let here = row(target, at);
        let rows: Vec<Vec3> = self.contacts.iter().map(|&i| row(target, self.uv[i])).collect();
        let weights: Vec<f64> = match rows[..] {
            [a, b, c] => Matrix3::from_columns(&[a, b, c])
                .try_inverse()
                .map_or(vec![0.0; 3], |inverse| (inverse * here).iter().copied().collect()),
            _ => rows.iter().map(|r| here.x / r.x).collect(),
        };
        let contacts = self.contacts.iter().zip(weights).map(|(&i, weight)| (self.uv[i], -weight));
        let terms: Vec<([f64; 2], f64)> = contacts.chain([(at, 1.0)]).collect();
        let of_weights =
            now.sigma_of_heights(&terms).hypot(scanner.of_heights(terms.iter().map(|(_, weight)| *weight)));
        let change = |seat: &BentSeat| {
            let moved = here.dot(&(seat.movement - self.pose.movement));
            (seat.by * seat.mode.at(at, now) - moved).abs() / EXPANDED
        };
        let unseen = self.whole.as_ref().map_or(0.0, |whole| {
            (whole.deviation(now, target, at) - self.at(now, target, at)).abs() / EXPANDED
        });
        let told = self.bent.iter().map(change).fold(of_weights, f64::max);
        let to_other = |movement: &Vec3| here.dot(&(movement - self.pose.movement)).abs() / EXPANDED;
        told + self.other.iter().map(to_other).fold(0.0, f64::max) + unseen
    }
}

impl Pose {
    /// Returns measured minus target at one place.
    fn deviation(&self, now: &Surface, target: &TargetSurface, at: [f64; 2]) -> f64 {
        self.placement.deviation(now, target, at) - row(target, at).dot(&self.movement)
    }
}

/// Nodes on which the target may rest, and its rigid fit to them.
#[derive(Debug)]
struct Support {
    index: Vec<usize>,
    places: Vec<[f64; 2]>,
    rows: Vec<Vec3>,
    placement: Placement,
    /// Measured minus target in the fit, at all nodes.
    fitted: Vec<f64>,
}

impl Support {
    fn new(now: &Surface, target: &TargetSurface, uv: &[[f64; 2]], index: Vec<usize>) -> Self {
        let places: Vec<[f64; 2]> = index.iter().map(|&i| uv[i]).collect();
        let placement = Placement::best(now, target, places.iter().copied());
        let fitted = uv.iter().map(|&at| placement.deviation(now, target, at)).collect();
        let rows = places.iter().map(|&at| row(target, at)).collect();
        Self { index, places, rows, placement, fitted }
    }

    /// Returns [`seat`] on the plate raised by a height at each place; contacts are positions in `index`.
    fn seat(&self, size: [f64; 2], objective: Vec3, raised: impl Fn([f64; 2]) -> f64) -> Result<Seat> {
        let places = self.index.iter().zip(&self.places);
        let heights: Vec<f64> = places.map(|(&i, &at)| self.fitted[i] + raised(at)).collect();
        seat(objective, &self.rows, &heights, &self.places, size)
    }

    /// Returns the movements to seats in which the middle of the target lies no more than `by` higher than in the lowest one.
    fn seats_within(
        &self,
        by: f64,
        movement: Vec3,
        lowest: f64,
        size: [f64; 2],
        check: &dyn Fn() -> Result<()>,
    ) -> Result<Vec<Vec3>> {
        let mut found = Vec::new();
        for off_middle in OFF_MIDDLE.map(|share| share * size[0].min(size[1])) {
            check()?;
            for (x, y) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
                let objective = Vec3::new(1.0, off_middle * x, off_middle * y);
                let seat = self.seat(size, objective, |_| 0.0);
                // The feasible movements are convex: a seat that is too high is approached until the middle has risen by as much.
                found.extend(seat.map(|seat| {
                    let rise = seat.lowest - lowest;
                    movement + (seat.movement - movement) * if rise > by { by / rise } else { 1.0 }
                }));
            }
        }
        Ok(found)
    }
}

/// The target at rest.
#[derive(Debug)]
struct Seat {
    /// Movement from the fit.
    movement: Vec3,
    contacts: Vec<usize>,
    rocks: bool,
    /// Rise of the middle of the target, metres, in the vertex of the linear program.
    lowest: f64,
}

/// Returns the seat over these heights.
fn seat(
    objective: Vec3,
    rows: &[Vec3],
    heights: &[f64],
    places: &[[f64; 2]],
    [width, height]: [f64; 2],
) -> Result<Seat> {
    let vertex =
        linear_program::minimum(objective, rows, heights, 1e3 * (width + height)).ok_or_else(|| {
            Error::new(
                ErrorKind::BadData,
                "the target finds no seat: the plate was seen on one side of its middle only",
            )
            .hint("scan again with the whole plate in view")
        })?;
    let lowest = vertex.q.x;
    if narrowest(vertex.active.map(|i| places[i])) >= ROCKS * width.min(height) {
        return Ok(Seat { movement: vertex.q, contacts: vertex.active.to_vec(), rocks: false, lowest });
    }
    let rise = |i: usize| heights[i] / rows[i].x;
    let top = (0..rows.len()).fold(0, |best, i| if rise(i) > rise(best) { i } else { best });
    Ok(Seat { movement: Vec3::x() * rise(top), contacts: vec![top], rocks: true, lowest })
}

/// Part of the shorter side that the contacts must span in every direction; with less the target rocks.
const ROCKS: f64 = 0.25;
/// How far from the middle other seats are sought as the lowest, shares of the shorter side.
const OFF_MIDDLE: [f64; 3] = [0.001, 0.01, 0.1];

/// Returns the derivative of the deviation at a place by the target's rise and tilts, with its sign reversed.
fn row(target: &TargetSurface, [u, v]: [f64; 2]) -> Vec3 {
    let (p, n) = (target.face(u, v), target.normal(u, v));
    let turn = p.cross(&n);
    Vec3::new(n.z, turn.x, turn.y)
}

/// Returns the smallest altitude of a triangle.
fn narrowest([a, b, c]: [[f64; 2]; 3]) -> f64 {
    let side = |p: [f64; 2], q: [f64; 2]| (p[0] - q[0]).hypot(p[1] - q[1]);
    let twice_area = ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs();
    let longest = side(a, b).max(side(b, c)).max(side(c, a));
    if longest > 0.0 { twice_area / longest } else { 0.0 }
}
