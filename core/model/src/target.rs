//! The target: the shape that the plate is bent toward.

use serde::{Deserialize, Serialize};

/// The shape that the plate is bent toward.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Target {
    /// Shape.
    pub shape: TargetShape,
    /// Which surface the radii are those of.
    pub radius_of: RadiusOf,
    /// Which face of the target the scanner sees.
    pub scanned_face: Facing,
}

/// Target shapes. Radii in metres, positive; directions are those of the straight lines, from u towards v, radians.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum TargetShape {
    /// A plane.
    Flat,
    /// Straight along `axis`.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Direction of the straight lines.
        axis: f64,
    },
    /// Straight along `axis` in the middle of the plate, the radius changing along it.
    Cone {
        /// Direction of the middle straight line.
        axis: f64,
        /// Radius at its first end.
        radius_start: f64,
        /// Radius at its last end.
        radius_end: f64,
    },
    /// The same in every direction.
    Sphere {
        /// Radius.
        radius: f64,
    },
    /// Two radii; a negative cross radius curves the other way.
    Torus {
        /// Direction in which `radius` is measured.
        axis: f64,
        /// Radius along the axis direction.
        radius: f64,
        /// Radius across it.
        cross_radius: f64,
    },
}

/// Which surface a radius is that of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RadiusOf {
    /// The concave face.
    Inside,
    /// The convex face.
    Outside,
    /// The middle of the thickness.
    Mid,
}

/// A face of the target.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Facing {
    /// The concave one: the centre of curvature lies on the scanner's side.
    Inside,
    /// The convex one.
    Outside,
}
