//! Target of a plate: the shape toward which it is bent.

use serde::{Deserialize, Serialize};

/// The shape that the plate is bent toward.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Target {
    /// Shape.
    pub shape: TargetShape,
    /// Surface that the radii refer to.
    pub radius_of: RadiusOf,
    /// Face of the target that the scanner sees.
    pub scanned_face: Facing,
}

/// Target shapes. Radii in metres, positive; directions are those of the generators, from u towards v, radians.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum TargetShape {
    /// A plane.
    Flat,
    /// Cylinder with straight generators along `axis`.
    Cylinder {
        /// Radius, metres.
        radius: f64,
        /// Direction of the straight lines, from u towards v, radians.
        axis: f64,
    },
    /// Cone: the middle generator runs along `axis`, and the radius varies linearly along it.
    Cone {
        /// Direction of the middle straight line, from u towards v, radians.
        axis: f64,
        /// Radius at its first end, metres.
        radius_start: f64,
        /// Radius at its last end, metres.
        radius_end: f64,
    },
    /// Sphere.
    Sphere {
        /// Radius, metres.
        radius: f64,
    },
    /// Torus: two radii; a negative cross radius curves to the other side.
    Torus {
        /// Direction in which `radius` is measured, from u towards v, radians.
        axis: f64,
        /// Radius along the axis direction, metres.
        radius: f64,
        /// Radius across it, metres; negative curves to the other side.
        cross_radius: f64,
    },
}

/// Largest change of a cone's radius of normal curvature along its straight line, relative to its length. It equals the
/// tangent of the angle between line and axis. A roof of slope 1 : 20 is no longer distinguished from a flat one.
pub const FLATTEST_CONE: f64 = 20.0;

/// Surface that a radius refers to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
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
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Facing {
    /// The concave one: the centre of curvature lies on the scanner's side.
    Inside,
    /// The convex one.
    Outside,
}
