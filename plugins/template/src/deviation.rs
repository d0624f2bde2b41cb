//! Deviation of the plate from the whole target at every node, with its uncertainty: least-squares rigid fit, then
//! one-sided contact of the target.
//!
//! The uncertainty is that of [`Trials`], in each of which the target has its own seat. It is extended by the
//! difference to other possible seats:
//!
//! - the seat on the whole fitted surface, if a part of it was not seen;
//! - the seats in which the middle of the target lies higher by no more than the seats of the trials do. A half-bent
//!   plate has such seats, as its target lies on a ridge; whether it rocks there does not depend on the noise of the
//!   scan alone.

use nalgebra::Matrix3;
use platen_sdk::{PlateGrid, Result};
use platen_shape::{EXPANDED, Placement, Surface, TargetSurface, Vec3};

use crate::scanner_sigma::ScannerSigma;
use crate::target_seat::{Seat, Support, row};
use crate::trials::{TRIALS, Trials, half_width};

/// Target in its seat on the plate.
#[derive(Debug)]
pub(crate) struct Deviation {
    /// Nodes, v outer, u inner.
    pub(crate) uv: Vec<[f64; 2]>,
    /// Measured minus target along the target's normal, metres, positive towards the scanner. It is never above zero
    /// where the plate was seen.
    pub(crate) value: Vec<f64>,
    /// The same in the best fit of all material points, with both signs.
    pub(crate) fitted: Vec<f64>,
    /// Whether the plate was seen there.
    pub(crate) seen: Vec<bool>,
    /// Whether the target rocks on the plate.
    pub(crate) rocks: bool,
    contacts: Vec<usize>,
    pose: Pose,
    /// Movement to the seat in each trial.
    tried: [Vec3; TRIALS],
    /// Movements to other seats that cannot be distinguished from this one within the plate's uncertainty.
    other: Vec<Vec3>,
    /// Seat on the whole fitted surface if a part of it was not seen: the fit continues the surface there.
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
    /// [`ErrorKind::BadData`] if the visible part of the plate does not support the target; the error of `check`.
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

    /// Returns the standard deviation of the deviation at a place, from the fit's covariance and the scanner's errors
    /// there and at the contacts; at least that of the trials. The interval includes the deviation in every other seat
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
