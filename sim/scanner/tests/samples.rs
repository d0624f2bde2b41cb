//! Comparison with an independent generator of the same scenes: the same plate in the same lattice has similar error
//! statistics.
#![expect(clippy::unwrap_used, reason = "a test that cannot read its samples must fail")]

use e57::{CartesianCoordinate, E57Reader};
use nalgebra::{Matrix3, Rotation3};
use platen_sim_plate::{CurvatureStep, Plate, PlateState, Pose, Shape, Vec3};
use platen_sim_scanner::{Instrument, Label, Ray, Scene, SimLattice, SimState, Surroundings, scan_all};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Largest ratio allowed between a figure of ours and of the sample.
const FACTOR: f64 = 1.5;

struct Sample {
    folder: PathBuf,
    truth: Value,
}

impl Sample {
    fn open(folder: PathBuf) -> Self {
        let truth = serde_json::from_slice(&std::fs::read(folder.join("truth.json")).unwrap()).unwrap();
        Self { folder, truth }
    }

    fn number(&self, pointer: &str) -> f64 {
        self.truth.pointer(pointer).unwrap().as_f64().unwrap()
    }

    fn plate(&self, shape: Shape) -> Plate {
        let size = ["/plate/W_mm", "/plate/H_mm", "/plate/thickness_mm"].map(|p| self.number(p));
        let mut state = PlateState::flat(size[0], size[1], size[2]);
        let rotation = Matrix3::from_fn(|i, k| self.truth["pose"]["R"][i][k].as_f64().unwrap());
        let centre = Vec3::from_fn(|k, _| self.truth["pose"]["T_m"][k].as_f64().unwrap());
        state.pose = Pose::from_parts(&Rotation3::from_matrix_unchecked(rotation), centre);
        state.shape = shape;
        Plate::new(&state).unwrap()
    }

    /// Returns the sample's lattice; its columns run clockwise, ours counter-clockwise.
    fn lattice(&self) -> SimLattice {
        let step = self.number("/lattice/step_deg").to_radians();
        let (n_rows, n_columns) = (self.number("/lattice/nrow") as u32, self.number("/lattice/ncol") as u32);
        SimLattice {
            azimuth_start: self.number("/lattice/az_first_deg").to_radians()
                - step * f64::from(n_columns - 1),
            azimuth_step: step,
            n_columns,
            elevation_start: self.number("/lattice/el_first_deg").to_radians(),
            elevation_step: step,
            n_rows,
        }
    }

    fn instrument(&self) -> Instrument {
        Instrument {
            range_sigma: self.number("/scanner/sigma_mm") * 1e-3,
            footprint: self.number("/scanner/footprint_rad"),
            ..Instrument::default()
        }
    }
}

/// Statistics compared.
#[derive(Debug, Default)]
struct Figures {
    plate_cells: f64,
    plate_valid: f64,
    plate_unmixed: f64,
    valid: f64,
    sum_of_squares: f64,
}

fn ours(scene: &Scene, lattice: &SimLattice, instrument: &Instrument) -> Figures {
    let mut figures = Figures::default();
    for column in scan_all(scene, lattice, instrument, 2) {
        for (i, truth) in column.truth.iter().enumerate() {
            let (on_plate, valid) = (truth.label == Label::PlateTop, column.state[i] == SimState::Valid);
            figures.plate_cells += f64::from(on_plate);
            figures.valid += f64::from(valid);
            if on_plate && valid {
                figures.plate_valid += 1.0;
                if !truth.mixed {
                    figures.plate_unmixed += 1.0;
                    figures.sum_of_squares += (f64::from(column.range_m[i]) - truth.range).powi(2);
                }
            }
        }
    }
    figures
}

/// Returns the standard deviation along the beam of the sample's points on the plate, 30 mm from its edges, and how
/// many lie farther than 10 mm from it.
fn residual_of_file(path: &Path, plate: &Plate) -> (f64, usize) {
    let mut reader = E57Reader::from_file(path).unwrap();
    let cloud = reader.pointclouds().remove(0);
    let mut points = reader.pointcloud_simple(&cloud).unwrap();
    points.apply_pose(false);
    let scene = Scene::of(Some(plate.clone()), Vec::new());
    let (mut n, mut sum, mut far) = (0, 0.0, 0);
    for point in points {
        let CartesianCoordinate::Valid { x, y, z } = point.unwrap().cartesian else { continue };
        let point = Vec3::new(x, y, z);
        let Some(direction) = point.try_normalize(0.1) else { continue };
        let Some(hit) = scene.cast(&Ray { origin: Vec3::zeros(), direction }, 100.0) else { continue };
        let inside = |x: f64, size: f64| (0.03..size - 0.03).contains(&x);
        let on_face = hit.uv.is_some_and(|[u, v]| inside(u, plate.width()) && inside(v, plate.height()));
        if hit.label != Label::PlateTop || !on_face {
            continue;
        }
        let error = point.norm() - hit.range;
        if error.abs() > 0.01 {
            far += 1;
        } else {
            (n, sum) = (n + 1, sum + error * error);
        }
    }
    ((sum / f64::from(n)).sqrt(), far)
}

fn within_factor(name: &str, ours: f64, theirs: f64) {
    println!("{name}: ours {ours:.6}, theirs {theirs:.6}");
    assert!(ours < FACTOR * theirs && theirs < FACTOR * ours, "{name}: ours {ours}, theirs {theirs}");
}

fn check(name: &str, shape: &Shape) {
    for folder in platen_tests::samples::each(&format!("plates/{name}")) {
        check_one(&Sample::open(folder), shape.clone());
    }
}

fn check_one(sample: &Sample, shape: Shape) {
    let plate = sample.plate(shape);
    let scene = Scene::new(Some(plate.clone()), &Surroundings::default());
    let (lattice, instrument) = (sample.lattice(), sample.instrument());
    let figures = ours(&scene, &lattice, &instrument);

    // Geometry: the same cells see the plate, except for a few at its edge.
    assert!((figures.plate_cells - sample.number("/counts/plate_top_cells")).abs() <= 3.0, "{figures:?}");
    within_factor("valid cells", figures.valid, sample.number("/counts/valid_cells"));
    let lost = |cells: f64, valid: f64| cells - valid;
    within_factor(
        "lost on the plate",
        lost(figures.plate_cells, figures.plate_valid),
        lost(sample.number("/counts/plate_top_cells"), sample.number("/counts/plate_top_valid")),
    );
    within_factor(
        "mixed on the plate",
        figures.plate_valid - figures.plate_unmixed,
        sample.number("/counts/plate_top_valid") - sample.number("/counts/plate_top_valid_unmixed"),
    );
    // Mixed cells elsewhere are not comparable: the surroundings differ.
    // Distance from the points to the truth: ours from our scan, theirs from their file and our geometry.
    let (theirs, far) = residual_of_file(&sample.folder.join("scan.e57"), &plate);
    within_factor("sigma, mm", 1e3 * (figures.sum_of_squares / figures.plate_unmixed).sqrt(), 1e3 * theirs);
    assert_eq!(far, 0, "points of the sample far from our plate");
    within_factor("sigma of the file, mm", 1e3 * theirs, sample.number("/lattice/sigma_plate_mm"));
}

#[test]
fn p1_cylinder() {
    check("p1_cylinder", &Shape::Cylinder { radius_mm: 9000.0, axis_deg: 110.0 });
}

#[test]
fn p2_sphere() {
    check("p2_sphere", &Shape::Sphere { radius_mm: 11_000.0 });
}

#[test]
fn p3_half_bent() {
    let steps = vec![CurvatureStep { at_mm: 100.0, width_mm: 300.0, change_per_m: -1.0 / 6.0 }];
    check("p3_half_bent", &Shape::Steps { axis_deg: 90.0, curvature_per_m: 1.0 / 6.0, steps });
}
