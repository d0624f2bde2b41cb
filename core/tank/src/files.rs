//! Writer of plate files and of the list of blanks.

use std::fmt::Write as _;

use platen_model::{Facing, TargetShape};

use crate::{Plate, Rule, Tank, Zone};

/// Returns the text of the plate file of a zone.
#[must_use]
pub fn plate_file(tank: &Tank, zone: &Zone, plate: &Plate) -> String {
    let mut text = String::new();
    // Writing to a String cannot fail.
    let _ = write_file(&mut text, tank, zone, plate);
    text
}

fn write_file(out: &mut String, tank: &Tank, zone: &Zone, plate: &Plate) -> std::fmt::Result {
    let mm = |metres: f64| format!("{:.1}", 1e3 * metres);
    let point = |[u, v]: [f64; 2]| format!("[{}, {}]", mm(u), mm(v));
    let quoted = |text: &str| format!("{text:?}");
    writeln!(
        out,
        "# Tank {}, zone {}: one of {} plates; u across the ring, v along its meridian.",
        tank.name, zone.name, zone.plates
    )?;
    writeln!(
        out,
        "# Made by `platen plate new`. Lengths to be measured on the formed plate, and figures of its forming:"
    )?;
    for check in &plate.checks {
        writeln!(out, "#   {}: {:.1} {}", check.what, check.value, check.unit)?;
    }
    writeln!(out, "\n[plate]\nid = {}", quoted(&zone.name))?;
    writeln!(out, "width_mm = {}\nheight_mm = {}", mm(plate.blank[0]), mm(plate.blank[1]))?;
    writeln!(out, "thickness_mm = {}", mm(zone.thickness))?;
    if let Some(supports) = &tank.supports {
        writeln!(out, "supports = {}", quoted(supports))?;
    }
    if let Some(steel) = &tank.steel {
        writeln!(out, "\n[steel]")?;
        if let Some(grade) = &steel.grade {
            writeln!(out, "grade = {}", quoted(grade))?;
        }
        writeln!(out, "yield_mpa = {:.1}", 1e-6 * steel.yield_strength)?;
    }
    writeln!(out, "\n[target]")?;
    let axis = |axis: f64| format!("axis_deg = {:.1}", axis.to_degrees());
    match plate.target.shape {
        TargetShape::Flat => writeln!(out, "shape = \"flat\"")?,
        TargetShape::Cylinder { radius, axis: along } => {
            writeln!(out, "shape = \"cylinder\"\nradius_mm = {}\n{}", mm(radius), axis(along))?;
        }
        TargetShape::Cone { axis: along, radius_start, radius_end } => writeln!(
            out,
            "shape = \"cone\"\nradius_start_mm = {}\nradius_end_mm = {}\n{}",
            mm(radius_start),
            mm(radius_end),
            axis(along)
        )?,
        TargetShape::Sphere { radius } => writeln!(out, "shape = \"sphere\"\nradius_mm = {}", mm(radius))?,
        TargetShape::Torus { axis: along, radius, cross_radius } => writeln!(
            out,
            "shape = \"torus\"\nradius_mm = {}\ncross_radius_mm = {}\n{}",
            mm(radius),
            mm(cross_radius),
            axis(along)
        )?,
    }
    let face = if plate.target.scanned_face == Facing::Inside { "inside" } else { "outside" };
    writeln!(out, "radius_of = \"mid\"\nscanned_face = \"{face}\"")?;
    for (name, [from, to]) in &plate.lines {
        writeln!(
            out,
            "\n[[reference_line]]\nname = {}\nfrom_mm = {}\nto_mm = {}",
            quoted(name),
            point(*from),
            point(*to)
        )?;
    }
    match zone.rule.and_then(|rule| tank.rules.get(rule)) {
        Some(rule) => write_templates(out, plate, rule)?,
        None => writeln!(out, "\n# No rule: without a [[template]] nothing is judged.")?,
    }
    let middle = [0.5 * plate.blank[0], 0.5 * plate.blank[1]];
    for (name, share) in [("left", 0.15), ("middle", 0.5), ("right", 0.85)] {
        let at = point([share * plate.blank[0], middle[1]]);
        writeln!(out, "\n[[station]]\nname = \"{name}\"\nat_mm = {at}\nquantity = \"curvature_deficit\"")?;
    }
    for line in &plate.trim {
        let points: Vec<String> = line.points.iter().map(|at| point(*at)).collect();
        writeln!(out, "\n[[trim_line]]\nname = {}\npoints_mm = [{}]", quoted(&line.name), points.join(", "))?;
    }
    Ok(())
}

fn write_templates(out: &mut String, plate: &Plate, rule: &Rule) -> std::fmt::Result {
    let Some([chord, limit]) = rule.limit else {
        return writeln!(
            out,
            "\n# {}: nobody has typed in board and limit of this rule. It judges nothing; fill them in in the tank file.",
            rule.clause
        );
    };
    let (long, short) = plate.templates(rule);
    if !short.is_empty() {
        writeln!(
            out,
            "\n# Shorter than the board of {:.0} mm, so without a template: {}.",
            1e3 * chord,
            short.join(", ")
        )?;
    }
    for name in long {
        writeln!(
            out,
            "\n[[template]]\nname = {name:?}\nline = {name:?}\nchord_mm = {:.1}\ncentre_mm = \"worst\"\nlimit_mm = {:.2}\nsource = {:?}",
            1e3 * chord,
            1e3 * limit,
            rule.source()
        )?;
    }
    Ok(())
}

/// Returns the list of blanks as CSV: one line for each zone with its plate.
///
/// # Errors
/// A message of the writer.
pub fn blank_list<'a>(
    tank: &Tank,
    plates: impl Iterator<Item = (&'a Zone, &'a Plate)>,
) -> Result<Vec<u8>, String> {
    let mut out = csv::Writer::from_writer(Vec::new());
    let head = [
        "zone",
        "recipe",
        "count",
        "width_mm",
        "height_mm",
        "thickness_mm",
        "mass_kg",
        "allowance_mm",
        "grade",
    ];
    out.write_record(head).map_err(|e| e.to_string())?;
    for (zone, plate) in plates {
        let mm = |metres: f64| format!("{:.1}", 1e3 * metres);
        let grade = tank.steel.as_ref().and_then(|steel| steel.grade.clone()).unwrap_or_default();
        let row = [
            zone.name.clone(),
            zone.recipe.to_string(),
            zone.plates.to_string(),
            mm(plate.blank[0]),
            mm(plate.blank[1]),
            mm(zone.thickness),
            format!("{:.0}", plate.mass),
            mm(plate.allowance),
            grade,
        ];
        out.write_record(row).map_err(|e| e.to_string())?;
    }
    out.into_inner().map_err(|e| e.to_string())
}
