//! Tank geometry against closed forms and a published example.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use std::f64::consts::{FRAC_PI_2, PI};

use platen_model::TargetShape;
use platen_plant::PlateFile;
use platen_tank::{Membrane, Plate, Revolution, Tank, blank_list, plate_file};
use proptest::prelude::*;

const HEAD: &str = "[tank]\nname = \"T\"\nradius_of = \"mid\"\n";

fn tank(text: &str) -> Tank {
    Tank::parse("tank.toml", &format!("{HEAD}{text}")).unwrap()
}

fn only_plate(text: &str) -> (Tank, Plate) {
    let tank = tank(text);
    let plate = Plate::of(&tank, &tank.zones[0]);
    (tank, plate)
}

fn check(plate: &Plate, what: &str) -> f64 {
    plate
        .checks
        .iter()
        .find(|check| check.what == what)
        .unwrap_or_else(|| panic!("no {what}: {:?}", plate.checks))
        .value
}

#[track_caller]
fn near(found: f64, wanted: f64, within: f64) {
    assert!((found - wanted).abs() <= within, "{found} for {wanted}");
}

/// 18 plates around R 9 m with gaps of 3 mm: W = (2 pi R - n g) / n, chord 2 R sin(W / 2 R) less half a thickness.
#[test]
fn course_of_a_cylinder() {
    let (_, plate) = only_plate(
        "root_gap_mm = 3.0\n[[zone]]\nname = \"c\"\nrecipe = 1\nshape = \"cylinder\"\nradius_mm = 9000.0\nheight_mm = 2500.0\nthickness_mm = 36.0\nplates = 18\n",
    );
    let width = 2.0 * PI * 9.0 / 18.0 - 0.003;
    near(plate.blank[0], width, 1e-12);
    near(plate.blank[1], 2.5, 1e-12);
    near(check(&plate, "chord across, v small"), 2e3 * (9.0 - 0.018) * (width / 18.0).sin(), 1e-9);
    near(check(&plate, "cold forming strain"), 0.2, 1e-12);
    assert_eq!(plate.target.shape, TargetShape::Cylinder { radius: 9.0, axis: FRAC_PI_2 });
}

/// Net of a frustum, "The Net of a Frustum", ceemrr.com/Geometry2: ducts of radii 2.5 and 4 inches, 4 inches apart,
/// hence slant radii of 7.12 and 11.39 inches and a sector of 126.4 degrees; here in units of 100 mm, in three plates.
#[test]
fn published_frustum() {
    let slant = (4.0_f64.powi(2) + 1.5_f64.powi(2)).sqrt();
    let (_, plate) = only_plate(&format!(
        "[[zone]]\nname = \"f\"\nrecipe = 1\nshape = \"cone\"\nradius_start_mm = 250.0\nradius_end_mm = 400.0\nslant_mm = {}\nthickness_mm = 5.0\nplates = 3\n",
        100.0 * slant
    ));
    let half = (126.4_f64 / 6.0).to_radians();
    near(plate.blank[0], 2.0 * 1.139 * half.sin(), 1e-3);
    near(plate.blank[1], 1.139 - 0.712 * half.cos(), 1e-3);
    // Ends of the middle line: radius of normal curvature, slant radius times tan of the half angle.
    let TargetShape::Cone { radius_start, radius_end, .. } = plate.target.shape else {
        panic!("{:?}", plate.target)
    };
    let tan = 1.5 / 4.0;
    near(radius_start, 0.712 * half.cos() * tan, 1e-3);
    near(radius_end, 1.139 * tan, 1e-3);
}

/// D 18 m, 24 petals from 55 to 90 degrees: half widths 1.178 m at the equator, 0.964 m at 55 degrees.
#[test]
fn petal_of_a_sphere() {
    let (tank, plate) = only_plate(
        "allowance_mm = 20.0\n[[zone]]\nname = \"s\"\nrecipe = 1\nshape = \"sphere\"\nradius_mm = 9000.0\nfrom_deg = 55.0\nto_deg = 90.0\nthickness_mm = 36.0\nplates = 24\n",
    );
    // The formed petal, from the blank's material.
    let membrane = Membrane::new(plate.blank, 1.0 / 81.0);
    let half = plate.blank.map(|side| 0.5 * side);
    let formed = |at: &[f64; 2]| membrane.formed([at[0] - half[0], at[1] - half[1]]);
    let seam: Vec<[f64; 2]> = plate.trim[1].points.iter().map(formed).collect();
    near(seam[12][0], 1.178, 5e-4);
    near(seam[0][0], 0.964, 5e-4);
    near(seam[12][0], 9.0 * PI / 24.0, 1e-6);
    // The middle of a petal three times as long as wide is nearly that of a long strip, W^2 / 24 R^2.
    let wide = plate.blank[0] * plate.blank[0] / (24.0 * 81.0);
    near(check(&plate, "the same along v"), 100.0 * wide, 8.0 * wide);
    // Blank and trimmed plate differ by the allowance only.
    let low = plate.trim.iter().flat_map(|line| &line.points).map(|at| at[1]).fold(f64::INFINITY, f64::min);
    near(low, 0.02, 1e-9);
    near(check(&plate, "cold forming strain"), 0.3, 1e-12);
    assert_eq!(tank.zones[0].surface.cross_radius(0.3), 9.0);
}

/// A place on the sphere is recovered from its (u, v): along the middle meridian, then across it.
#[test]
fn sphere_is_developed_along_great_circles() {
    let surface = Revolution::Torus { radius: 9.0, centre: 0.0, from: 0.5, to: 2.4 };
    proptest!(|(t in 0.0..1.0, turn in -0.4..0.4)| {
        let [u, v] = surface.develop(t, turn);
        let [x, y, z] = surface.point(t, turn, 0.0);
        let (across, along) = (u / 9.0, v / 9.0);
        let found = [9.0 * across.cos() * along.sin(), 9.0 * across.sin(), 9.0 * across.cos() * along.cos()];
        for (a, b) in [x, y, z].iter().zip(found) {
            prop_assert!((a - b).abs() < 1e-12, "{x} {y} {z}: {found:?}");
        }
    });
}

/// Cylinder and cone are developed without stretching: short distances are kept.
#[test]
fn single_curvature_keeps_lengths() {
    let cone = Revolution::Cone { from: 3.0, to: 4.0, slant: 2.5 };
    let cylinder = Revolution::Cylinder { radius: 9.0, height: 2.5 };
    proptest!(|(t in 0.0..0.99, turn in -0.4..0.4, way in 0.0..6.3, cone_first: bool)| {
        let surface = if cone_first { cone } else { cylinder };
        let step = 1e-4;
        let (t2, turn2) = (t + step * f64::cos(way), turn + step * f64::sin(way));
        let flat = surface.develop(t, turn).iter().zip(surface.develop(t2, turn2)).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
        let round = surface.point(t, turn, 0.0).iter().zip(surface.point(t2, turn2, 0.0)).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
        // The chord is shorter than the arc by the third order of the step.
        prop_assert!((flat / round - 1.0).abs() < 1e-7, "{flat} {round}");
    });
}

/// On a knuckle the development is correct to the second order: a seam has the length of its meridian.
#[test]
fn knuckle_seam_has_its_length() {
    let (radius, centre, turn, steps) = (1.5, 6.0, PI / 24.0, 12_u32);
    let [from, to] = [20_f64, 90.0].map(f64::to_radians);
    let surface = Revolution::Torus { radius, centre, from, to };
    // In these coordinates a length along v is longer than on the surface by K u^2 / 2.
    let on_surface = |k: u32| {
        let [a, b] = [k, k + 1].map(|k| surface.develop(f64::from(k) / f64::from(steps), turn));
        let polar = from + (to - from) * (f64::from(k) + 0.5) / f64::from(steps);
        let curvature = polar.sin() / (radius * (centre + radius * polar.sin()));
        let u = 0.5 * (a[0] + b[0]);
        (b[0] - a[0]).hypot((b[1] - a[1]) * (1.0 - 0.5 * curvature * u * u))
    };
    let length: f64 = (0..steps).map(on_surface).sum();
    // Found: 2 mm.
    near(length, surface.length(), 0.004);
    near(surface.develop(1.0, turn)[0], (radius + centre) * turn, 1e-12);
}

#[test]
fn too_wide_for_the_mill_names_the_number_that_fits() {
    let text = format!(
        "{HEAD}[mill]\nwidth_mm = 3000.0\nlength_mm = 12000.0\n[[zone]]\nname = \"c\"\nrecipe = 1\nshape = \"cylinder\"\nradius_mm = 9000.0\nheight_mm = 13000.0\nthickness_mm = 36.0\nplates = 18\n\
         [[zone]]\nname = \"d\"\nrecipe = 2\nshape = \"cylinder\"\nradius_mm = 9000.0\nheight_mm = 9000.0\nthickness_mm = 36.0\nplates = 18\n"
    );
    let faults = Tank::parse("t.toml", &text).unwrap_err().to_string();
    assert_eq!(
        faults,
        "t.toml:7:1: zone[1]: 18 plates need blanks of 3142 x 13000 mm, 11542 kg, which [mill] has not; no number of plates fits: make the zone shorter\n\
         t.toml:15:1: zone[2]: 18 plates need blanks of 3142 x 9000 mm, 7990 kg, which [mill] has not; 19 plates or more fit"
    );
}

/// Every plate file that is written can be read and contains the data from which it was made.
#[test]
fn plate_files_are_sound() {
    let text = "root_gap_mm = 3.0\nallowance_mm = 20.0\n[steel]\ngrade = \"SM490\"\nyield_mpa = 440.0\n\
        [[rule]]\nname = \"petal\"\nchord_mm = 2000.0\nlimit_mm = 3.0\nclause = \"trade practice\"\nedition = \"2024\"\ntyped_by = \"KM\"\n\
        [[rule]]\nname = \"empty\"\nclause = \"API 620, 6.5\"\n\
        [[zone]]\nname = \"c\"\nrecipe = 1\nrule = \"petal\"\nshape = \"cylinder\"\nradius_mm = 9000.0\nheight_mm = 2500.0\nthickness_mm = 36.0\nplates = 18\n\
        [[zone]]\nname = \"f\"\nrecipe = 2\nrule = \"petal\"\nshape = \"cone\"\nradius_start_mm = 4000.0\nradius_end_mm = 5000.0\nslant_mm = 3000.0\nthickness_mm = 20.0\nplates = 12\n\
        [[zone]]\nname = \"s\"\nrecipe = 3\nrule = \"petal\"\nshape = \"sphere\"\nradius_mm = 9000.0\nfrom_deg = 55.0\nto_deg = 90.0\nthickness_mm = 36.0\nplates = 24\n\
        [[zone]]\nname = \"k\"\nrecipe = 4\nrule = \"empty\"\nshape = \"torus\"\nradius_mm = 1500.0\ncentre_radius_mm = 6000.0\nfrom_deg = 20.0\nto_deg = 90.0\nthickness_mm = 20.0\nplates = 24\n";
    let tank = tank(text);
    let files = tank.zones.iter().map(|zone| plate_file(&tank, zone, &Plate::of(&tank, zone)));
    let files: Vec<PlateFile> = files
        .map(|text| PlateFile::parse("p.toml", &text).unwrap_or_else(|e| panic!("{e}\n{text}")))
        .collect();
    let counts: Vec<_> = files
        .iter()
        .map(|file| (file.reference_lines.len(), file.templates.len(), file.trim_lines.len()))
        .collect();
    assert_eq!(counts, [(3, 3, 4), (3, 3, 4), (6, 5, 4), (6, 0, 4)]);
    assert_eq!(files[0].templates[0].source.as_deref(), Some("trade practice, edition 2024, typed in by KM"));
    assert_eq!(files[2].target.unwrap().shape, TargetShape::Sphere { radius: 9.0 });
}

#[test]
fn the_example_makes_plates() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/tank.toml");
    let tank = Tank::load(&path).unwrap_or_else(|e| panic!("{e}"));
    for zone in &tank.zones {
        let text = plate_file(&tank, zone, &Plate::of(&tank, zone));
        let file = PlateFile::parse("p.toml", &text).unwrap_or_else(|e| panic!("{e}\n{text}"));
        assert_eq!(file.plate.id, zone.name);
    }
    let plates: Vec<Plate> = tank.zones.iter().map(|zone| Plate::of(&tank, zone)).collect();
    let list = blank_list(&tank, tank.zones.iter().zip(&plates)).unwrap();
    assert_eq!(list.iter().filter(|byte| **byte == b'\n').count(), 5);
}

/// Any tank of the trade gives plate files that can be read.
#[test]
fn every_zone_gives_a_sound_plate_file() {
    let lengths = (2000.0..20_000.0, 800.0..6000.0, 8.0..60.0, 12..60_u32, 0.0..6.0, 0.0..60.0);
    proptest!(|((radius, height, thickness, plates, gap, allowance) in lengths, shape in 0..4_usize)| {
        let shape = match shape {
            0 => format!("shape = \"cylinder\"\nradius_mm = {radius}\nheight_mm = {height}\n"),
            1 => format!("shape = \"cone\"\nradius_start_mm = {radius}\nradius_end_mm = {}\nslant_mm = {height}\n", radius + 0.5 * height),
            2 => format!("shape = \"sphere\"\nradius_mm = {radius}\nfrom_deg = 60.0\nto_deg = {}\n", 60.0 + f64::to_degrees(height / radius).min(50.0)),
            _ => format!("shape = \"torus\"\nradius_mm = 2000.0\ncentre_radius_mm = {radius}\nfrom_deg = 40.0\nto_deg = 90.0\n"),
        };
        let text = format!("{HEAD}root_gap_mm = {gap}\nallowance_mm = {allowance}\n[[zone]]\nname = \"z\"\nrecipe = 1\nthickness_mm = {thickness}\nplates = {plates}\n{shape}");
        let tank = Tank::parse("t.toml", &text).unwrap();
        let text = plate_file(&tank, &tank.zones[0], &Plate::of(&tank, &tank.zones[0]));
        let file = PlateFile::parse("p.toml", &text);
        prop_assert!(file.is_ok(), "{}\n{text}", file.unwrap_err());
    });
}
