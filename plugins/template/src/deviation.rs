//! The whole target laid on the plate: deviation everywhere.
//!
//! The target's face comes onto the plate's from the scanner's side, as a rigid surface. Its direction follows the plate's own
//! (u, v), by the best rigid fit of all material points; then it is lowered and tilted until it is lowest in the middle
//! of the plate without going through the plate anywhere. A plate not bent enough leaves its tilt open, as under a
//! board: a target that rocks keeps the tilt of the best fit.

use nalgebra::Matrix3;
use platen_sdk::{Error, ErrorKind, PlateGrid, Result};
use platen_shape::{Placement, Surface, TargetSurface, Vec3};

use crate::programme;

/// The target at rest on the plate.
#[derive(Debug)]
pub(crate) struct Deviation {
    /// Places, v outer, u inner.
    pub(crate) uv: Vec<[f64; 2]>,
    /// Measured minus target along the target's normal, metres, positive towards the scanner: none above zero where the
    /// plate was seen.
    pub(crate) value: Vec<f64>,
    /// The same before the target is lowered: in the best fit of all material points, of both signs.
    pub(crate) fitted: Vec<f64>,
    /// The plate was seen there.
    pub(crate) seen: Vec<bool>,
    /// The target rocks on the plate.
    pub(crate) rocks: bool,
    contacts: Vec<usize>,
    rest: Rest,
}

/// From the scanner's frame to the target's, and the target's own last movement.
#[derive(Debug)]
struct Rest {
    placement: Placement,
    /// Rise of the target, and its tilts about x and y.
    movement: Vec3,
}

impl Deviation {
    /// Lays the target on the plate.
    ///
    /// # Errors
    /// When too little of the plate was seen to carry the target, or the job was cancelled.
    pub(crate) fn new(now: &Surface, target: &TargetSurface, check: &dyn Fn() -> Result<()>) -> Result<Self> {
        let uv = PlateGrid::new(now).map(|u, v| [u, v]);
        let seen: Vec<bool> = uv.iter().map(|&[u, v]| now.mask().seen(u, v)).collect();
        let of_seen = uv.iter().zip(&seen).filter(|(_, seen)| **seen).map(|(at, _)| *at);
        let mut rest = Rest { placement: Placement::best(now, target, of_seen), movement: Vec3::zeros() };
        check()?;

        let fitted: Vec<f64> = uv.iter().map(|&at| rest.placement.deviation(now, target, at)).collect();
        let (mut rows, mut heights, mut index) = (Vec::new(), Vec::new(), Vec::new());
        for i in (0..uv.len()).filter(|&i| seen[i]) {
            rows.push(row(target, uv[i]));
            heights.push(fitted[i]);
            index.push(i);
        }
        check()?;
        let reach = 1e3 * (now.width() + now.height());
        let vertex = programme::minimum(&rows, &heights, reach).ok_or_else(|| {
            Error::new(
                ErrorKind::BadData,
                "the target finds no seat: the plate was seen on one side of its middle only",
            )
            .hint("scan again with the whole plate in view")
        })?;
        let shorter = now.width().min(now.height());
        let rocks = narrowest(vertex.held_by.map(|i| uv[index[i]])) < 0.25 * shorter;
        let held_by;
        (rest.movement, held_by) = if rocks {
            let rise = |i: usize| heights[i] / rows[i].x;
            let top = (0..rows.len()).fold(0, |best, i| if rise(i) > rise(best) { i } else { best });
            (Vec3::x() * rise(top), vec![top])
        } else {
            (vertex.q, vertex.held_by.to_vec())
        };
        let value = (0..uv.len()).map(|i| fitted[i] - row(target, uv[i]).dot(&rest.movement)).collect();
        let contacts = held_by.into_iter().map(|i| index[i]).collect();
        Ok(Self { uv, value, fitted, seen, rocks, contacts, rest })
    }

    /// Measured minus target at one place.
    pub(crate) fn at(&self, now: &Surface, target: &TargetSurface, at: [f64; 2]) -> f64 {
        self.rest.placement.deviation(now, target, at) - row(target, at).dot(&self.rest.movement)
    }

    /// One sigma of the deviation at a place: the fit's noise there and where the target touches.
    pub(crate) fn sigma(&self, now: &Surface, target: &TargetSurface, at: [f64; 2]) -> f64 {
        let here = row(target, at);
        let rows: Vec<Vec3> = self.contacts.iter().map(|&i| row(target, self.uv[i])).collect();
        let weights: Vec<f64> = match rows[..] {
            [a, b, c] => Matrix3::from_columns(&[a, b, c])
                .try_inverse()
                .map_or(vec![0.0; 3], |inverse| (inverse * here).iter().copied().collect()),
            _ => rows.iter().map(|r| here.x / r.x).collect(),
        };
        let contacts = self.contacts.iter().zip(weights).map(|(&i, weight)| (self.uv[i], -weight));
        now.sigma_of_heights(&contacts.chain([(at, 1.0)]).collect::<Vec<_>>())
    }
}

/// How the deviation at a place falls when the target rises and tilts.
fn row(target: &TargetSurface, [u, v]: [f64; 2]) -> Vec3 {
    let (p, n) = (target.face(u, v), target.normal(u, v));
    let turn = p.cross(&n);
    Vec3::new(n.z, turn.x, turn.y)
}

/// Smallest altitude of a triangle.
fn narrowest([a, b, c]: [[f64; 2]; 3]) -> f64 {
    let side = |p: [f64; 2], q: [f64; 2]| (p[0] - q[0]).hypot(p[1] - q[1]);
    let twice_area = ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs();
    let longest = side(a, b).max(side(b, c)).max(side(c, a));
    if longest > 0.0 { twice_area / longest } else { 0.0 }
}
