//! Edges that run along a lattice line: their position between two columns is undetermined, and must be stated so.

#![allow(clippy::unwrap_used, reason = "test code")]

#[path = "support/synthetic.rs"]
mod synthetic;

use platen_shape::Vec3;
use platen_shape::extract::Extractor;
use platen_shape::outline::{Outline, outline};
use synthetic::{Plate, Receiver, Scene};

fn outline_of(scene: &Scene, around: f64) -> Outline {
    let (header, columns) = scene.scan_around(around);
    let mut extractor = Extractor::new(&header, &scene.spec());
    for column in &columns {
        extractor.push(column).unwrap();
    }
    outline(&extractor.finish().unwrap(), &scene.spec()).unwrap()
}

/// Returns the errors across edge `edge` at its two ends over their stated standard deviations, for an edge at several
/// places between two lines of the lattice.
fn ratios(name: &str, scene: &Scene, edge: usize) -> Vec<[f64; 2]> {
    const PLACES: u32 = 12;
    let plate = scene.plates[0];
    let truth = [(0.0, 0.0), (plate.width, 0.0), (plate.width, plate.height), (0.0, plate.height)]
        .map(|(u, v)| plate.face(u, v));
    let mut ratios = Vec::new();
    for place in 0..PLACES {
        let around = 0.08 + scene.step * (f64::from(place) + 0.5) / f64::from(PLACES);
        let scene = Scene { seed: u64::from(place), ..scene.clone() };
        let outline = outline_of(&scene, around);
        let inward = (truth[(edge + 3) % 4] - truth[edge]).normalize();
        let ends = [(edge, 1), ((edge + 1) % 4, 0)].map(|(corner, across)| {
            let found = &outline.corners[corner];
            ((found.point - truth[corner]).dot(&inward), found.sigma[across])
        });
        println!(
            "{name}: {:.2} of a step, off by {:.2?} mm, stated {:.2?} mm",
            (around - 0.08) / scene.step,
            ends.map(|(off, _)| off * 1e3),
            ends.map(|(_, sigma)| sigma * 1e3)
        );
        ratios.push(ends.map(|(off, sigma)| off / sigma));
    }
    ratios
}

fn check(name: &str, scene: &Scene, edge: usize) {
    // Where beams mix linearly, contrast and beam shape cause the same error at every place, up to the stated
    // deviation.
    let most_mean = if scene.receiver == Receiver::Anywhere { 0.5 } else { 1.0 };
    let ratios = ratios(name, scene, edge);
    for end in [0, 1] {
        let n = ratios.len() as f64;
        let mean = ratios.iter().map(|r| r[end]).sum::<f64>() / n;
        let rms = (ratios.iter().map(|r| r[end].powi(2)).sum::<f64>() / n).sqrt();
        println!("{name}: errors over stated deviations: mean {mean:.2}, rms {rms:.2}");
        assert!(mean.abs() < most_mean && (0.6..1.4).contains(&rms), "{name}, end {end}: {mean} {rms}");
    }
}

fn plate() -> Plate {
    Plate { centre: Vec3::new(6.0, 1.25, -3.6), turn: 0.0, ..Plate::rolled() }
}

/// Receiver with plates that are less bright than the prior of the contrast assumes.
const LINEAR: Receiver = Receiver::Linear { plates: 0.3 };

fn check_along_columns(receiver: Receiver) {
    // The edge v = 0, whose near end lies in the plane through the mirror's axis, turned about that end.
    for turn in [0.0, -0.7e-3, 1.5e-3, 6e-3] {
        let plate = Plate { turn, ..plate() };
        let shift = Plate { turn: 0.0, ..plate }.face(0.0, 0.0) - plate.face(0.0, 0.0);
        let scene = Scene { receiver, ..Scene::of(Plate { centre: plate.centre + shift, ..plate }) };
        check(&format!("turned by {turn}"), &scene, 0);
    }
}

#[test]
fn along_a_column_and_nearly_so() {
    check_along_columns(Receiver::Anywhere);
}

#[test]
fn along_a_column_and_nearly_so_by_linear_mixing() {
    check_along_columns(LINEAR);
}

fn check_along_a_row(receiver: Receiver) {
    // An upright plate whose upper edge u = W is at the height of the scanner.
    let upright = Plate {
        radius: None,
        tilt: std::f64::consts::FRAC_PI_2,
        centre: Vec3::new(5.0, 0.3, -1.5),
        ..plate()
    };
    check("along a row", &Scene { floor: -3.2, receiver, ..Scene::of(upright) }, 1);
}

#[test]
fn along_a_row() {
    check_along_a_row(Receiver::Anywhere);
}

#[test]
fn along_a_row_by_linear_mixing() {
    check_along_a_row(LINEAR);
}
