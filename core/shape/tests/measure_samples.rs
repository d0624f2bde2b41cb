//! Whole measurements of the sample plates against their truth, with the harmonic map.
//!
//! The map is that of Masuda et al., "Point-based shape monitoring of plate bending for large-scale storage tanks".

#![allow(clippy::unwrap_used, reason = "test code: helpers fail like tests")]

#[path = "support/harmonic.rs"]
mod harmonic;
mod support;

use harmonic::Harmonic;
use platen_shape::outline::outline;
use platen_shape::{Measurement, Surface, measure};
use platen_tests::samples;
use serde_json::Value;

fn measured(sample: &support::Sample) -> Measurement {
    let patch = support::extract(sample, 0..sample.columns.len()).unwrap();
    let outline = outline(&patch, &sample.spec).unwrap();
    let begin = std::time::Instant::now();
    measure(&patch, &outline, &sample.spec, &sample.spec.rectangle(), &mut Harmonic, &mut || begin.elapsed())
        .unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt()
}

/// Returns the normal distances of the truth's grid from the face of S, mm: inside, and within 100 mm of an edge.
fn distances(surface: &Surface, grid: &Value) -> [Vec<f64>; 2] {
    let (us, vs) = (numbers(&grid["u_m"]), numbers(&grid["v_m"]));
    let mut out = [Vec::new(), Vec::new()];
    for (i, &u) in us.iter().enumerate() {
        for (k, &v) in vs.iter().enumerate() {
            let d = support::vec3(&grid["xyz_m"][i][k]) - surface.face(u, v);
            let border = u.min(surface.width() - u).min(v).min(surface.height() - v);
            out[usize::from(border < 0.0999)].push(1e3 * d.dot(&surface.normal(u, v)));
        }
    }
    out
}

/// Returns the errors of the curvatures along u and v and of the twist, 1/m, at least 150 mm from every edge.
fn bends(surface: &Surface, grid: &Value) -> Vec<f64> {
    let (us, vs) = (numbers(&grid["u_m"]), numbers(&grid["v_m"]));
    let mut out = Vec::new();
    for (i, &u) in us.iter().enumerate() {
        for (k, &v) in vs.iter().enumerate() {
            if u.min(surface.width() - u).min(v).min(surface.height() - v) >= 0.1499 {
                let truth = |name: &str| grid[name][i][k].as_f64().unwrap();
                let found = surface.curvature(u, v);
                out.extend([
                    found.u - truth("kappa_u"),
                    found.v - truth("kappa_v"),
                    found.uv - truth("kappa_uv"),
                ]);
            }
        }
    }
    out
}

/// Largest errors allowed: millimetres, and 1/m for the curvature.
struct Bounds {
    corners: f64,
    markers: f64,
    inside: f64,
    near_edge: f64,
    curvature: f64,
}

/// Returns twice the errors found on the worst plate of each kind.
fn bounds(name: &str) -> Bounds {
    // Corners 0.20 to 0.46 mm and markers 0.10 to 0.13 mm: edges located to a thirtieth of the lattice's step of 8 mm.
    // Normal distances 0.002 to 0.007 mm inside and 0.006 to 0.014 mm near an edge: noise of 0.4 mm over 70,000 to
    // 130,000 samples.
    let all = Bounds { corners: 0.92, markers: 0.26, inside: 0.014, near_edge: 0.028, curvature: 2.4e-4 };
    match name {
        // 0.61 mm: the harmonic map is wrong on double curvature.
        "p2_sphere" => Bounds { markers: 1.2, ..all },
        // 3.8e-4: the curvature grows towards the apex.
        "p5_cone_ptx" => Bounds { curvature: 7.6e-4, ..all },
        // 1.2e-3 to 2.2e-3: flanks of narrow bends are smoothed.
        name if name.starts_with("p3") || name.starts_with("p4") => Bounds { curvature: 4.4e-3, ..all },
        _ => all,
    }
}

#[test]
fn sample_plates_are_met() {
    println!("plate: corners rms, markers mean/max, normal inside/edge rms (mm), curvature rms (1/m)");
    for folder in samples::plates() {
        let sample = support::read(&folder);
        let m = measured(&sample);
        let name = folder.file_name().unwrap().to_string_lossy().into_owned();
        let corner = |k: usize| 1e3 * (m.corners[k] - support::vec3(&sample.truth["corners_m"][k])).norm();
        let corners = rms(&[corner(0), corner(1), corner(2), corner(3)]);
        let marker = |marker: &Value| {
            let at = |key: &str| marker[key].as_f64().unwrap() / 1e3;
            1e3 * (m.surface.face(at("u_mm"), at("v_mm")) - support::vec3(&marker["position_m"])).norm()
        };
        let markers: Vec<f64> = sample.truth["markers"].as_array().unwrap().iter().map(marker).collect();
        let mean = markers.iter().sum::<f64>() / markers.len() as f64;
        let worst = markers.iter().fold(0.0_f64, |a, x| a.max(*x));
        let [inside, edge] = distances(&m.surface, &sample.truth["surface_grid"]).map(|d| rms(&d));
        let bend = rms(&bends(&m.surface, &sample.truth["curvature_grid_mid"]));
        println!("{name}: {corners:.2}, {mean:.2}/{worst:.2}, {inside:.3}/{edge:.3}, {bend:.1e}");
        println!("    edges {:?} {:?} {:?}", m.mesh.edge_length, m.quality, m.timings);
        let most = bounds(&name);
        assert!(corners < most.corners && mean < most.markers, "{name}");
        assert!(inside < most.inside && edge < most.near_edge && bend < most.curvature, "{name}");
    }
}
