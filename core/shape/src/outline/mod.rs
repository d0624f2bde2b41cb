//! The boundary of the scanned face: four corners and four edge curves.

use crate::Vec3;

/// A corner of the scanned face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corner {
    /// Position on the scanned face, metres, scanner frame.
    pub point: Vec3,
    /// Standard deviation along the edge that leaves the corner and along the one that arrives, metres.
    pub sigma: [f64; 2],
    /// False when the corner's neighbourhood was hidden and its place was extrapolated from its edges.
    pub seen: bool,
}

/// One edge of the scanned face from its first to its last corner.
#[derive(Debug, Clone, PartialEq)]
pub struct EdgeCurve {
    /// Points on the edge at equal steps of arc length (at most 10 mm), first and last are the corners.
    pub points: Vec<Vec3>,
    /// Per point: whether the edge was seen there, or bridged.
    pub seen: Vec<bool>,
    /// Standard deviation across the edge, in the surface, metres.
    pub sigma: f64,
}

/// The boundary in the order (0,0), (W,0), (W,H), (0,H): edge k runs from corner k to corner k + 1.
///
/// Seen from the scanner the loop runs counter-clockwise: (u, v, towards the scanner) is right-handed.
#[derive(Debug, Clone, PartialEq)]
pub struct Outline {
    /// Corners.
    pub corners: [Corner; 4],
    /// Edges v = 0, u = W, v = H, u = 0.
    pub edges: [EdgeCurve; 4],
}
