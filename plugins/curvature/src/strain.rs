//! Membrane strain of the mid-surface.

use platen_model::{Figure, NodeState, Report};
use platen_sdk::PlateGrid;
use platen_shape::Surface;

use crate::Nodes;

/// Adds the membrane strain of the mid-surface: Green's strain of S(u, v) against the flat rectangle,
/// (|S_u|^2 - 1) / 2, (|S_v|^2 - 1) / 2 and S_u . S_v / 2.
///
/// The strain is that of the flattening's material map: of least energy with `elastic`; with `harmonic` it includes the
/// map's own error.
pub(crate) fn add(report: &mut Report, nodes: &Nodes, now: &Surface) {
    let strain = nodes.grid.map(|u, v| {
        let d = now.derivatives(u, v);
        [0.5 * (d.u.norm_squared() - 1.0), 0.5 * (d.v.norm_squared() - 1.0), 0.5 * d.u.dot(&d.v)]
    });
    let principal = |i: usize, sign: f64| {
        let [along, across, shear] = strain[i];
        0.5 * (along + across) + sign * (0.5 * (along - across)).hypot(shear)
    };
    let seen: Vec<bool> = nodes.grid.map(|u, v| now.mask().seen(u, v));
    for (name, sign) in [("strain.max", 1.0), ("strain.min", -1.0)] {
        let of_seen = (0..PlateGrid::NODES).filter(|i| seen[*i]).map(|i| (i, principal(i, sign)));
        let most = of_seen.max_by(|a, b| (sign * a.1).total_cmp(&(sign * b.1)));
        let figure = most.map(|(i, value)| Figure::new(name, value, "1").at(nodes.grid.at(i)));
        report.findings.figures.extend(figure);
    }
    let state: Vec<NodeState> = seen.into_iter().map(NodeState::from).collect();
    for (k, name) in ["strain_u", "strain_v", "strain_uv"].into_iter().enumerate() {
        let values = strain.iter().map(|strain| strain[k]).collect();
        report.fields.push(nodes.grid.scalar(name, "1", values, state.clone()));
    }
}
