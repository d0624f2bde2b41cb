//! Comparison with the ground truth of an independent generator of the same plates, point by point.
#![expect(clippy::unwrap_used, reason = "a test that cannot read its samples must fail")]

use nalgebra::{Matrix3, Rotation3};
use platen_sim_plate::{CurvatureStep, Plate, PlateState, Pose, Shape, Vec3};
use serde_json::Value;

/// Reads the ground truth of a sample; it is the same in the small and the large set.
fn truth(name: &str) -> Value {
    let path = platen_tests::samples::each("plates").remove(0).join(name).join("truth.json");
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

fn vector(value: &Value) -> Vec3 {
    Vec3::from_fn(|k, _| value[k].as_f64().unwrap())
}

/// Returns largest distance and rms of our upper face and mid-surface curvature from the sample's 50 mm grid, metres.
fn distance(truth: &Value, shape: Shape) -> (f64, f64) {
    let number = |pointer: &str| truth.pointer(pointer).unwrap().as_f64().unwrap();
    let mut state =
        PlateState::flat(number("/plate/W_mm"), number("/plate/H_mm"), number("/plate/thickness_mm"));
    let rotation = Matrix3::from_fn(|i, k| truth["pose"]["R"][i][k].as_f64().unwrap());
    state.pose = Pose::from_parts(&Rotation3::from_matrix_unchecked(rotation), vector(&truth["pose"]["T_m"]));
    state.shape = shape;
    let plate = Plate::new(&state).unwrap();
    let grid = &truth["surface_grid"];
    let (mut largest, mut sum, mut n) = (0.0_f64, 0.0, 0.0);
    for (i, u) in grid["u_m"].as_array().unwrap().iter().enumerate() {
        for (j, v) in grid["v_m"].as_array().unwrap().iter().enumerate() {
            let ours = plate.top(u.as_f64().unwrap(), v.as_f64().unwrap());
            let off = (ours - vector(&grid["xyz_m"][i][j])).norm();
            (largest, sum, n) = (largest.max(off), sum + off * off, n + 1.0);
        }
    }
    (largest, (sum / n).sqrt())
}

fn check(name: &str, shape: Shape, limit: f64) {
    let truth = truth(name);
    let (largest, rms) = distance(&truth, shape);
    println!("{name}: largest {largest:.3e} m, rms {rms:.3e} m");
    assert!(largest < limit, "{name}: largest {largest:e} m, rms {rms:e} m");
}

#[test]
fn oblique_cylinder() {
    check("p1_cylinder", Shape::Cylinder { radius_mm: 9000.0, axis_deg: 110.0 }, 2e-8);
    check("p6_occluded", Shape::Cylinder { radius_mm: 7000.0, axis_deg: 90.0 }, 2e-8);
}

#[test]
fn half_bent() {
    let steps = vec![CurvatureStep { at_mm: 100.0, width_mm: 300.0, change_per_m: -1.0 / 6.0 }];
    check("p3_half_bent", Shape::Steps { axis_deg: 90.0, curvature_per_m: 1.0 / 6.0, steps }, 2e-8);
}

#[test]
fn cone() {
    // Radius 7.5 m in the middle, 6 m from the apex: it grows by 1.25 m per metre.
    let half = 1.25 * 1.0 / 5_f64.to_radians().cos();
    let (radius_start_mm, radius_end_mm) = (1e3 * (7.5 - half), 1e3 * (7.5 + half));
    check("p5_cone_ptx", Shape::Cone { axis_deg: 95.0, radius_start_mm, radius_end_mm }, 2e-8);
}

#[test]
fn sphere_of_least_energy() {
    check("p2_sphere", Shape::Sphere { radius_mm: 11_000.0 }, 2e-5);
}
