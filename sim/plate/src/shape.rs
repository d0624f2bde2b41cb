//! Shapes of a mid-surface, as written in a description file.

use crate::PlateError;
use crate::profile::{Profile, Step};
use serde::{Deserialize, Serialize};

/// Shape of the mid-surface. All radii are those of the mid-surface, in millimetres.
///
/// `axis_deg` is the direction of the generators (of the die), counted from u towards v: at 90 degrees the
/// plate bends along u. Positions across the generators are counted from the plate's middle, positive
/// towards the direction `axis_deg - 90`; positions along them, positive towards `axis_deg`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "shape", rename_all = "snake_case", deny_unknown_fields)]
pub enum Shape {
    /// Plane.
    Flat,
    /// Circular cylinder.
    Cylinder {
        /// Positive when the centre lies above the plate.
        radius_mm: f64,
        /// Direction of the generators, degrees.
        axis_deg: f64,
    },
    /// Circular cone: the radius of normal curvature grows along the generators.
    Cone {
        /// Direction of the middle generator from its start to its end, degrees.
        axis_deg: f64,
        /// Radius at the start of the middle generator.
        radius_start_mm: f64,
        /// Radius at its end.
        radius_end_mm: f64,
    },
    /// Sphere.
    Sphere {
        /// Positive when the centre lies above the plate.
        radius_mm: f64,
    },
    /// Torus: a circle of `radius_mm` along the axis direction, swept along one of `cross_radius_mm`.
    Torus {
        /// Direction of `radius_mm`, degrees.
        axis_deg: f64,
        /// Along the axis direction.
        radius_mm: f64,
        /// Across it, along the middle line.
        cross_radius_mm: f64,
    },
    /// Cylinder whose curvature changes in smooth steps: a partly bent plate.
    Steps {
        /// Direction of the generators, degrees.
        axis_deg: f64,
        /// Curvature before the first step, 1/m.
        curvature_per_m: f64,
        /// Changes, in any order.
        steps: Vec<CurvatureStep>,
    },
    /// Superposition of bend bands left by strokes, in one or two perpendicular directions.
    Bands {
        /// Direction of the die for `bands`, degrees.
        axis_deg: f64,
        /// Bands whose die lay along the axis; `at_mm` is counted across it.
        bands: Vec<Band>,
        /// Bands whose die lay across the axis; `at_mm` is counted along it.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        cross_bands: Vec<Band>,
    },
}

/// Smooth change of curvature (quintic, continuous second derivative).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CurvatureStep {
    /// Middle of the change, from the plate's middle.
    pub at_mm: f64,
    /// Length over which the curvature changes.
    pub width_mm: f64,
    /// Change, 1/m.
    pub change_per_m: f64,
}

/// Strip bent by one stroke. Its curvature rises over half the width and falls over the other half, so that
/// equal bands at half their width from each other add up to a constant curvature.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Band {
    /// Middle of the band, from the plate's middle.
    pub at_mm: f64,
    /// Full width.
    pub width_mm: f64,
    /// Angle by which the plate is bent over the whole band, positive concave upwards.
    pub angle_deg: f64,
}

impl Shape {
    /// Returns the name of the shape as in the document.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Flat => "flat",
            Self::Cylinder { .. } => "cylinder",
            Self::Cone { .. } => "cone",
            Self::Sphere { .. } => "sphere",
            Self::Torus { .. } => "torus",
            Self::Steps { .. } => "steps",
            Self::Bands { .. } => "bands",
        }
    }
}

/// Returns 1/radius in 1/m; refuses a radius below 100 mm as a typing error.
pub(crate) fn curvature(key: &'static str, radius_mm: f64) -> Result<f64, PlateError> {
    if radius_mm.is_finite() && radius_mm.abs() >= 100.0 {
        Ok(1e3 / radius_mm)
    } else {
        Err(PlateError::Description {
            key,
            found: radius_mm,
            advice: "write a radius of at least 100 mm, with its sign",
        })
    }
}

fn width(key: &'static str, width_mm: f64) -> Result<f64, PlateError> {
    if width_mm.is_finite() && width_mm >= 1.0 {
        Ok(width_mm * 1e-3)
    } else {
        Err(PlateError::Description { key, found: width_mm, advice: "write a width of at least 1 mm" })
    }
}

/// Builds a profile of constant curvature plus steps.
pub(crate) fn step_profile(
    curvature: f64,
    steps: &[CurvatureStep],
    reach: f64,
) -> Result<Profile, PlateError> {
    let steps = steps
        .iter()
        .map(|s| {
            Ok(Step {
                at: s.at_mm * 1e-3,
                width: width("steps.width_mm", s.width_mm)?,
                change: s.change_per_m,
            })
        })
        .collect::<Result<Vec<_>, PlateError>>()?;
    Ok(Profile::new(curvature, steps, reach))
}

/// Builds a profile of bend bands. A band of width w and angle a is a step up by k = 2 a / w about a quarter of the
/// width before its middle and the same step down a quarter behind it.
pub(crate) fn band_profile(bands: &[Band], reach: f64) -> Result<Profile, PlateError> {
    let mut steps = Vec::with_capacity(2 * bands.len());
    for band in bands {
        let width = width("bands.width_mm", band.width_mm)?;
        let change = 2.0 * band.angle_deg.to_radians() / width;
        let at = band.at_mm * 1e-3;
        steps.push(Step { at: at - width / 4.0, width: width / 2.0, change });
        steps.push(Step { at: at + width / 4.0, width: width / 2.0, change: -change });
    }
    Ok(Profile::new(0.0, steps, reach))
}
