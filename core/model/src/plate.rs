//! Plate as ordered, with the points and lines on it that are reported.

use serde::{Deserialize, Serialize};

/// The plate as ordered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Plate {
    /// Name.
    pub id: String,
    /// Extent along u, metres.
    pub width: f64,
    /// Extent along v, metres.
    pub height: f64,
    /// Thickness, metres.
    pub thickness: f64,
    /// Name of the supports that it rests on while it is scanned; recorded, and compared between strokes.
    pub supports: Option<String>,
    /// Distance of the scanned face's edge inside the mid-surface's edge (bevelled edges), metres.
    pub face_inset: f64,
    /// Height of the square root face in the middle of a bevelled edge, metres.
    pub root_face: f64,
}

/// Point whose position is reported.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Marker {
    /// Name.
    pub name: String,
    /// Place, metres.
    pub at: [f64; 2],
}

/// Line on the original rectangle along which the formed plate is cut.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrimLine {
    /// Name.
    pub name: String,
    /// Points, metres; on the rectangle the line is straight between them.
    pub points: Vec<[f64; 2]>,
}

/// A straight line on the original rectangle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ReferenceLine {
    /// Name.
    pub name: String,
    /// First point, metres.
    pub from: [f64; 2],
    /// Last point, metres.
    pub to: [f64; 2],
}

impl ReferenceLine {
    /// Returns the length on the original rectangle, metres.
    #[must_use]
    pub fn length(&self) -> f64 {
        (self.to[0] - self.from[0]).hypot(self.to[1] - self.from[1])
    }
}

/// A place that rests on a support of the press while the plate is scanned. A pair of numbers in documents.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(transparent)]
pub struct Support {
    /// Place, metres.
    pub at: [f64; 2],
}

/// A place with one figure for the press.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Station {
    /// Name.
    pub name: String,
    /// Place, metres.
    pub at: [f64; 2],
    /// Its figure.
    pub quantity: Quantity,
}

/// Figures of a station.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Measured minus target along the target's normal.
    Deviation,
    /// Gap of the nearest template.
    Gap,
    /// Target's curvature minus measured, along the line of bending.
    CurvatureDeficit,
}
