//! Plate file at the time of a measurement, as far as the figures depend on it.

use serde::{Deserialize, Serialize};

use platen_model::units::mm;
use platen_model::{Facing, RadiusOf, Target, TargetShape};
use platen_plant::PlateFile;
use platen_shape::{Surface, Vec3};

use crate::picture::PictureScale;

/// Plate file at a stroke.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct PlateRecord {
    /// Extent along u.
    pub width_mm: f64,
    /// Extent along v.
    pub height_mm: f64,
    /// Thickness.
    pub thickness_mm: f64,
    /// Target in words; null where the file has none.
    pub target: Option<String>,
    /// Parameters of the scales of its pictures.
    pub scale: PictureScale,
    /// Edge that faces the press, as a direction in (u, v): `[0, -1]` is the edge v = 0. Null where the plant file does
    /// not place the press, or places it under the plate.
    pub press_side: Option<[i8; 2]>,
}

impl PlateRecord {
    /// Records a plate file, and the side of the press relative to the measured plate.
    pub fn new(file: &PlateFile, surface: &Surface, press: Option<Vec3>) -> Self {
        let plate = &file.plate;
        Self {
            width_mm: mm(plate.width),
            height_mm: mm(plate.height),
            thickness_mm: mm(plate.thickness),
            target: file.target.as_ref().map(words),
            scale: PictureScale::of(file),
            press_side: press.and_then(|press| press_side(surface, press)),
        }
    }
}

/// Returns the edge beyond which the press's origin lies, the farther one of two.
fn press_side(surface: &Surface, press: Vec3) -> Option<[i8; 2]> {
    let (w, h) = (surface.width(), surface.height());
    let at = surface.derivatives(0.5 * w, 0.5 * h);
    let way = press - at.p;
    let beyond = |along: Vec3, half: f64| way.dot(&along.normalize()) / half;
    let (u, v) = (beyond(at.u, 0.5 * w), beyond(at.v, 0.5 * h));
    match u.abs().max(v.abs()) {
        farthest if farthest <= 1.0 => None,
        _ if u.abs() >= v.abs() => Some([u.signum() as i8, 0]),
        _ => Some([0, v.signum() as i8]),
    }
}

fn words(target: &Target) -> String {
    let of = match target.radius_of {
        RadiusOf::Inside => "inside",
        RadiusOf::Outside => "outside",
        RadiusOf::Mid => "mid-surface",
    };
    let face = match target.scanned_face {
        Facing::Inside => "the scanner sees the concave face",
        Facing::Outside => "the scanner sees the convex face",
    };
    let radius = |metres: f64| format!("{:.0}", mm(metres));
    let lines = |axis: f64| format!("straight along {:.0}\u{b0} from u towards v", axis.to_degrees());
    match target.shape {
        TargetShape::Flat => "flat".to_owned(),
        TargetShape::Sphere { radius: r } => format!("sphere, {of} radius {} mm; {face}", radius(r)),
        TargetShape::Cylinder { radius: r, axis } => {
            format!("cylinder, {of} radius {} mm, {}; {face}", radius(r), lines(axis))
        }
        TargetShape::Cone { axis, radius_start, radius_end } => format!(
            "cone, {of} radii {} to {} mm, {}; {face}",
            radius(radius_start),
            radius(radius_end),
            lines(axis)
        ),
        TargetShape::Torus { axis, radius: r, cross_radius } => format!(
            "torus, {of} radius {} mm along {:.0}\u{b0} from u towards v and {} mm across; {face}",
            radius(r),
            axis.to_degrees(),
            radius(cross_radius)
        ),
    }
}
