//! Crossings on the sheet.

use crate::Vec3;
use crate::patch::{Beyond, Crossing, Patch};
use crate::sheet::Sheet;

/// A crossing with its places on the sheet.
#[derive(Debug, Clone, Copy)]
pub(super) struct Settled {
    pub(super) crossing: Crossing,
    /// The last cell of the face, on the sheet, ...
    pub(super) cell: Vec3,
    /// ... and its own range behind it, metres.
    pub(super) residual: f64,
    /// Its column and row.
    pub(super) place: [u32; 2],
}

impl Settled {
    /// A crossing of `patch` on the sheet. `None` where a beam does not meet it.
    pub(super) fn of(crossing: &Crossing, patch: &Patch, sheet: &Sheet) -> Option<Self> {
        let sample = &patch.samples[crossing.sample as usize];
        let (cell, _) = sheet.meet(sample.point)?;
        let (mut inside, normal) = sheet.meet(crossing.inside)?;
        let (mut outside, _) = sheet.meet(crossing.outside)?;
        // What lies beyond falls behind the sheet by so much more than behind the face's continuation.
        let (mut mixed, mut mixed_excess) = (None, crossing.mixed_excess);
        if let Some([near, far]) = crossing.mixed {
            let (nearest, farthest) = (sheet.meet(near)?.0, sheet.meet(far)?.0);
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
        Some(Self {
            crossing: Crossing { inside, outside, normal, mixed, mixed_excess, excess, ..*crossing },
            cell,
            residual,
            place: [sample.column, sample.row],
        })
    }
}
