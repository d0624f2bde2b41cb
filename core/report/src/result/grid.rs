//! Grid of the result document: curvature of S(u, v), positions and fields of the comparisons at 21 x 21 nodes.

use super::fields::find_field;
use serde::{Deserialize, Serialize};

use platen_model::units::mm;
use platen_model::{Field, NodeState, Report};
use platen_shape::evaluate::{self, GRID};
use platen_shape::measure::Measurement;

/// Regular grid over the plate; null where unseen.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct GridRecord {
    /// Nodes along u.
    pub nu: usize,
    /// Nodes along v.
    pub nv: usize,
    /// Curvature along u of the mid-surface.
    pub kappa_u_per_m: Vec<Option<f64>>,
    /// Curvature along v.
    pub kappa_v_per_m: Vec<Option<f64>>,
    /// Twist.
    pub kappa_uv_per_m: Vec<Option<f64>>,
    /// Position on the scanned face, scanner frame.
    pub position_m: Vec<[f64; 3]>,
    /// Displacement since the previous stroke, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub displacement_mm: Option<Vec<Option<[f64; 3]>>>,
    /// Measured minus target along the target's normal, if there is a target.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deviation_mm: Option<Vec<Option<f64>>>,
    /// Whether the displacement is below the level of detection.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unchanged: Option<Vec<Option<bool>>>,
}

impl GridRecord {
    pub(super) fn new(measurement: &Measurement, reports: &[&Report]) -> Self {
        let [nu, nv] = GRID;
        let grid = evaluate::grid(&measurement.surface, &measurement.location, nu, nv);
        let curvature = |kappa: fn(&platen_shape::surface::Curvature) -> f64| {
            grid.nodes.iter().map(|n| n.place.seen.then(|| kappa(&n.curvature))).collect()
        };
        let displacement = find_field(reports, "displacement", "displacement", 3);
        let deviation = find_field(reports, "template", "deviation", 1);
        Self {
            nu,
            nv,
            kappa_u_per_m: curvature(|c| c.u),
            kappa_v_per_m: curvature(|c| c.v),
            kappa_uv_per_m: curvature(|c| c.uv),
            position_m: grid.nodes.iter().map(|n| n.place.position.into()).collect(),
            displacement_mm: displacement.map(|field| nodes(field, |v, _| [v[0], v[1], v[2]].map(mm))),
            deviation_mm: deviation.map(|field| nodes(field, |values, _| mm(values[0]))),
            unchanged: displacement.map(|field| nodes(field, |_, state| state == NodeState::Unchanged)),
        }
    }
}

/// Samples a field at the nodes of the grid by its nearest nodes; they coincide where one grid divides the other
/// evenly.
fn nodes<T>(field: &Field, value: impl Fn(&[f64], NodeState) -> T) -> Vec<Option<T>> {
    let nearest = |k: usize, n: usize, along: usize| (k * (along - 1) + (n - 1) / 2) / (n - 1);
    let at = |i_u: usize, i_v: usize| {
        let node =
            nearest(i_v, GRID[1], field.nodes[1]) * field.nodes[0] + nearest(i_u, GRID[0], field.nodes[0]);
        let values = &field.values[node * field.components..(node + 1) * field.components];
        (field.state[node] != NodeState::Unseen).then(|| value(values, field.state[node]))
    };
    (0..GRID[0] * GRID[1]).map(|k| at(k % GRID[0], k / GRID[0])).collect()
}
