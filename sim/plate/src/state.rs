//! Description of a plate at one moment: blank, shape, pose. The serde form is the format of description files.

use crate::{PlateError, Shape, Vec3};
use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};

/// State of a plate: the content of description files and of the press's replies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlateState {
    /// Blank before forming.
    pub blank: Blank,
    /// Shape of the mid-surface.
    pub shape: Shape,
    /// Position and orientation in the scanner frame.
    #[serde(default)]
    pub pose: Pose,
    /// Strokes applied so far.
    #[serde(default)]
    pub strokes: u32,
}

/// Largest cutting error, millimetres; a larger one belongs to another plate.
const MAX_CUTTING_ERROR_MM: f64 = 100.0;

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// Ordered rectangle, its cutting errors, and painted markers.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Blank {
    /// Extent along u.
    pub width_mm: f64,
    /// Extent along v.
    pub height_mm: f64,
    /// Thickness.
    pub thickness_mm: f64,
    /// Offsets of the corners (0,0), (W,0), (W,H), (0,H) from those of the rectangle, (u, v).
    #[serde(default, skip_serializing_if = "is_default")]
    pub corners_off_mm: [[f64; 2]; 4],
    /// Sagitta of the edges v = 0, u = W, v = H, u = 0, positive outwards.
    #[serde(default, skip_serializing_if = "is_default")]
    pub bows_mm: [f64; 4],
    /// Distance of the faces' edges inside the mid-surface's edge: a double-V bevel; 0 for a square cut.
    #[serde(default, skip_serializing_if = "is_default")]
    pub face_inset_mm: f64,
    /// Height of the square root face in the middle of a bevelled edge.
    #[serde(default, skip_serializing_if = "is_default")]
    pub root_face_mm: f64,
    /// Centres of dark discs painted on the upper face, (u, v).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub markers_mm: Vec<[f64; 2]>,
}

/// Position of the plate's middle and orientation of the plate, scanner frame.
///
/// The plate is rolled about x, then pitched about y, then rotated by `yaw_deg` about z (the direction of its u axis),
/// then translated.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pose {
    /// Middle of the mid-surface.
    pub centre_mm: [f64; 3],
    /// Rotation about z, counter-clockwise from above.
    pub yaw_deg: f64,
    /// Rotation about y.
    #[serde(default)]
    pub pitch_deg: f64,
    /// Rotation about x.
    #[serde(default)]
    pub roll_deg: f64,
}

impl Default for Pose {
    /// Returns a pose seven metres in front of a scanner that stands 3.6 m above the plate.
    fn default() -> Self {
        Self { centre_mm: [6000.0, 0.0, -3600.0], yaw_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 }
    }
}

impl Pose {
    /// Returns the transform from the plate's local frame to the scanner frame, metres.
    pub fn scanner_from_plate(&self) -> Isometry3<f64> {
        let [x, y, z] = self.centre_mm.map(|c| c * 1e-3);
        let turn = UnitQuaternion::from_euler_angles(
            self.roll_deg.to_radians(),
            self.pitch_deg.to_radians(),
            self.yaw_deg.to_radians(),
        );
        Isometry3::from_parts(Translation3::new(x, y, z), turn)
    }

    /// Creates the pose of a rotation (columns: local x, y, z in the scanner frame) and a position, metres.
    pub fn from_parts(rotation: &Rotation3<f64>, centre: Vec3) -> Self {
        let (roll, pitch, yaw) = rotation.euler_angles();
        Self {
            centre_mm: (centre * 1e3).into(),
            yaw_deg: yaw.to_degrees(),
            pitch_deg: pitch.to_degrees(),
            roll_deg: roll.to_degrees(),
        }
    }
}

impl PlateState {
    /// Creates a flat plate of these dimensions in the default pose.
    pub fn flat(width_mm: f64, height_mm: f64, thickness_mm: f64) -> Self {
        Self {
            blank: Blank { width_mm, height_mm, thickness_mm, ..Blank::default() },
            shape: Shape::Flat,
            pose: Pose::default(),
            strokes: 0,
        }
    }

    /// Checks the dimensions of the blank and the numbers of the pose.
    pub(crate) fn check(&self) -> Result<(), PlateError> {
        let blank = &self.blank;
        for (key, found, least) in [
            ("blank.width_mm", blank.width_mm, 10.0),
            ("blank.height_mm", blank.height_mm, 10.0),
            ("blank.thickness_mm", blank.thickness_mm, 0.1),
        ] {
            if !(found.is_finite() && found >= least && found <= 1e5) {
                return Err(PlateError::Description { key, found, advice: "write a length in millimetres" });
            }
        }
        let off = blank.corners_off_mm.iter().flatten().chain(&blank.bows_mm);
        if let Some(found) = off.copied().find(|off| off.is_nan() || off.abs() > MAX_CUTTING_ERROR_MM) {
            let advice = "write how far the cut is off the rectangle, 100 mm at most";
            return Err(PlateError::Description { key: "blank.corners_off_mm or bows_mm", found, advice });
        }
        let sides = blank.width_mm.min(blank.height_mm);
        for (key, found, below, advice) in [
            (
                "blank.face_inset_mm",
                blank.face_inset_mm,
                0.25 * sides,
                "write less than a quarter of the plate",
            ),
            ("blank.root_face_mm", blank.root_face_mm, blank.thickness_mm, "write less than the thickness"),
        ] {
            if !(0.0..below).contains(&found) {
                return Err(PlateError::Description { key, found, advice });
            }
        }
        let pose = &self.pose;
        let angles = [pose.yaw_deg, pose.pitch_deg, pose.roll_deg];
        match pose.centre_mm.into_iter().chain(angles).find(|value| !value.is_finite()) {
            Some(found) => {
                Err(PlateError::Description { key: "pose", found, advice: "write finite numbers" })
            }
            None => Ok(()),
        }
    }
}
