//! Seat of the target on the plate: rigid fit, then one-sided contact by a linear program.
//!
//! The target's face is laid on the plate's face from the scanner's side, as a rigid surface. Its direction follows the
//! plate's (u, v), by the least-squares rigid fit of all material points that were seen. Its height and two small tilts
//! then solve the linear program "lowest over the middle of the plate, nowhere through the plate". On a plate that is
//! not bent enough the tilt is undetermined, as it is under a template: a target that rocks keeps the tilt of the fit.
//! Other seats are near-optimal vertices of the linear program, found by shifting its objective away from the middle.

use platen_sdk::{Error, ErrorKind, Result};
use platen_shape::template_seat::TOUCHES;
use platen_shape::{Placement, Surface, TargetSurface, Vec3};

use crate::linear_program::{self, Vertex};
use crate::trials::{TRIALS, Trials};

/// Nodes on which the target may rest, and its rigid fit to them.
#[derive(Debug)]
pub(crate) struct Support {
    pub(crate) index: Vec<usize>,
    places: Vec<[f64; 2]>,
    rows: Vec<Vec3>,
    pub(crate) placement: Placement,
    /// Measured minus target in the fit, at all nodes.
    pub(crate) fitted: Vec<f64>,
}

impl Support {
    /// Fits the target to the plate at these nodes.
    pub(crate) fn new(now: &Surface, target: &TargetSurface, uv: &[[f64; 2]], index: Vec<usize>) -> Self {
        let places: Vec<[f64; 2]> = index.iter().map(|&i| uv[i]).collect();
        let placement = Placement::best(now, target, places.iter().copied());
        let fitted = uv.iter().map(|&at| placement.deviation(now, target, at)).collect();
        let rows = places.iter().map(|&at| row(target, at)).collect();
        Self { index, places, rows, placement, fitted }
    }

    /// Returns the seat on the plate; contacts are positions in `index`.
    pub(crate) fn seat(&self, size: [f64; 2]) -> Result<Seat> {
        let heights: Vec<f64> = self.index.iter().map(|&i| self.fitted[i]).collect();
        seat(Vec3::x(), &self.rows, &heights, &self.places, size, None)
    }

    /// Returns the seat in each trial; the seat of `measured` if a trial has none.
    pub(crate) fn seats_in(
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

    /// Returns the movements to seats in which the middle of the target lies higher than in the measured one by no more
    /// than `by`.
    pub(crate) fn seats_within(
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
                // The feasible movements are convex: a seat that is too high is approached until the middle has risen
                // by `by`.
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

/// Target at rest on the plate.
#[derive(Debug, Clone)]
pub(crate) struct Seat {
    /// Movement from the fit.
    pub(crate) movement: Vec3,
    pub(crate) contacts: Vec<usize>,
    pub(crate) rocks: bool,
    /// Active constraints of the linear program, and the rise of the middle of the target there, metres.
    vertex: [usize; 3],
    pub(crate) lowest: f64,
}

/// Returns the seat over these heights; `start` are the active constraints of a similar plate.
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

/// Number of directions in which the extent of the contacts is measured: the smallest extent is accurate to 0.5 %.
const DIRECTIONS: usize = 32;
/// Part of the shorter side that the contacts must span in every direction; with less the target rocks.
const ROCKS: f64 = 0.25;
/// Distances from the middle at which other seats are searched, as shares of the shorter side.
const OFF_MIDDLE: [f64; 3] = [0.001, 0.01, 0.1];

/// Returns the derivative of the deviation at a place by the target's rise and tilts, with its sign reversed.
pub(crate) fn row(target: &TargetSurface, [u, v]: [f64; 2]) -> Vec3 {
    let (p, n) = (target.face(u, v), target.normal(u, v));
    let turn = p.cross(&n);
    Vec3::new(n.z, turn.x, turn.y)
}

/// Returns the smallest extent of the points over all directions.
fn narrowest(places: &[[f64; 2]]) -> f64 {
    let extent = |k: usize| {
        let (sin, cos) = (std::f64::consts::PI * k as f64 / DIRECTIONS as f64).sin_cos();
        let along = places.iter().map(|[u, v]| u * cos + v * sin);
        along.clone().fold(f64::NEG_INFINITY, f64::max) - along.fold(f64::INFINITY, f64::min)
    };
    (0..DIRECTIONS).map(extent).fold(f64::INFINITY, f64::min)
}
