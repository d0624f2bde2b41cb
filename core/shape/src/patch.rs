//! The samples on the plate's scanned face.

use crate::Vec3;

/// One sample on the scanned face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Position, metres, scanner frame. The scanner stands in the origin.
    pub point: Vec3,
    /// Column of the lattice.
    pub column: u32,
    /// Row of the lattice.
    pub row: u32,
    /// Standard deviation of the range, metres, as estimated from the scan.
    pub sigma: f32,
    /// Raw intensity.
    pub intensity: u16,
}

/// The plate's scanned face: its samples without side faces and mixed pixels, by column, then by row.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Patch {
    /// Samples, ordered by (column, row), each cell at most once.
    pub samples: Vec<Sample>,
    /// Angle between neighbouring columns, radians.
    pub azimuth_step: f64,
    /// Angle between neighbouring rows, radians.
    pub elevation_step: f64,
    /// Pooled standard deviation of the range on the plate, metres, as estimated from the scan.
    pub noise: f64,
}
