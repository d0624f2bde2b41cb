//! Faults of the light and of the scanner's stand: from the simulator's bridge over a socket through
//! the driver library to the measured plate, against the truth of the simulator. The plate is measured within bounds, or
//! refused with one sentence; it is never measured wrong.
//!
//! | fault | test | outcome: corners, mid-surface along its normal (rms of a 9 x 9 grid) |
//! |---|---|---|
//! | none | `undisturbed` | 2 mm, 0.1 mm |
//! | mixed pixels at the edges | `mixed_pixels` | 3 mm, 0.1 mm |
//! | hole in the mirror lobe of bright metal, at an edge | `specular_hole` | refused: "plate: the plate's width measures .." |
//! | dark plate: three times the noise | `dark_noise` | 4 mm, 0.2 mm |
//! | cyclic range bias of 0.3 mm | `cyclic_bias` | 3 mm, 0.4 mm |
//! | angular noise of 30 urad | `angular_noise` | 3 mm, 0.2 mm |
//! | scanner leaning by 4 degrees | `inclination` | 3 mm, 0.1 mm |
//! | warm-up columns | `warm_up_columns` | left out |
//! | a person and a chain before the plate | `stray_and_occluded` | 6 mm, 0.5 mm |
//! | seen under more than 75 degrees | `grazing` | refused: "scan: .." or "plate: .." |
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod stream;

use platen_host::plugin::{Catalogue, JobSpec};
use platen_host::rig::Rig;
use platen_host::stroke::{self, NotMeasured};
use platen_plant::PlantFile;
use platen_shape::{PlateSpec, Vec3};
use platen_sim_plate::{Plate, PlateState, Pose};
use platen_sim_scanner::stream::{BridgeConfig, Shop};
use platen_sim_scanner::{Cyclic, Instrument, Surroundings};
use stream::{LIMIT, driver, plate, start};

/// What is wrong: with the scanner, the shop or how the plate lies.
struct Scene {
    instrument: Instrument,
    surroundings: Surroundings,
    plate: PlateState,
}

impl Default for Scene {
    fn default() -> Self {
        let (instrument, surroundings) =
            (Instrument { warm_up_columns: 10, ..Instrument::default() }, Surroundings::default());
        Self { instrument, surroundings, plate: plate() }
    }
}

/// Errors of a measurement, metres.
#[derive(Debug)]
struct Found {
    corners: f64,
    surface: f64,
}

fn measure(scene: Scene) -> Result<Found, NotMeasured> {
    let state = scene.plate.clone();
    let shop = Shop {
        surroundings: scene.surroundings,
        instrument: scene.instrument,
        noise: Some(scene.instrument.range_sigma),
        threads: 2,
        ..Shop::new(Box::new(move || Ok(Some(state.clone()))))
    };
    let bridge = start(&[], BridgeConfig::default(), shop);
    let scanner = driver(bridge.address(), "divisor = 8\nrate_kpts = 122");
    let text =
        "[plant]\nname = 't'\n[flattening]\nplugin = 'harmonic'\n[[comparison]]\nplugin = 'template'\n";
    let plant = PlantFile::parse("plant.toml", text).unwrap();
    let mut rig = Rig::of(&plant, &Catalogue::new(Some(platen_tests::built()))).unwrap();
    let truth = Plate::new(&scene.plate).unwrap();
    let [width, height, thickness] = [truth.width(), truth.height(), truth.thickness()];
    let u_axis = Some(truth.corners()[1] - truth.corners()[0]).map(|u| Vec3::new(u.x, u.y, u.z));
    let spec = PlateSpec { width, height, thickness, face_inset: 0.0, u_axis, region: None };
    let scanned = stroke::scan(&scanner, JobSpec::untriggered(LIMIT), None, &spec, None)?;
    assert_eq!(scanned.warm_up_columns, scene.instrument.warm_up_columns);
    let measured = stroke::measure_scanned(&mut rig, &scanned, &spec, None)?;

    let corner = |k: usize| (measured.outline.corners[k].point - truth.corners()[k]).norm();
    let surface = &measured.measurement.surface;
    let mut squares = 0.0;
    for k in 0..81 {
        // Not the last centimetres, which are the edge's.
        let share = |i: usize| 0.05 + 0.9 * i as f64 / 8.0;
        let (u, v) = (share(k % 9) * width, share(k / 9) * height);
        squares += (surface.point(u, v) - truth.mid(u, v)).dot(&truth.normal(u, v)).powi(2);
    }
    let corners = (0..4).map(corner).fold(0.0, f64::max);
    Ok(Found { corners, surface: (squares / 81.0).sqrt() })
}

#[track_caller]
fn survives(corners_mm: f64, surface_mm: f64, scene: Scene) {
    let found = measure(scene).unwrap_or_else(|error| panic!("{error}"));
    println!("corners {:.2} mm, surface {:.3} mm", 1e3 * found.corners, 1e3 * found.surface);
    assert!(found.corners < 1e-3 * corners_mm && found.surface < 1e-3 * surface_mm, "{found:?}");
}

/// Measured within bounds, or refused with a sentence.
#[track_caller]
fn never_wrong(corners_mm: f64, surface_mm: f64, scene: Scene) {
    match measure(scene) {
        Ok(found) => {
            assert!(found.corners < 1e-3 * corners_mm && found.surface < 1e-3 * surface_mm, "{found:?}");
        }
        Err(refused) => {
            let sentence = refused.to_string();
            println!("{sentence}");
            assert!(sentence.starts_with("scan: ") || sentence.starts_with("plate: "), "{sentence}");
        }
    }
}

#[test]
fn undisturbed() {
    survives(2.0, 0.1, Scene::default());
}

#[test]
fn mixed_pixels() {
    let instrument = Instrument { footprint: 1.2e-3, ..Scene::default().instrument };
    survives(3.0, 0.1, Scene { instrument, ..Scene::default() });
}

#[test]
fn specular_hole() {
    // The plate stands up to the scanner, which looks into its mirror lobe.
    let pose = Pose { pitch_deg: -50.0, ..Pose::default() };
    let instrument = Instrument { specular_lobe: Some(0.06), ..Scene::default().instrument };
    never_wrong(3.0, 0.2, Scene { instrument, plate: PlateState { pose, ..plate() }, ..Scene::default() });
}

#[test]
fn dark_noise() {
    let instrument = Instrument { range_sigma: 1.5e-3, dropout: 0.05, ..Scene::default().instrument };
    survives(4.0, 0.2, Scene { instrument, ..Scene::default() });
}

#[test]
fn cyclic_bias() {
    let cyclic = Some(Cyclic { amplitude: 0.3e-3, period: 1.2, phase: 0.0 });
    let instrument = Instrument { cyclic, ..Scene::default().instrument };
    survives(3.0, 0.4, Scene { instrument, ..Scene::default() });
}

#[test]
fn angular_noise() {
    let instrument = Instrument { angular_sigma: 30e-6, ..Scene::default().instrument };
    survives(3.0, 0.2, Scene { instrument, ..Scene::default() });
}

#[test]
fn inclination() {
    // Seen from a scanner that leans, the plate leans.
    let pose = Pose { pitch_deg: 4.0, roll_deg: -2.0, ..Pose::default() };
    survives(3.0, 0.1, Scene { plate: PlateState { pose, ..plate() }, ..Scene::default() });
}

#[test]
fn warm_up_columns() {
    // 40 columns, 2.8 degrees, of ranges that scatter by centimetres, beside the plate.
    let instrument = Instrument { warm_up_columns: 40, ..Scene::default().instrument };
    survives(2.0, 0.1, Scene { instrument, ..Scene::default() });
}

#[test]
fn stray_and_occluded() {
    let surroundings = Surroundings { person_in_front: true, chain: true, ..Surroundings::default() };
    survives(6.0, 0.5, Scene { surroundings, ..Scene::default() });
}

#[test]
fn grazing() {
    let pose = Pose { centre_mm: [11_000.0, 0.0, -1_800.0], ..Pose::default() };
    never_wrong(30.0, 1.0, Scene { plate: PlateState { pose, ..plate() }, ..Scene::default() });
}
