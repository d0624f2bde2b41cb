//! Table `[target]`: the shape toward which the plate is bent, each shape with its own keys.

use std::f64::consts::TAU;

use platen_model::{FLATTEST_CONE, Facing, RadiusOf, Target, TargetShape};

use super::place::Rectangle;
use crate::document::Reported;
use crate::key::Located;
use crate::unit::{metres, millimetres};
use crate::{Document, TomlTable};

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

pub(super) fn read(mut table: TomlTable<'_>, plate: Option<Rectangle>) -> Result<Target, Reported> {
    let word = table.choice("shape", SHAPES).required();
    let shape = word.and_then(|word| shape_of(word, &mut table, plate));
    if let Err(reported) = word {
        // A target of unknown shape may have the keys of every shape.
        table.excuse_missing(reported);
        for (_, word) in SHAPES {
            let _ = shape_of(*word, &mut table, plate);
        }
    }
    let mut target =
        Target { shape: TargetShape::Flat, radius_of: RadiusOf::Inside, scanned_face: Facing::Inside };
    let mut faces = Ok(());
    if !matches!(word, Ok(Word::Flat)) {
        let radius_of = table.choice(
            "radius_of",
            &[("inside", RadiusOf::Inside), ("outside", RadiusOf::Outside), ("mid", RadiusOf::Mid)],
        );
        let radius_of = radius_of.or(target.radius_of).map(|found| target.radius_of = found);
        let face = table.choice("scanned_face", &[("inside", Facing::Inside), ("outside", Facing::Outside)]);
        let face = face.or(target.scanned_face).map(|found| target.scanned_face = found);
        faces = radius_of.and(face);
    }
    table.finish();
    faces?;
    Ok(Target { shape: shape?, ..target })
}

fn shape_of(
    word: Word,
    table: &mut TomlTable<'_>,
    plate: Option<Rectangle>,
) -> Result<TargetShape, Reported> {
    match word {
        Word::Flat => Ok(TargetShape::Flat),
        Word::Sphere => Ok(TargetShape::Sphere { radius: radius(table, "radius_mm", plate)? }),
        Word::Cylinder => {
            let (axis, radius) = (axis(table), radius(table, "radius_mm", plate));
            Ok(TargetShape::Cylinder { axis: axis?, radius: radius? })
        }
        Word::Torus => {
            let (axis, radius) = (axis(table), radius(table, "radius_mm", plate));
            let cross = table.number("cross_radius_mm");
            let cross = cross.check(|mm| reaches(mm.abs(), *mm, plate)).map(metres).required();
            Ok(TargetShape::Torus { axis: axis?, radius: radius?, cross_radius: cross? })
        }
        Word::Cone => {
            let axis = axis(table);
            let start = radius(table, "radius_start_mm", plate);
            let end = table.number("radius_end_mm").check(|mm| reaches(*mm, *mm, plate)).map(metres);
            let end = end.located().required();
            let (axis, radius_start, end) = (axis?, start?, end?);
            slopes(table.document(), axis, radius_start, &end, plate)?;
            Ok(TargetShape::Cone { axis, radius_start, radius_end: end.value })
        }
    }
}

/// Reads the direction of the straight lines, which has no default.
fn axis(table: &mut TomlTable<'_>) -> Result<f64, Reported> {
    table.number("axis_deg").in_range(-180.0..=180.0).map(f64::to_radians).required()
}

fn radius(table: &mut TomlTable<'_>, key: &str, plate: Option<Rectangle>) -> Result<f64, Reported> {
    table.number(key).check(|mm| reaches(*mm, *mm, plate)).map(metres).required()
}

/// Refuses a radius of zero or less, or one that rolls the plate's shorter side into more than a full turn.
fn reaches(radius_mm: f64, found: f64, plate: Option<Rectangle>) -> Result<(), String> {
    if radius_mm <= 0.0 {
        let advice = if found == 0.0 { "" } else { "; scanned_face decides which way the plate bends" };
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

/// Refuses a cone that is practically flat.
fn slopes(
    document: &Document,
    axis: f64,
    start: f64,
    end: &Located<f64>,
    plate: Option<Rectangle>,
) -> Result<(), Reported> {
    let length = plate.map_or(f64::INFINITY, |plate| plate.through_middle(axis));
    if (end.value - start).abs() < FLATTEST_CONE * length {
        return Ok(());
    }
    let (change, length) = (millimetres((end.value - start).abs()), millimetres(length));
    let message = format!(
        "the radius changes by {change} mm along a straight line of {length} mm, a cone as good as flat; \
         give the radii of curvature at the two ends of that line"
    );
    Err(document.fault(&end.place, message))
}
