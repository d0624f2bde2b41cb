//! What a simulated scan should lead to: written beside it, for whoever judges a measurement.

use platen_sim_plate::{Plate, PlateState};
use platen_sim_scanner::{Label, Scene, SimColumn, SimState, TruthCell};
use serde_json::{Value, json};

/// Corners, markers and grid of the scanned face (metres, scanner frame), curvature of the mid-surface, and how many
/// cells saw it. Grids: 21 x 21, v outer, u inner.
pub(crate) fn document(state: &PlateState, plate: &Plate, scene: &Scene, columns: &[SimColumn]) -> Value {
    let position = |u: f64, v: f64| -> [f64; 3] { plate.top(u, v).into() };
    let corners: Vec<[f64; 3]> = plate.corners().map(Into::into).to_vec();
    let markers: Vec<Value> = plate
        .markers()
        .iter()
        .map(|[u, v]| json!({ "u_mm": u * 1e3, "v_mm": v * 1e3, "position_m": position(*u, *v), "seen": scene.sees(plate.top(*u, *v)) }))
        .collect();
    let grid = |f: &dyn Fn(f64, f64) -> Value| -> Vec<Value> {
        let share = |k: u32| f64::from(k) / 20.0;
        (0..21 * 21).map(|k| f(share(k % 21) * plate.width(), share(k / 21) * plate.height())).collect()
    };
    let cells: Vec<(TruthCell, bool)> = columns.iter().flat_map(measured).collect();
    let count = |wanted: &dyn Fn(&TruthCell, bool) -> bool| {
        cells.iter().filter(|(t, valid)| wanted(t, *valid)).count()
    };
    json!({
        "state": state,
        "corners_m": corners,
        "markers": markers,
        "grid": {
            "nu": 21,
            "nv": 21,
            "position_m": grid(&|u, v| json!(position(u, v))),
            "kappa_u_per_m": grid(&|u, v| json!(plate.curvature(u, v, 0.0).kappa_u)),
            "kappa_v_per_m": grid(&|u, v| json!(plate.curvature(u, v, 0.0).kappa_v)),
        },
        "counts": {
            "cells": cells.len(),
            "plate_top_cells": count(&|truth, _| truth.label == Label::PlateTop),
            "plate_top_valid": count(&|truth, valid| truth.label == Label::PlateTop && valid),
            "mixed": count(&|truth, _| truth.mixed),
        },
    })
}

/// Truth and validity of every cell of a column.
fn measured(column: &SimColumn) -> impl Iterator<Item = (TruthCell, bool)> + '_ {
    column.truth.iter().zip(&column.state).map(|(truth, state)| (*truth, *state == SimState::Valid))
}
