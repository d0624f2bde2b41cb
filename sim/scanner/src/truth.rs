//! Ground truth of a simulated scan, as a JSON document.

use crate::column::{SimColumn, SimState};
use crate::ray::Label;
use crate::scene::Scene;
use platen_sim_plate::{Plate, PlateState};
use serde_json::{Value, json};

/// Points of the coarse grid along each direction.
const GRID: u32 = 21;

/// Largest distance of neighbouring points of the fine grid, metres.
const FINE: f64 = 0.05;

/// Numbers of cells of a scan by what they hit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct CellCounts {
    /// All cells.
    pub cells: u64,
    /// Cells whose middle ray meets the plate's upper face.
    pub plate_top: u64,
    /// Valid cells among them.
    pub plate_top_valid: u64,
    /// Cells whose footprint straddles an edge.
    pub mixed: u64,
}

impl CellCounts {
    /// Adds the cells of a column.
    pub fn add(&mut self, column: &SimColumn) {
        for (truth, state) in column.truth.iter().zip(&column.state) {
            let on_plate = truth.label == Label::PlateTop;
            self.cells += 1;
            self.plate_top += u64::from(on_plate);
            self.plate_top_valid += u64::from(on_plate && *state == SimState::Valid);
            self.mixed += u64::from(truth.mixed);
        }
    }
}

/// Returns the ground truth as a document: the plate's state, corners, markers, edges and two grids of the upper face
/// (metres, scanner frame), curvature of the mid-surface (1/m), and numbers of cells.
///
/// `edges` are those of the face, v = 0, u = W, v = H, u = 0, counter-clockwise, with at most 50 mm between points: on
/// a bevelled plate inside of the rectangle. Corners and grids are those of the rectangle, and of the face's
/// continuation where it is bevelled.
///
/// Grids are regular over the rectangle, edges included, v outer, u inner: `grid` has 21 x 21 points with curvatures,
/// `face` is finer, with at most 50 mm between points, positions only. The result is null when the scene has no plate.
pub fn truth_document(state: &PlateState, scene: &Scene, counts: &CellCounts) -> Value {
    let Some(plate) = scene.plate() else { return Value::Null };
    let corners: Vec<[f64; 3]> = plate.corners().map(Into::into).to_vec();
    let marker = |[u, v]: &[f64; 2]| json!({ "u_mm": u * 1e3, "v_mm": v * 1e3, "position_m": position(plate, *u, *v), "seen": scene.sees(plate.top(*u, *v)) });
    let coarse = |value: &dyn Fn(f64, f64) -> Value| places(plate, [GRID; 2], value);
    let fine = [plate.width(), plate.height()].map(|length| (length / FINE).ceil() as u32 + 1);
    json!({
        "state": state,
        "corners_m": corners,
        "edges": (0..4).map(|k| edge(plate, k, fine[k % 2])).collect::<Vec<_>>(),
        "markers": plate.markers().iter().map(marker).collect::<Vec<_>>(),
        "grid": {
            "nu": GRID,
            "nv": GRID,
            "position_m": coarse(&|u, v| position(plate, u, v)),
            "kappa_u_per_m": coarse(&|u, v| json!(plate.curvature(u, v, 0.0).kappa_u)),
            "kappa_v_per_m": coarse(&|u, v| json!(plate.curvature(u, v, 0.0).kappa_v)),
        },
        "face": {
            "nu": fine[0],
            "nv": fine[1],
            "position_m": places(plate, fine, &|u, v| position(plate, u, v)),
        },
        "counts": {
            "cells": counts.cells,
            "plate_top_cells": counts.plate_top,
            "plate_top_valid": counts.plate_top_valid,
            "mixed": counts.mixed,
        },
    })
}

/// Returns `n` points of edge `k` of the upper face.
fn edge(plate: &Plate, k: usize, n: u32) -> Vec<Value> {
    let inset = plate.face_inset();
    let along = |length: f64, i: u32| inset + f64::from(i) / f64::from(n - 1) * (length - 2.0 * inset);
    let (w, h) = (plate.width(), plate.height());
    let at = |i: u32| match k {
        0 => (along(w, i), inset),
        1 => (w - inset, along(h, i)),
        2 => (along(w, n - 1 - i), h - inset),
        _ => (inset, along(h, n - 1 - i)),
    };
    let material = |(a, b)| plate.material(a, b).0;
    (0..n).map(at).map(material).map(|[u, v]| position(plate, u, v)).collect()
}

fn position(plate: &Plate, u: f64, v: f64) -> Value {
    let [x, y, z]: [f64; 3] = plate.top(u, v).into();
    json!([x, y, z])
}

/// Evaluates `value` at each point of a regular grid.
fn places(plate: &Plate, [nu, nv]: [u32; 2], value: &dyn Fn(f64, f64) -> Value) -> Vec<Value> {
    let share = |k: u32, n: u32| f64::from(k) / f64::from(n - 1);
    let at = |k: u32| (share(k % nu, nu) * plate.width(), share(k / nu, nv) * plate.height());
    (0..nu * nv).map(at).map(|(u, v)| value(u, v)).collect()
}
