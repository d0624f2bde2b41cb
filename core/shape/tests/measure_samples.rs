//! Whole measurements of the sample plates with the paper's harmonic map, against their truth.

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

/// Normal distances of the truth's grid from the face of S, mm: inside, and within 100 mm of an edge.
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

/// Errors of the curvatures along u and v and of the twist, 1/m, at least 150 mm from every edge.
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
        // Twice the largest of all plates: corners 0.46, markers 0.14 and, by the harmonic map's own error, 0.61 on the sphere; surface
        // 0.007 and 0.014; curvature 2.2e-3 where bend bands are narrow.
        let markers = if name.starts_with("p2") { 1.2 } else { 0.28 };
        assert!(corners < 0.92 && mean < markers, "{name}");
        assert!(inside < 0.014 && edge < 0.028 && bend < 4.4e-3, "{name}");
    }
}
