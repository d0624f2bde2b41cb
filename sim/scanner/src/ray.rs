//! Rays and hits.

use platen_sim_plate::Vec3;

/// Object hit by a beam.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum Label {
    /// No object within reach.
    #[default]
    Nothing,
    /// Upper, scanned face of the plate.
    PlateTop,
    /// Lower face of the plate.
    PlateUnderside,
    /// Side face of the plate.
    PlateSide,
    /// Die that supports the plate.
    Die,
    /// Press table.
    Table,
    /// Frame and ram of the press.
    Press,
    /// Floor of the shop.
    Floor,
    /// Wall of the shop.
    Wall,
    /// Switch cabinet.
    Cabinet,
    /// Person.
    Person,
    /// Chain of a crane.
    Chain,
}

/// Half line from `origin` along the unit vector `direction`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Metres.
    pub origin: Vec3,
    /// Unit vector.
    pub direction: Vec3,
}

impl Ray {
    /// Returns the point at `range` metres.
    pub fn at(&self, range: f64) -> Vec3 {
        self.origin + self.direction * range
    }
}

/// Nearest intersection on a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Metres from the ray's origin.
    pub range: f64,
    /// Cosine of the angle between the reversed beam and the surface normal.
    pub cos_incidence: f64,
    /// Kind of object.
    pub label: Label,
    /// Identity of the object: equal only for the same face of the same object.
    pub object: u16,
    /// Material point of a hit on the plate, metres.
    pub uv: Option<[f64; 2]>,
}
