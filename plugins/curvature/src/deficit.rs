//! Curvature deficit: the curvature that is missing to the target.

use platen_model::{Figure, NodeState, Report};
use platen_sdk::PlateGrid;
use platen_shape::{EXPANDED, TargetSurface};

use crate::{Nodes, place};

/// Adds the field, the figures and the sentences of the missing curvature.
pub(crate) fn add(report: &mut Report, nodes: &Nodes, target: &TargetSurface) {
    let grid = nodes.grid;
    let value: Vec<f64> = (0..PlateGrid::NODES)
        .map(|i| {
            let [u, v] = grid.at(i);
            target.deficit(&nodes.curvature[i], u, v)
        })
        .collect();
    let sigma = (0..PlateGrid::NODES).map(|i| sigma(nodes, target, i)).collect::<Vec<f64>>();
    let lod: Vec<f64> = (0..PlateGrid::NODES).map(|i| EXPANDED * averaged(&sigma, i)).collect();
    let state: Vec<NodeState> = (0..PlateGrid::NODES)
        .map(|i| match (nodes.known[i], value[i].abs() < lod[i]) {
            (false, _) => NodeState::Unseen,
            (true, true) => NodeState::Unchanged,
            (true, false) => NodeState::Seen,
        })
        .collect();

    let known = state.iter().filter(|s| **s != NodeState::Unseen).count();
    let enough = state.iter().filter(|s| **s == NodeState::Unchanged).count();
    let figures = &mut report.findings.figures;
    figures.push(Figure::new("curvature.enough", enough as f64 / known.max(1) as f64, "1"));
    // The extreme of each sense among the significant nodes.
    for (name, sign, word) in
        [("curvature.deficit_max", 1.0, "bend more"), ("curvature.deficit_min", -1.0, "bent too far")]
    {
        let beyond = |i: &usize| state[*i] == NodeState::Seen && sign * value[*i] > 0.0;
        let most = (0..value.len()).filter(beyond).max_by(|&a, &b| value[a].abs().total_cmp(&value[b].abs()));
        let Some(i) = most else { continue };
        figures.push(Figure::new(name, value[i], "1/m").uncertainty(lod[i]).at(grid.at(i)));
        let size = value[i].abs();
        report.findings.says.push(format!("{word}: {size:.3} 1/m at {}", place(grid.at(i))));
    }
    report.fields.push(grid.scalar("curvature_deficit", "1/m", value, state));
    gaussian(report, nodes, target);
}

/// Adds the missing Gaussian curvature, for targets that have any. Bending alone does not change it (theorema
/// egregium), so the plate must stretch for it.
fn gaussian(report: &mut Report, nodes: &Nodes, target: &TargetSurface) {
    let grid = nodes.grid;
    if !is_doubly_curved(nodes, target) {
        return;
    }
    let goal = grid.map(|u, v| target.curvature(u, v).gaussian);
    let value: Vec<f64> = goal.iter().zip(&nodes.curvature).map(|(goal, k)| goal - k.gaussian).collect();
    let known = |i: &usize| nodes.known[*i];
    // Nodes on the edges count as full cells: at most a hundredth of the plate is counted twice.
    let total =
        |values: &[f64]| (0..PlateGrid::NODES).filter(known).map(|i| values[i]).sum::<f64>() * grid.cell();
    let (missing, wanted) = (total(&value), total(&goal));
    if wanted == 0.0 {
        // No node is known, so there is no share.
        return;
    }
    let figures = &mut report.findings.figures;
    figures.push(Figure::new("gaussian.missing", missing, "1"));
    figures.push(Figure::new("gaussian.wanted", wanted, "1"));
    figures.push(Figure::new("gaussian.missing_share", missing / wanted, "1"));
    report.findings.says.push(format!(
        "still to stretch: {:.0} % of the target's Gaussian curvature is missing ({missing:.4} of {wanted:.4} sr)",
        100.0 * missing / wanted
    ));
    let state = nodes.known.iter().copied().map(NodeState::from).collect();
    report.fields.push(grid.scalar("gaussian_missing", "1/m2", value, state));
}

/// Returns whether the target has Gaussian curvature, which bending alone cannot make.
pub(crate) fn is_doubly_curved(nodes: &Nodes, target: &TargetSurface) -> bool {
    // 1e-9 1/m^2 corresponds to a sphere of 30 km.
    nodes.grid.map(|u, v| target.curvature(u, v).gaussian).iter().any(|goal| goal.abs() >= 1e-9)
}

/// Nodes to each side over which a standard deviation is averaged: about one knot span.
const REACH: usize = 2;

/// Returns the root mean square around a node. The variance of a spline's curvature oscillates between the knots
/// although neighbouring nodes have the same error; averaging keeps neighbouring nodes in the same state.
fn averaged(sigma: &[f64], node: usize) -> f64 {
    let range = |k: usize| k.saturating_sub(REACH)..(k + REACH + 1).min(PlateGrid::SIDE);
    let (rows, columns) = (range(node / PlateGrid::SIDE), range(node % PlateGrid::SIDE));
    let count = rows.len() * columns.len();
    let row = |row: usize| columns.clone().map(move |column| sigma[row * PlateGrid::SIDE + column].powi(2));
    (rows.flat_map(row).sum::<f64>() / count as f64).sqrt()
}

/// Returns the standard deviation of the deficit at a node.
fn sigma(nodes: &Nodes, target: &TargetSurface, i: usize) -> f64 {
    let ([u, v], [along_u, along_v, twist]) = (nodes.grid.at(i), nodes.sigma[i]);
    match target.bending(u, v) {
        Some([x, y]) => (x * x * along_u).hypot(2.0 * x * y * twist).hypot(y * y * along_v),
        None => along_u.max(along_v),
    }
}
