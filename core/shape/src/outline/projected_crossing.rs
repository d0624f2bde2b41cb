//! Boundary crossings projected along their beams onto the height field of the face.
//!
//! The local fit of a few cells has half a single beam's noise; the height field has a thirtieth. Ranges beyond the edge are
//! restated as distances behind the height field.

use super::height_field::HeightField;
use crate::Vec3;
use crate::extract::{Beyond, Crossing, MixedPixels, Patch};

/// A crossing with its places on the height field.
#[derive(Debug, Clone, Copy)]
pub(super) struct ProjectedCrossing {
    pub(super) crossing: Crossing,
    /// The last cell of the face, on the height field, ...
    pub(super) cell: Vec3,
    /// ... and its own range behind it, metres.
    pub(super) residual: f64,
    /// Its column and row.
    pub(super) place: [u32; 2],
}

impl ProjectedCrossing {
    /// Projects a crossing of `patch`. `None` where a beam does not meet the height field.
    pub(super) fn of(crossing: &Crossing, patch: &Patch, height_field: &HeightField) -> Option<Self> {
        let sample = &patch.samples[crossing.sample as usize];
        let (cell, _) = height_field.meet(sample.point)?;
        let (mut inside, normal) = height_field.meet(crossing.inside)?;
        let (mut outside, _) = height_field.meet(crossing.outside)?;
        // Ranges beyond the edge lie farther behind the height field than behind the local continuation by the same amount.
        let project = |pixels: MixedPixels| {
            let [near, far] = pixels.ends;
            let ends = [height_field.meet(near)?.0, height_field.meet(far)?.0];
            let excess = pixels.excess + (near.norm() - ends[0].norm()) as f32;
            Some(MixedPixels { ends, excess })
        };
        let all = |pixels: Option<MixedPixels>| pixels.map_or(Some(None), |pixels| project(pixels).map(Some));
        let (mixed, surely_mixed) = (all(crossing.mixed)?, all(crossing.surely_mixed)?);
        let more = crossing.outside.norm() - outside.norm();
        if crossing.beyond == Beyond::SideFace {
            // From outside to inside are four standard deviations of a range on the side face.
            let shift = (inside - outside) * (more / (4.0 * f64::from(sample.sigma)));
            (inside, outside) = (inside + shift, outside + shift);
        }
        let excess = crossing.excess + more as f32;
        let residual = sample.point.norm() - cell.norm();
        Some(Self {
            crossing: Crossing { inside, outside, normal, mixed, surely_mixed, excess, ..*crossing },
            cell,
            residual,
            place: [sample.column, sample.row],
        })
    }

    /// Returns the crossing as it is beside a strip of background that may be narrower than a beam: of a mixed pixel behind the strip's plane it is not
    /// known whether it sees the plate, and of no mixed pixel which background.
    pub(super) fn beside_strip(&self) -> Self {
        let crossing = self.crossing;
        let mixed = crossing.surely_mixed;
        let crossing = Crossing {
            mixed,
            complete: crossing.complete && mixed == crossing.mixed,
            background: crossing.background.filter(|_| crossing.strips.is_empty()),
            ..crossing
        };
        Self { crossing, ..*self }
    }
}
