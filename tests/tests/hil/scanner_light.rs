//! Optical faults and errors of the instrument and of its pose, with a bound for each.
//!
//! A scan by the simulator's bridge, transferred over a socket by the driver library, is measured and compared with the
//! known plate. The result is within the bounds of the table, or the plate is refused with one sentence.
//!
//! | fault | test | bounds: largest error of the corners, rms of the mid-surface along its normal (9 x 9 grid) |
//! |---|---|---|
//! | none | `no_fault` | 0.8 mm, 0.01 mm |
//! | mixed pixels at the edges | `mixed_pixels_at_the_edges` | 0.8 mm, 0.01 mm |
//! | hole by specular reflection on bright metal, through an edge | `a_specular_hole_through_an_edge` | 0.5 mm, 0.01 mm |
//! | specular lobe along an edge, whose ends are seen | `a_specular_lobe_along_an_edge` | 0.35 mm, 0.01 mm |
//! | specular lobe as wide as the plate | `an_edge_in_the_specular_lobe_is_refused` | refused: "scan: the face .. measures about .." |
//! | dark plate: three times the noise, 5 % of the echoes lost | `a_dark_plate` | 1.0 mm, 0.025 mm |
//! | cyclic range error of 0.3 mm | `cyclic_range_error` | 0.9 mm, 0.22 mm |
//! | angular noise of 30 urad | `angular_noise` | 1.1 mm, 0.012 mm |
//! | scanner inclined by 4 degrees | `an_inclined_scanner` | 0.8 mm, 0.01 mm |
//! | 40 columns before the laser is warm | `warm_up_columns_are_left_out` | left out; 0.8 mm, 0.01 mm |
//! | seam of the two faces on the plate | `two_faces_meeting_on_the_plate`, `two_faces_of_a_clockwise_scanner` | 2.2 mm, 0.8 mm |
//! | person and chain before the plate | `a_person_and_a_chain_before_the_plate` | 0.8 mm, 0.01 mm |
//! | incidence above 75 degrees | `grazing_incidence_is_never_measured_wrong` | refused: "scan: .." or "plate: .."; else 30 mm, 1 mm |

use std::f64::consts::PI;

use crate::stream::{LIMIT, driver, plate, start};
use platen_engine::pipeline::Pipeline;
use platen_engine::plugin::{Catalogue, JobSpec};
use platen_engine::stroke::{self, Baseline, NotMeasured};
use platen_plant::PlantFile;
use platen_scan::Window;
use platen_shape::{PlateSpec, RegionOfInterest, Vec3};
use platen_sim_plate::{Plate, PlateState, Pose};
use platen_sim_scanner::stream::{BridgeConfig, RayCastHead};
use platen_sim_scanner::{Cyclic, Faces, Instrument, Surroundings};

/// Fault of the scanner, of the surroundings or of the pose of the plate.
struct Scene {
    instrument: Instrument,
    surroundings: Surroundings,
    plate: PlateState,
    /// Errors of the two faces; the seam lies at this azimuth of the plate, degrees.
    faces: Option<(Faces, f64)>,
    clockwise: bool,
    /// Region of interest in which the plate is searched.
    region: Option<RegionOfInterest>,
}

impl Default for Scene {
    fn default() -> Self {
        let (instrument, surroundings) =
            (Instrument { warm_up_columns: 10, ..Instrument::default() }, Surroundings::default());
        Self { instrument, surroundings, plate: plate(), faces: None, clockwise: false, region: None }
    }
}

/// Errors of a measurement, metres.
#[derive(Debug)]
struct Found {
    corners: f64,
    surface: f64,
    /// Share of the plate covered by samples.
    coverage: f64,
}

fn measure(scene: Scene) -> Result<Found, NotMeasured> {
    let state = scene.plate.clone();
    let head = RayCastHead {
        surroundings: scene.surroundings,
        instrument: scene.instrument,
        noise: Some(scene.instrument.range_sigma),
        faces: scene.faces.map(|(faces, _)| faces),
        mirrored: scene.clockwise,
        threads: 2,
        ..RayCastHead::new(Box::new(move || Ok(Some(state.clone()))))
    };
    let bridge = start(&[], BridgeConfig::default(), head);
    let scanner = driver(bridge.address(), "divisor = 8\nrate_kpts = 122");
    let text =
        "[plant]\nname = 't'\n[flattening]\nplugin = 'harmonic'\n[[comparison]]\nplugin = 'template'\n";
    let plant = PlantFile::parse("plant.toml", text).unwrap();
    let mut rig = Pipeline::of(&plant, &Catalogue::new(Some(platen_tests::built()))).unwrap();
    let truth = Plate::new(&scene.plate).unwrap();
    let [width, height, thickness] = [truth.width(), truth.height(), truth.thickness()];
    let u_axis = Some(truth.corners()[1] - truth.corners()[0]).map(|u| Vec3::new(u.x, u.y, u.z));
    let spec =
        PlateSpec { width, height, thickness, face_inset: 0.0, root_face: 0.0, u_axis, region: scene.region };
    let window = scene.faces.map(|(_, seam_deg)| over_half_a_turn(seam_deg.to_radians(), scene.clockwise));
    let scanned = stroke::scan(&scanner, JobSpec::untriggered(LIMIT), window.as_ref(), &spec, None)?;
    assert_eq!(scanned.header.seam_column.is_some(), window.is_some());
    // Clockwise columns arrive reversed: the driver itself discards the warm-up columns, which come last.
    let left_out = if scene.clockwise { 0 } else { scene.instrument.warm_up_columns };
    assert_eq!(scanned.warm_up_columns, left_out);
    let measured = stroke::measure_scanned(&mut rig, &scanned, &spec, None, Baseline::None)?;

    let corner = |k: usize| (measured.outline.corners[k].point - truth.corners()[k]).norm();
    let surface = &measured.measurement.surface;
    let mut squares = 0.0;
    for k in 0..81 {
        // 5 % from the edges, whose errors are visible in the corners.
        let share = |i: usize| 0.05 + 0.9 * i as f64 / 8.0;
        let (u, v) = (share(k % 9) * width, share(k / 9) * height);
        squares += (surface.point(u, v) - truth.mid(u, v)).dot(&truth.normal(u, v)).powi(2);
    }
    let corners = (0..4).map(corner).fold(0.0, f64::max);
    let coverage = measured.measurement.quality.coverage;
    Ok(Found { corners, surface: (squares / 81.0).sqrt(), coverage })
}

/// Returns a window wider than half a turn in which the second face begins at the azimuth `seam`.
fn over_half_a_turn(seam: f64, clockwise: bool) -> Window {
    const BEHIND: f64 = 0.4;
    let azimuth_start = if clockwise { seam - BEHIND } else { seam - PI };
    Window { azimuth_start, azimuth_width: PI + BEHIND, elevation_min: -0.72, elevation_max: -0.42 }
}

/// Asserts that the plate is measured within bounds, about twice the errors found.
#[track_caller]
fn survives(corners_mm: f64, surface_mm: f64, scene: Scene) -> Found {
    let found = measure(scene).unwrap_or_else(|error| panic!("{error}"));
    println!("corners {:.2} mm, surface {:.3} mm", 1e3 * found.corners, 1e3 * found.surface);
    assert!(found.corners < 1e-3 * corners_mm && found.surface < 1e-3 * surface_mm, "{found:?}");
    found
}

/// Asserts that the plate is measured within bounds or refused with a sentence.
#[track_caller]
fn never_wrong(corners_mm: f64, surface_mm: f64, scene: Scene) {
    match measure(scene) {
        Ok(found) => {
            println!("{found:?}");
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
fn no_fault() {
    survives(0.8, 0.01, Scene::default());
}

#[test]
fn mixed_pixels_at_the_edges() {
    let instrument = Instrument { footprint: 1.2e-3, ..Scene::default().instrument };
    survives(0.8, 0.01, Scene { instrument, ..Scene::default() });
}

/// Returns a plate raised towards the scanner, so that a specular lobe of this half width lies across its upper edge.
fn in_specular_reflection(lobe_deg: f64) -> Scene {
    let pose = Pose { centre_mm: [6_000.0, 0.0, -1_800.0], pitch_deg: -70.0, ..Pose::default() };
    // Region of interest: the bed, as large as the plate.
    let region = RegionOfInterest { min: Vec3::new(3.0, -2.0, -3.3), max: Vec3::new(9.0, 2.0, 0.5) };
    let instrument = Instrument { specular_lobe: Some(lobe_deg.to_radians()), ..Scene::default().instrument };
    Scene { instrument, plate: PlateState { pose, ..plate() }, region: Some(region), ..Scene::default() }
}

#[test]
fn a_specular_hole_through_an_edge() {
    let found = survives(0.5, 0.01, in_specular_reflection(2.0));
    assert!(found.coverage < 0.98, "no hole: {found:?}");
}

#[test]
fn a_specular_lobe_along_an_edge() {
    let found = survives(0.35, 0.01, in_specular_reflection(5.0));
    assert!(found.coverage < 0.8, "no hole: {found:?}");
}

#[test]
fn an_edge_in_the_specular_lobe_is_refused() {
    let refused = measure(in_specular_reflection(6.0)).unwrap_err().to_string();
    assert!(refused.starts_with("scan: the face at") && refused.contains("measures about"), "{refused}");
}

#[test]
fn a_dark_plate() {
    let instrument = Instrument { range_sigma: 1.5e-3, dropout: 0.05, ..Scene::default().instrument };
    survives(1.0, 0.025, Scene { instrument, ..Scene::default() });
}

#[test]
fn cyclic_range_error() {
    let cyclic = Some(Cyclic { amplitude: 0.3e-3, period: 1.2, phase: 0.0 });
    let instrument = Instrument { cyclic, ..Scene::default().instrument };
    survives(0.9, 0.22, Scene { instrument, ..Scene::default() });
}

#[test]
fn angular_noise() {
    let instrument = Instrument { angular_sigma: 30e-6, ..Scene::default().instrument };
    survives(1.1, 0.012, Scene { instrument, ..Scene::default() });
}

#[test]
fn an_inclined_scanner() {
    // An inclined scanner is equivalent to an inclined plate.
    let pose = Pose { pitch_deg: 4.0, roll_deg: -2.0, ..Pose::default() };
    survives(0.8, 0.01, Scene { plate: PlateState { pose, ..plate() }, ..Scene::default() });
}

#[test]
fn warm_up_columns_are_left_out() {
    // 40 columns (2.8 degrees) beside the plate; their ranges scatter by centimetres.
    let instrument = Instrument { warm_up_columns: 40, ..Scene::default().instrument };
    survives(0.8, 0.01, Scene { instrument, ..Scene::default() });
}

/// Returns a scene in which both faces scan a part of the plate; the back face has its own collimation error and is
/// displaced by 1.1 mm; three warm-up columns.
fn seam(seam_deg: f64, clockwise: bool) -> Scene {
    let faces = Faces { seam_column: 0, collimation: 50e-6, trunnion: 25e-6, moved: [0.0, 0.5e-3, 1e-3] };
    let scene = Scene::default();
    let instrument = Instrument { warm_up_columns: 3, ..scene.instrument };
    Scene { instrument, faces: Some((faces, seam_deg)), clockwise, ..scene }
}

#[test]
fn two_faces_meeting_on_the_plate() {
    survives(2.2, 0.8, seam(-2.0, false));
}

#[test]
fn two_faces_of_a_clockwise_scanner() {
    survives(2.2, 0.8, seam(3.0, true));
}

#[test]
fn a_person_and_a_chain_before_the_plate() {
    let surroundings = Surroundings { person_in_front: true, chain: true, ..Surroundings::default() };
    survives(0.8, 0.01, Scene { surroundings, ..Scene::default() });
}

#[test]
fn grazing_incidence_is_never_measured_wrong() {
    let pose = Pose { centre_mm: [11_000.0, 0.0, -1_800.0], ..Pose::default() };
    never_wrong(30.0, 1.0, Scene { plate: PlateState { pose, ..plate() }, ..Scene::default() });
}
