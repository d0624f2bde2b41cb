//! Rays and what they hit.

use platen_sim_plate::Vec3;

/// What a beam hit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum Label {
    /// Nothing within reach.
    #[default]
    Nothing,
    /// The scanned face of the plate.
    PlateTop,
    /// The other face.
    PlateUnderside,
    /// One of the four side faces.
    PlateSide,
    /// A die that carries the plate.
    Die,
    /// The press table.
    Table,
    /// Frame and ram.
    Press,
    /// RayCastHead floor.
    Floor,
    /// Wall of the shop.
    Wall,
    /// Switch cabinet.
    Cabinet,
    /// Somebody.
    Person,
    /// A crane's chain.
    Chain,
}

/// A half line from `origin` along the unit vector `direction`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Metres.
    pub origin: Vec3,
    /// Unit vector.
    pub direction: Vec3,
}

impl Ray {
    /// Point at `range` metres.
    pub fn at(&self, range: f64) -> Vec3 {
        self.origin + self.direction * range
    }
}

/// The nearest thing on a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Metres from the ray's origin.
    pub range: f64,
    /// Cosine of the angle between the reversed beam and the surface normal.
    pub cos_incidence: f64,
    /// What it is.
    pub label: Label,
    /// Which one it is: equal only for the same face of the same thing.
    pub object: u16,
    /// Material point of a hit on the plate, metres.
    pub uv: Option<[f64; 2]>,
}
