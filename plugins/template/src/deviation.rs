//! Deviation of the plate from the whole target at every node: least-squares rigid fit, then one-sided contact by a linear program.
//!
//! The target's face is laid on the plate's face from the scanner's side, as a rigid surface. Its direction follows the
//! plate's (u, v), by the least-squares rigid fit of all material points that were seen. Its height and two small tilts then solve
//! the linear program "lowest over the middle of the plate, nowhere through the plate". On a plate that is not bent enough the tilt is
//! undetermined, as it is under a template: a target that rocks keeps the tilt of the fit.
//!
//! The uncertainty is that of [`Trials`], each with a seat of its own. It holds the difference to other seats: on the whole fitted surface where a part
//! of it was not seen, and those in which the middle of the target lies higher by no more than the trials' seats do. A half-bent plate has such seats, as
//! its target lies on a ridge; more than the noise of the scan decides whether it rocks there. They are near-optimal vertices of the linear program,
//! found with its objective moved beside the middle.

use nalgebra::Matrix3;
use platen_sdk::{Error, ErrorKind, PlateGrid, Result};
use platen_shape::{EXPANDED, Placement, Surface, TargetSurface, Vec3};

use crate::linear_program::{self, Vertex};
use crate::scanner_sigma::ScannerSigma;
use crate::trials::{TRIALS, Trials, half_width};

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
    /// Movement to the seat in each trial.
    tried: [Vec3; TRIALS],
    /// Movements to other seats that the plate's uncertainty does not tell from this one.
    other: Vec<Vec3>,
    /// Seat on the whole plate where a part of it was not seen: the surface continues there.
    whole: Option<Pose>,
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
        trials: &Trials<'_>,
        check: &dyn Fn() -> Result<()>,
    ) -> Result<Self> {
        let uv = PlateGrid::new(now).map(|u, v| [u, v]);
        let seen: Vec<bool> = uv.iter().map(|&[u, v]| now.mask().seen(u, v)).collect();
        let size = [now.width(), now.height()];
        let support = Support::new(now, target, &uv, (0..uv.len()).filter(|&i| seen[i]).collect());
        check()?;
        let seat = support.seat(size)?;
        check()?;
        let tried = support.seats_in(trials, &seat, size, check)?;
        let by = half_width(tried.each_ref().map(|tried| tried.lowest - seat.lowest));
        let other = support.seats_within(by, &seat, size, check)?;
        let tried = tried.map(|seat| seat.movement);
        let Seat { movement, contacts, rocks, .. } = seat;
        check()?;
        let mut whole = None;
        if seen.contains(&false) {
            let support = Support::new(now, target, &uv, (0..uv.len()).collect());
            let seat = support.seat(size).ok();
            whole = seat.map(|Seat { movement, .. }| Pose { placement: support.placement, movement });
        }
        let Support { placement, fitted, index, .. } = support;
        let value = (0..uv.len()).map(|i| fitted[i] - row(target, uv[i]).dot(&movement)).collect();
        let contacts = contacts.into_iter().map(|i| index[i]).collect();
        let pose = Pose { placement, movement };
        Ok(Self { uv, value, fitted, seen, rocks, contacts, pose, tried, other, whole })
    }

    /// Returns measured minus target at one place, in the seat.
    pub(crate) fn at(&self, now: &Surface, target: &TargetSurface, at: [f64; 2]) -> f64 {
        self.pose.deviation(now, target, at)
    }

    /// Returns the standard deviation of the deviation at a place, from the fit's covariance and the scanner's
    /// errors there and at the contacts; at least that of the trials. The interval reaches as far beyond the deviation in any other seat
    /// that the plate's uncertainty allows, and in the seat on the whole plate.
    pub(crate) fn sigma(
        &self,
        now: &Surface,
        target: &TargetSurface,
        at: [f64; 2],
        scanner: ScannerSigma,
        trials: &Trials<'_>,
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
        let raised = trials.heights(at);
        let departures = std::array::from_fn(|k| raised[k] - here.dot(&(self.tried[k] - self.pose.movement)));
        let of_trials = (half_width(departures) / EXPANDED).hypot(scanner.of_gap());
        let unseen = self.whole.as_ref().map_or(0.0, |whole| {
            (whole.deviation(now, target, at) - self.at(now, target, at)).abs() / EXPANDED
        });
        let to_other = |movement: &Vec3| here.dot(&(movement - self.pose.movement)).abs() / EXPANDED;
        let in_other = of_weights + self.other.iter().map(to_other).fold(0.0, f64::max);
        in_other.max(of_trials) + unseen
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

    /// Returns the seat on the plate; contacts are positions in `index`.
    fn seat(&self, size: [f64; 2]) -> Result<Seat> {
        let heights: Vec<f64> = self.index.iter().map(|&i| self.fitted[i]).collect();
        seat(Vec3::x(), &self.rows, &heights, &self.places, size, None)
    }

    /// Returns the seat in each trial; that of `measured` where there is none.
    fn seats_in(
        &self,
        trials: &Trials<'_>,
        measured: &Seat,
        size: [f64; 2],
        check: &dyn Fn() -> Result<()>,
    ) -> Result<[Seat; TRIALS]> {
        let mut heights: [Vec<f64>; TRIALS] = std::array::from_fn(|_| Vec::with_capacity(self.index.len()));
        for (&i, &at) in self.index.iter().zip(&self.places) {
            let raised = trials.heights(at);
            for (heights, raised) in heights.iter_mut().zip(raised) {
                heights.push(self.fitted[i] + raised);
            }
        }
        check()?;
        let start = Some(measured.vertex);
        Ok(std::array::from_fn(|k| {
            seat(Vec3::x(), &self.rows, &heights[k], &self.places, size, start).unwrap_or(measured.clone())
        }))
    }

    /// Returns the movements to seats in which the middle of the target lies no more than `by` higher than in the measured one.
    fn seats_within(
        &self,
        by: f64,
        measured: &Seat,
        size: [f64; 2],
        check: &dyn Fn() -> Result<()>,
    ) -> Result<Vec<Vec3>> {
        let heights: Vec<f64> = self.index.iter().map(|&i| self.fitted[i]).collect();
        let mut found = Vec::new();
        for off_middle in OFF_MIDDLE.map(|share| share * size[0].min(size[1])) {
            check()?;
            for (x, y) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
                let objective = Vec3::new(1.0, off_middle * x, off_middle * y);
                let start = Some(measured.vertex);
                let seat = seat(objective, &self.rows, &heights, &self.places, size, start);
                // The feasible movements are convex: a seat that is too high is approached until the middle has risen by as much.
                found.extend(seat.map(|seat| {
                    let rise = seat.lowest - measured.lowest;
                    measured.movement
                        + (seat.movement - measured.movement) * if rise > by { by / rise } else { 1.0 }
                }));
            }
        }
        Ok(found)
    }
}

/// The target at rest.
#[derive(Debug, Clone)]
struct Seat {
    /// Movement from the fit.
    movement: Vec3,
    contacts: Vec<usize>,
    rocks: bool,
    /// Active constraints of the linear program, and the rise of the middle of the target there, metres.
    vertex: [usize; 3],
    lowest: f64,
}

/// Returns the seat over these heights; `start` are active constraints of a plate that is alike.
fn seat(
    objective: Vec3,
    rows: &[Vec3],
    heights: &[f64],
    places: &[[f64; 2]],
    [width, height]: [f64; 2],
    start: Option<[usize; 3]>,
) -> Result<Seat> {
    let vertex = linear_program::minimum(objective, rows, heights, 1e3 * (width + height), start)
        .ok_or_else(|| {
            Error::new(
                ErrorKind::BadData,
                "the target finds no seat: the plate was seen on one side of its middle only",
            )
            .hint("scan again with the whole plate in view")
        })?;
    let Vertex { q: movement, active } = vertex;
    let touches =
        (0..rows.len()).filter(|&i| rows[i].dot(&movement) - heights[i] <= TOUCHES).map(|i| places[i]);
    if narrowest(&touches.collect::<Vec<_>>()) >= ROCKS * width.min(height) {
        return Ok(Seat {
            movement,
            contacts: active.to_vec(),
            rocks: false,
            vertex: active,
            lowest: movement.x,
        });
    }
    let rise = |i: usize| heights[i] / rows[i].x;
    let top = (0..rows.len()).fold(0, |best, i| if rise(i) > rise(best) { i } else { best });
    Ok(Seat {
        movement: Vec3::x() * rise(top),
        contacts: vec![top],
        rocks: true,
        vertex: active,
        lowest: movement.x,
    })
}

/// The target touches where its gap is no larger, metres: a target that lies flush on a part of the plate touches all of it, of which the linear
/// program names any three places.
const TOUCHES: f64 = 10e-6;
/// Directions in which the extent of the contacts is taken: the smallest is right to 0.5 %.
const DIRECTIONS: usize = 32;
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

/// Returns the smallest extent of places over all directions.
fn narrowest(places: &[[f64; 2]]) -> f64 {
    let extent = |k: usize| {
        let (sin, cos) = (std::f64::consts::PI * k as f64 / DIRECTIONS as f64).sin_cos();
        let along = places.iter().map(|[u, v]| u * cos + v * sin);
        along.clone().fold(f64::NEG_INFINITY, f64::max) - along.fold(f64::INFINITY, f64::min)
    };
    (0..DIRECTIONS).map(extent).fold(f64::INFINITY, f64::min)
}
