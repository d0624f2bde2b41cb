//! The face as a smooth height over the plate's mean plane, on which the beams at its edges end.
//!
//! An edge is known by directions: between two beams, across a mixed one. Where it is in space follows from the range of
//! the face there. That of the few cells about a crossing has half of a single beam's noise, and a beam that meets the face at 60 degrees
//! from its normal carries it into the edge nearly twofold; that of the whole face has a thirtieth.

use nalgebra::Vector2;

use super::corners::Plane;
use crate::Vec3;
use crate::mesh::{Heights, per_sigma_across, thinned};
use crate::patch::{Beyond, Crossing, Patch};
use crate::surface::{Axis, Net, Undetermined};

/// Length of a span, metres: bends of a press are three and more times as wide.
const SPAN: f64 = 0.1;

/// Newton steps from a beam's point near the face; each squares an error of a few parts in a hundred.
const STEPS: usize = 4;

/// A beam's point that would move by more than this, metres, is none of the face.
const REACH: f64 = 0.5;

/// A crossing with its places on the sheet.
#[derive(Debug, Clone, Copy)]
pub(super) struct Settled {
    pub(super) crossing: Crossing,
    /// The last cell of the face, on the sheet, ...
    pub(super) cell: Vec3,
    /// ... and its own range behind it, metres.
    pub(super) residual: f64,
}

/// Height over a plane, metres.
pub(super) struct Sheet {
    plane: Plane,
    height: Net<1>,
}

impl Sheet {
    /// Fits the samples over `plane`, whose axes run along the plate's edges.
    ///
    /// # Errors
    /// [`Undetermined`] when they are too few.
    pub(super) fn fit(patch: &Patch, plane: Plane) -> Result<Self, Undetermined> {
        let mut heights = Heights::default();
        let (mut low, mut high) = (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY));
        for sample in thinned(patch) {
            let place = plane.project(sample.point);
            (low, high) = (low.inf(&place), high.sup(&place));
            heights.add(place.into(), plane.height(sample.point), per_sigma_across(sample, &plane.normal()));
        }
        if !low.iter().zip(&high).all(|(low, high)| low < high) {
            return Err(Undetermined { n_points: patch.samples.len() });
        }
        let axis = |k: usize| {
            let n_spans = Axis::of_length(high[k] - low[k], SPAN).n_spans();
            Axis::new(low[k], high[k], n_spans)
        };
        let (fitted, _) = heights.smooth([axis(0), axis(1)])?;
        Ok(Self { plane, height: fitted.net })
    }

    /// A crossing of `patch` on the sheet. `None` where a beam does not meet it.
    pub(super) fn settle(&self, patch: &Patch, crossing: &Crossing) -> Option<Settled> {
        let sample = &patch.samples[crossing.sample as usize];
        let (cell, _) = self.meet(sample.point)?;
        let (mut inside, normal) = self.meet(crossing.inside)?;
        let (mut outside, _) = self.meet(crossing.outside)?;
        // What lies beyond falls behind the sheet by so much more than behind the face's continuation.
        let (mut mixed, mut mixed_excess) = (None, crossing.mixed_excess);
        if let Some([near, far]) = crossing.mixed {
            let (nearest, farthest) = (self.meet(near)?.0, self.meet(far)?.0);
            mixed = Some([nearest, farthest]);
            mixed_excess += (near.norm() - nearest.norm()) as f32;
        }
        let more = crossing.outside.norm() - outside.norm();
        if crossing.beyond == Beyond::SideFace {
            // From outside to inside are four standard deviations of a range on the side face.
            let shift = (inside - outside) * (more / (4.0 * f64::from(sample.sigma)));
            (inside, outside) = (inside + shift, outside + shift);
        }
        let excess = crossing.excess + more as f32;
        let residual = sample.point.norm() - cell.norm();
        Some(Settled {
            crossing: Crossing { inside, outside, normal, mixed, mixed_excess, excess, ..*crossing },
            cell,
            residual,
        })
    }

    /// Where the beam through `point` meets the sheet, and the unit normal there, towards the scanner.
    fn meet(&self, point: Vec3) -> Option<(Vec3, Vec3)> {
        let beam = point.normalize();
        let mut at = point;
        let mut normal = self.plane.normal();
        for _ in 0..STEPS {
            let place = self.plane.project(at);
            let [[height], [by_x], [by_y]] = self.height.frame(place.x, place.y);
            normal = self.plane.normal() - self.plane.lift_direction(Vector2::new(by_x, by_y));
            // Towards the sheet a beam falls, against its normal.
            let approach = normal.dot(&beam);
            if approach.is_nan() || approach >= 0.0 {
                return None;
            }
            at += beam * ((height - self.plane.height(at)) / approach);
        }
        ((at - point).norm() < REACH).then(|| (at, normal.normalize()))
    }
}
