//! What happens in a shop, on closed-form plates: bends, noise, grazing sight, people in the way, two plates, none.

#![allow(clippy::unwrap_used, reason = "test code")]

#[path = "support/synthetic.rs"]
mod synthetic;

use platen_scan::{Column, ScanHeader};
use platen_shape::extract::{Extractor, Refusal};
use platen_shape::outline::outline;
use platen_shape::{Outline, Patch, PlateSpec, RegionOfInterest, Vec3};
use synthetic::{Plate, Scene};

fn plate() -> Plate {
    Plate {
        width: 3.0,
        height: 2.5,
        thickness: 0.036,
        radius: Some(9.0),
        centre: Vec3::new(6.0, 0.4, -3.6),
        turn: 0.4,
        tilt: 0.0,
    }
}

/// A scan's face, with the outcome that tells a test more than a panic.
fn extract(header: &ScanHeader, columns: &[Column], spec: &PlateSpec) -> Result<Patch, Refusal> {
    let mut extractor = Extractor::new(header, spec);
    for column in columns {
        assert_eq!(extractor.push(column), Ok(()));
    }
    extractor.finish()
}

fn measure(scene: &Scene) -> (Patch, Outline) {
    let (header, columns) = scene.scan();
    let patch = extract(&header, &columns, &scene.spec()).unwrap();
    let outline = outline(&patch, &scene.spec()).unwrap();
    (patch, outline)
}

/// Distance of the corners from the truth, metres, by corner.
fn corners_off(scene: &Scene, outline: &Outline) -> [f64; 4] {
    let p = &scene.plates[0];
    let truth = [(0.0, 0.0), (p.width, 0.0), (p.width, p.height), (0.0, p.height)];
    [0, 1, 2, 3].map(|k| (outline.corners[k].point - p.face(truth[k].0, truth[k].1)).norm())
}

fn rms(off: [f64; 4]) -> f64 {
    (off.iter().map(|d| d * d).sum::<f64>() / 4.0).sqrt()
}

fn check(name: &str, scene: &Scene, corner_limit: f64) {
    let (patch, outline) = measure(scene);
    let off = corners_off(scene, &outline);
    println!(
        "{name}: {} samples, noise {:.2} mm, corners {:.2} mm rms, {:.2?} mm",
        patch.samples.len(),
        patch.noise * 1e3,
        rms(off) * 1e3,
        off.map(|d| d * 1e3)
    );
    assert!(rms(off) < corner_limit, "{name}");
    assert!(outline.corners.iter().all(|c| c.seen));
}

#[test]
fn flat_concave_and_convex() {
    check("flat", &Scene::of(Plate { radius: None, ..plate() }), 1e-3);
    check("concave", &Scene::of(plate()), 1e-3);
    check("convex", &Scene::of(Plate { radius: Some(-9.0), ..plate() }), 1e-3);
    check("strong bend", &Scene::of(Plate { radius: Some(5.0), ..plate() }), 1e-3);
}

#[test]
fn noise_of_two_millimetres_with_heavy_tails() {
    let scene = Scene { sigma: 2e-3, tails: 0.05, dropouts: 0.02, ..Scene::of(plate()) };
    check("noise", &scene, 2.5e-3);
}

#[test]
fn bent_along_the_line_of_sight() {
    // The far end falls away nearly as fast as the sight line: seen from 40 to 81 degrees off the normal.
    let plate = Plate {
        width: 5.0,
        height: 2.0,
        radius: Some(-10.0),
        turn: 0.0,
        centre: Vec3::new(5.6, 0.0, -3.2),
        ..plate()
    };
    check("grazing", &Scene { step: 0.035_f64.to_radians(), ..Scene::of(plate) }, 2e-3);
}

#[test]
fn a_person_hides_a_corner_and_part_of_an_edge() {
    let corner = plate().face(0.0, 0.0);
    let scene = Scene { people: vec![[corner.x - 0.25, corner.y, 0.22, -4.5, -2.9]], ..Scene::of(plate()) };
    let (_, outline) = measure(&scene);
    let off = corners_off(&scene, &outline);
    println!("corners {:.2?} mm, seen {:?}", off.map(|d| d * 1e3), outline.corners.map(|c| c.seen));
    assert!(!outline.corners[0].seen && (1..4).all(|k| outline.corners[k].seen));
    assert!(off[0] < 8e-3 && off[1..].iter().all(|d| *d < 1.5e-3));
}

#[test]
fn two_plates_none_and_a_cut_one_are_refused() {
    let mut scene = Scene::of(plate());
    scene.plates.push(Plate { centre: Vec3::new(6.0, 4.5, -3.6), ..plate() });
    let (header, columns) = scene.scan();
    let refusal = extract(&header, &columns, &scene.spec()).err().unwrap();
    println!("{refusal}");
    assert!(matches!(refusal, Refusal::SeveralPlates { count: 2, .. }));
    let mut spec = scene.spec();
    let region =
        |max_y: f64| RegionOfInterest { min: Vec3::new(2.0, -4.0, -4.3), max: Vec3::new(9.0, max_y, -2.0) };
    spec.region = Some(region(2.5));
    assert!(extract(&header, &columns, &spec).is_ok());
    spec.region = Some(region(1.8));
    let refusal = extract(&header, &columns, &spec).err().unwrap();
    println!("{refusal}");
    assert!(matches!(refusal, Refusal::CutByRegion { .. }));
    spec.region = Some(region(-3.0));
    let refusal = extract(&header, &columns, &spec).err().unwrap();
    println!("{refusal}");
    assert!(matches!(refusal, Refusal::NoPlate { region: true, .. }));
}

#[test]
fn a_seam_between_the_faces_and_warm_up_columns() {
    let scene = Scene::of(plate());
    let (mut header, mut columns) = scene.scan();
    let seam = header.n_columns / 2;
    header.seam_column = Some(seam);
    // The second face is 1.5 mm farther, and the first columns of both are no measurement.
    for column in &mut columns[seam as usize..] {
        column.range_m.iter_mut().for_each(|r| *r += 1.5e-3);
    }
    for start in [0, seam as usize] {
        for column in &mut columns[start..start + 10] {
            column.range_m.iter_mut().for_each(|r| *r *= 1.02);
        }
    }
    let mut extractor = Extractor::new(&header, &scene.spec());
    for column in &columns {
        extractor.push(column).unwrap();
    }
    extractor.leave_out_warm_up(10);
    let patch = extractor.finish().unwrap();
    assert!(patch.samples.iter().all(|s| !(seam..seam + 10).contains(&s.column)));
    let outline = outline(&patch, &scene.spec()).unwrap();
    let off = corners_off(&scene, &outline);
    println!("corners {:.2?} mm", off.map(|d| d * 1e3));
    assert!(rms(off) < 2.5e-3);
}
