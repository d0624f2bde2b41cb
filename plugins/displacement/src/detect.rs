//! What changed beyond doubt.

use platen_sdk::NodeState;
use platen_shape::Vec3;

use crate::align::Motion;
use crate::grid::{NODES, Nodes};

/// Half width of a 95 % interval in standard deviations.
const EXPANDED: f64 = 1.96;

/// Displacement at every node.
#[derive(Debug)]
pub(crate) struct Changes {
    /// Scanner frame, metres.
    pub(crate) vectors: Vec<Vec3>,
    /// Along the normal, towards the scanner, metres.
    pub(crate) normal: Vec<f64>,
    /// Level of detection, metres.
    pub(crate) lod: Vec<f64>,
    /// Its median over what was seen.
    pub(crate) median_lod: f64,
    /// What is known.
    pub(crate) state: Vec<NodeState>,
}

pub(crate) fn changes(nodes: &Nodes, motion: &Motion, sigma_correlated: f64, min_patch: f64) -> Changes {
    let moved: Vec<Vec3> = nodes.before.iter().map(|p| motion.apply(p)).collect();
    let vectors: Vec<Vec3> = nodes.now.iter().zip(&moved).map(|(now, before)| now - before).collect();
    let normal: Vec<f64> = vectors.iter().zip(&nodes.normal).map(|(d, n)| d.dot(n)).collect();
    let lod: Vec<f64> = (0..nodes.len())
        .map(|i| {
            let align = motion.sigma(&nodes.before[i], &nodes.normal[i]);
            EXPANDED * nodes.sigma[i].hypot(sigma_correlated).hypot(align)
        })
        .collect();
    let mut state: Vec<NodeState> = (0..nodes.len())
        .map(|i| match (nodes.seen[i], normal[i].abs() < lod[i]) {
            (false, _) => NodeState::Unseen,
            (true, true) => NodeState::Unchanged,
            (true, false) => NodeState::Seen,
        })
        .collect();
    drop_small_patches(&mut state, &normal, (min_patch / nodes.cell) as usize);
    let mut seen: Vec<f64> = (0..nodes.len()).filter(|&i| nodes.seen[i]).map(|i| lod[i]).collect();
    let middle = seen.len() / 2;
    let median_lod =
        if seen.is_empty() { 0.0 } else { *seen.select_nth_unstable_by(middle, f64::total_cmp).1 };
    Changes { vectors, normal, lod, median_lod, state }
}

/// Connected places of change in one sense that number fewer than `least` become unchanged.
fn drop_small_patches(state: &mut [NodeState], normal: &[f64], least: usize) {
    let mut visited = vec![false; state.len()];
    for first in 0..state.len() {
        if visited[first] || state[first] != NodeState::Seen {
            continue;
        }
        let mut patch = vec![first];
        visited[first] = true;
        let mut next = 0;
        while let Some(&at) = patch.get(next) {
            next += 1;
            for neighbour in neighbours(at) {
                let same = state[neighbour] == NodeState::Seen && normal[neighbour] * normal[first] > 0.0;
                if same && !visited[neighbour] {
                    visited[neighbour] = true;
                    patch.push(neighbour);
                }
            }
        }
        if patch.len() < least {
            for place in patch {
                state[place] = NodeState::Unchanged;
            }
        }
    }
}

fn neighbours(at: usize) -> impl Iterator<Item = usize> {
    let (u, v) = (at % NODES, at / NODES);
    let candidates = [
        (u > 0, at.wrapping_sub(1)),
        (u + 1 < NODES, at + 1),
        (v > 0, at.wrapping_sub(NODES)),
        (v + 1 < NODES, at + NODES),
    ];
    candidates.into_iter().filter_map(|(inside, place)| inside.then_some(place))
}
