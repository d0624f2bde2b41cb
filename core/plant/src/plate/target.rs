//! The target: the shape that the plate is bent toward, each shape with its own keys.

use std::f64::consts::TAU;

use super::place::Rectangle;
use super::{metres, millimetres};
use crate::document::Reported;
use crate::field::Located;
use crate::{Document, Table};

/// The shape that the plate is bent toward.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// Shape.
    pub shape: TargetShape,
    /// Which surface the radii are those of.
    pub radius_of: RadiusOf,
    /// Which face of the target the scanner sees.
    pub scanned_face: Facing,
}

/// Target shapes. Radii in metres; directions are those of the straight lines, from u towards v, radians.
#[derive(Debug, Clone, Copy, PartialEq)]
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
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RadiusOf {
    /// The concave face.
    Inside,
    /// The convex face.
    Outside,
    /// The middle of the thickness.
    Mid,
}

/// A face of the target.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Facing {
    /// The concave one: the centre of curvature lies on the scanner's side.
    Inside,
    /// The convex one.
    Outside,
}

#[derive(Debug, Clone, Copy)]
enum Word {
    Flat,
    Cylinder,
    Cone,
    Sphere,
    Torus,
}

const SHAPES: &[(&str, Word)] = &[
    ("flat", Word::Flat),
    ("cylinder", Word::Cylinder),
    ("cone", Word::Cone),
    ("sphere", Word::Sphere),
    ("torus", Word::Torus),
];

impl Target {
    pub(super) fn read(mut table: Table<'_>, plate: Option<Rectangle>) -> Result<Self, Reported> {
        // Without the shape nobody knows which keys belong here: only this one is reported.
        let word = table.choice("shape", SHAPES).required()?;
        let shape = TargetShape::read(word, &mut table, plate);
        let mut target =
            Self { shape: TargetShape::Flat, radius_of: RadiusOf::Inside, scanned_face: Facing::Inside };
        let mut faces = Ok(());
        if !matches!(word, Word::Flat) {
            let radius_of = table.choice(
                "radius_of",
                &[("inside", RadiusOf::Inside), ("outside", RadiusOf::Outside), ("mid", RadiusOf::Mid)],
            );
            let radius_of = radius_of.or(target.radius_of).map(|found| target.radius_of = found);
            let face =
                table.choice("scanned_face", &[("inside", Facing::Inside), ("outside", Facing::Outside)]);
            let face = face.or(target.scanned_face).map(|found| target.scanned_face = found);
            faces = radius_of.and(face);
        }
        table.finish();
        faces?;
        Ok(Self { shape: shape?, ..target })
    }
}

impl TargetShape {
    fn read(word: Word, table: &mut Table<'_>, plate: Option<Rectangle>) -> Result<Self, Reported> {
        match word {
            Word::Flat => Ok(Self::Flat),
            Word::Sphere => Ok(Self::Sphere { radius: radius(table, "radius_mm", plate)? }),
            Word::Cylinder => {
                let (axis, radius) = (axis(table), radius(table, "radius_mm", plate));
                Ok(Self::Cylinder { axis: axis?, radius: radius? })
            }
            Word::Torus => {
                let (axis, radius) = (axis(table), radius(table, "radius_mm", plate));
                let cross = table.number("cross_radius_mm");
                let cross = cross.check(|mm| reaches(mm.abs(), *mm, plate)).map(metres).required();
                Ok(Self::Torus { axis: axis?, radius: radius?, cross_radius: cross? })
            }
            Word::Cone => {
                let axis = axis(table);
                let start = radius(table, "radius_start_mm", plate);
                let end = table.number("radius_end_mm").check(|mm| reaches(*mm, *mm, plate)).map(metres);
                let end = end.located().required();
                let (axis, radius_start, end) = (axis?, start?, end?);
                slopes(table.document(), axis, radius_start, &end, plate)?;
                Ok(Self::Cone { axis, radius_start, radius_end: end.value })
            }
        }
    }
}

/// Direction of the straight lines. Required: no direction is the usual one.
fn axis(table: &mut Table<'_>) -> Result<f64, Reported> {
    table.number("axis_deg").in_range(-180.0..=180.0).map(f64::to_radians).required()
}

fn radius(table: &mut Table<'_>, key: &str, plate: Option<Rectangle>) -> Result<f64, Reported> {
    table.number(key).check(|mm| reaches(*mm, *mm, plate)).map(metres).required()
}

/// A radius is above zero and does not roll the plate's shorter side into more than a full turn.
fn reaches(radius_mm: f64, found: f64, plate: Option<Rectangle>) -> Result<(), String> {
    if radius_mm <= 0.0 {
        let advice = if found == 0.0 { "" } else { "; scanned_face says which way the plate bends" };
        return Err(format!("found {found}, must be above 0{advice}"));
    }
    let Some(plate) = plate else { return Ok(()) };
    let side = plate.width.min(plate.height);
    if side > TAU * metres(radius_mm) {
        let side = millimetres(side);
        return Err(format!(
            "found {found}, which would roll the plate's side of {side} mm up; is it in millimetres?"
        ));
    }
    Ok(())
}

/// A cone's radius cannot change by more than the length of its straight line.
fn slopes(
    document: &Document,
    axis: f64,
    start: f64,
    end: &Located<f64>,
    plate: Option<Rectangle>,
) -> Result<(), Reported> {
    let length = plate.map_or(f64::INFINITY, |plate| plate.through_middle(axis));
    if (end.value - start).abs() < length {
        return Ok(());
    }
    let (change, length) = (millimetres((end.value - start).abs()), millimetres(length));
    let message = format!(
        "the radius changes by {change} mm, but its straight line across the plate is only {length} mm long; \
         give the radii at the two ends of that line"
    );
    Err(document.fault(&end.place, message))
}
