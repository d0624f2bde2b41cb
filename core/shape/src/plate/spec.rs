//! Nominal plate: size, thickness, rough orientation and region of interest.

use crate::{Blank, Vec3};

/// The plate as ordered, and the hint that distinguishes its corners.
#[derive(Debug, Clone, PartialEq)]
pub struct PlateSpec {
    /// Extent along u, metres.
    pub width: f64,
    /// Extent along v, metres.
    pub height: f64,
    /// Thickness, metres.
    pub thickness: f64,
    /// Distance from the mid-surface's edge inwards to that of the scanned face (bevelled edges), metres.
    pub face_inset: f64,
    /// Height of the square root face in the middle of a bevelled edge, metres.
    pub root_face: f64,
    /// Rough direction of growing u, scanner frame, any length. It determines which corner is (0, 0).
    pub u_axis: Option<Vec3>,
    /// Box that contains the plate, scanner frame.
    pub region: Option<RegionOfInterest>,
}

impl PlateSpec {
    /// Returns the outline as ordered.
    #[must_use]
    pub fn rectangle(&self) -> Blank {
        Blank::rectangle(self.width, self.height)
    }

    /// Returns the depth of the upper flank of a double-V bevel, metres; `None` where the edges are square.
    #[must_use]
    pub fn flank_depth(&self) -> Option<f64> {
        let depth = 0.5 * (self.thickness - self.root_face);
        (self.face_inset > 0.0 && depth > 0.0).then_some(depth)
    }
}

/// Axis-parallel box in the scanner frame, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RegionOfInterest {
    /// Smallest x, y, z.
    pub min: Vec3,
    /// Largest x, y, z.
    pub max: Vec3,
}
