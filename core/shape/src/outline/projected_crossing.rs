//! Boundary crossings projected along their beams onto the height field of the face.
//!
//! The local fit of a few cells has half the noise of a single beam, the height field a thirtieth of it. Ranges beyond
//! the edge are converted to distances behind the height field.
//!
//! In: a crossing of the patch and the height field. Out: [`ProjectedCrossing`]. A crossing has none where a
//! beam does not meet the height field.

use super::height_field::HeightField;
use crate::Vec3;
use crate::extract::{Beyond, Crossing, MixedPixels, Patch};

/// A crossing with its points on the height field.
#[derive(Debug, Clone, Copy)]
pub(super) struct ProjectedCrossing {
    pub(super) crossing: Crossing,
    /// The last cell of the face, on the height field.
    pub(super) cell: Vec3,
    /// The measured range of that cell less its range on the height field, metres.
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
        // Ranges beyond the edge lie farther behind the height field than behind the local continuation by the same
        // amount.
        let project = |pixels: MixedPixels| {
            let [near, far] = pixels.ends;
            let ends = [height_field.meet(near)?.0, height_field.meet(far)?.0];
            let more = (near.norm() - ends[0].norm()) as f32;
            let (excess, jump) = (pixels.excess + more, pixels.jump.map(|jump| jump + more));
            Some(MixedPixels { ends, excess, jump })
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

    /// Returns the crossing as it is beside a strip of background that may be narrower than a beam. A mixed pixel
    /// behind the strip's plane need not see the plate, and the background that a mixed pixel sees is not known: only
    /// mixed pixels that certainly see the plate are kept.
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
