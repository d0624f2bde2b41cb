//! Change detection: displacement, level of detection, significant patches.

use platen_model::NodeState;
use platen_sdk::PlateGrid;
use platen_shape::{EXPANDED, Vec3};

use crate::align::Alignment;
use crate::nodes::Nodes;

/// Number of standard deviations that the largest of 441 independent places of an unchanged plate exceeds in 5 % of the
/// pairs (two-sided, Bonferroni); places nearer than a seventh of a metre are correlated. Five nodes in a hundred lie
/// above their level of detection by chance, and they are neighbours. A patch is therefore a change only if one of its
/// nodes exceeds this limit.
const SIGNIFICANT: f64 = 3.86;

/// The same limit for the scanner's correlated error, whose waves are half a metre to a metre long: for 30 independent
/// places.
const SIGNIFICANT_CORRELATED: f64 = 3.144;

/// Displacement at every node.
#[derive(Debug)]
pub(crate) struct Changes {
    /// Displacement vectors, scanner frame, metres.
    pub(crate) vectors: Vec<Vec3>,
    /// Displacement along the normal, towards the scanner, metres.
    pub(crate) normal: Vec<f64>,
    /// Standard deviation of the displacement along the normal, metres.
    pub(crate) sigma: Vec<f64>,
    /// Level of detection, metres.
    pub(crate) lod: Vec<f64>,
    /// Median of the level of detection over the seen nodes, metres.
    pub(crate) median_lod: f64,
    /// Share of the seen nodes that lies above it, before patches are dropped.
    pub(crate) above_lod: f64,
    /// State of every node.
    pub(crate) state: Vec<NodeState>,
}

/// Returns the displacement at every node, and where it is a significant change.
pub(crate) fn changes(
    nodes: &Nodes,
    Alignment { motion, weights, .. }: &Alignment<'_>,
    min_patch: f64,
) -> Changes {
    let moved: Vec<Vec3> = nodes.before.iter().map(|p| motion.apply(p)).collect();
    let vectors: Vec<Vec3> = nodes.now.iter().zip(&moved).map(|(now, before)| now - before).collect();
    let normal: Vec<f64> = vectors.iter().zip(&nodes.normal).map(|(d, n)| d.dot(n)).collect();
    let sigma: Vec<f64> = (0..PlateGrid::NODES)
        .map(|i| {
            // Where a place determines the alignment, the alignment follows its error, which is then not added.
            let align = motion.sigma(&nodes.before[i], &nodes.normal[i]) * (1.0 - weights[i]).sqrt();
            nodes.sigma[i].hypot(nodes.correlated).hypot(align)
        })
        .collect();
    let lod: Vec<f64> = sigma.iter().map(|sigma| EXPANDED * sigma).collect();
    let mut state: Vec<NodeState> = (0..PlateGrid::NODES)
        .map(|i| match (nodes.seen[i], normal[i].abs() < lod[i]) {
            (false, _) => NodeState::Unseen,
            (true, true) => NodeState::Unchanged,
            (true, false) => NodeState::Seen,
        })
        .collect();
    let count = |wanted: NodeState| state.iter().filter(|state| **state == wanted).count();
    let (above, below) = (count(NodeState::Seen), count(NodeState::Unchanged));
    let above_lod = above as f64 / (above + below).max(1) as f64;
    // The scanner's correlated error has far fewer independent places than the noise.
    let excess = (SIGNIFICANT.powi(2) - SIGNIFICANT_CORRELATED.powi(2)) * nodes.correlated.powi(2);
    let significant = |patch: &[usize]| {
        patch.iter().any(|&i| normal[i].powi(2) > (SIGNIFICANT * sigma[i]).powi(2) - excess)
    };
    let least = (min_patch / nodes.grid.cell()) as usize;
    drop_patches(&mut state, &normal, |patch| patch.len() < least || !significant(patch));
    let mut of_seen: Vec<f64> = (0..PlateGrid::NODES).filter(|&i| nodes.seen[i]).map(|i| lod[i]).collect();
    of_seen.sort_by(f64::total_cmp);
    let median_lod = of_seen.get(of_seen.len() / 2).copied().unwrap_or(0.0);
    Changes { vectors, normal, sigma, lod, median_lod, above_lod, state }
}

/// Marks the connected places of one sense for which `drop` is true as unchanged.
fn drop_patches(state: &mut [NodeState], normal: &[f64], drop: impl Fn(&[usize]) -> bool) {
    let label: Vec<i8> = state
        .iter()
        .zip(normal)
        .map(|(state, d)| if *state == NodeState::Seen { d.signum() as i8 } else { 0 })
        .collect();
    for patch in PlateGrid::connected_components(&label).into_iter().filter(|patch| drop(patch)) {
        patch.into_iter().for_each(|place| state[place] = NodeState::Unchanged);
    }
}
