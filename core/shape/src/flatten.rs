//! Flattening (parameterization) of the mid-surface mesh: every vertex gets its place (u, v) on the original rectangle.
//!
//! [`Flatten`] is the interface to the methods, which are plugins (Masuda et al., 4.3: angle based and harmonic maps).
//! This module contains the parts that they share:
//!
//! - `domain`: checks whether a mesh can be flattened;
//! - `fixed_boundary`: solves for a map with its boundary held (the harmonic map);
//! - `free_boundary`: develops a nearly developable plate with free edges, for the outline of a blank;
//! - `misplacement`: compares a chart with the equilibrium of an elastic membrane.

#[cfg(any(test, feature = "closed-form"))]
pub mod closed_form;
mod domain;
mod fixed_boundary;
mod free_boundary;
mod misplacement;

pub use domain::{
    UnfitMesh, check_fit, edges_of_vertices, first_turned, interior, plane_picture, signed_area,
};
pub use fixed_boundary::{cotangents, fixed_boundary};
pub use free_boundary::{LaidFlat, lay_flat, plane_stress};
pub use misplacement::{MOST_STRAIN, Misplacement};

use crate::mesh::DiskMesh;

/// Result of a flattening: the place of every mesh vertex on the original rectangle.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Chart {
    /// Per vertex: (u, v), metres, on the rectangle `[0, W] x [0, H]`. A method that holds the edges by springs
    /// according to their uncertainty may place vertices of the boundary outside of it by about `edge_sigma` of the
    /// mesh.
    pub uv: Vec<[f64; 2]>,
    /// Per vertex, where the method computes it: standard deviation of u and of v, metres.
    pub sigma: Option<Vec<[f64; 2]>>,
}

/// A method that flattens a mesh. Implemented by the host around a loaded plugin, and by tests.
pub trait Flatten {
    /// Computes the chart of `mesh`.
    ///
    /// # Errors
    /// [`FlattenError`], by who must act.
    fn flatten(&mut self, mesh: &DiskMesh) -> Result<Chart, FlattenError>;
}

/// Reason why there is no chart.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of a variant names its fields")]
pub enum FlattenError {
    /// The method refused the mesh or failed on it.
    #[error("flattening: {message}; {hint}")]
    Refused { message: String, hint: String },
    /// The deadline passed, or the stroke was cancelled.
    #[error("flattening: stopped: {reason}; the scan is kept, measure it again")]
    Stopped { reason: String },
    /// The method's result is not a chart of this mesh: its author must act.
    #[error("flattening: not a chart: {what}; report this scan to the author of the flattening")]
    NotAChart { what: String },
}

/// Number of standard deviations of an edge by which its place in a chart may differ from that in the mesh.
const EDGE_SIGMAS: f64 = 4.0;
/// Further allowance, metres: edges of a plate that differs from its nominal size give way to each other. Found: 0.9 mm
/// where the standard deviation is 0.2 mm; blanks are cut off their size by up to 4 mm.
const EDGE_SLACK: f64 = 5e-3;

impl Chart {
    /// Checks that this is a chart of `mesh`: one finite place per vertex, the boundary where the material's edges are
    /// known to lie, no triangle turned over, and uncertainties that are finite and not negative.
    ///
    /// # Errors
    /// [`FlattenError::NotAChart`] with the first fault.
    pub fn check(&self, mesh: &DiskMesh) -> Result<(), FlattenError> {
        let n = mesh.vertices.len();
        let fault = |what: String| Err(FlattenError::NotAChart { what });
        let lengths = [Some(self.uv.len()), self.sigma.as_ref().map(Vec::len)];
        if let Some(len) = lengths.into_iter().flatten().find(|len| *len != n) {
            return fault(format!("{len} values for {n} vertices"));
        }
        if let Some(i) = self.uv.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
            return fault(format!("vertex {i} has no finite place"));
        }
        let unsound = |sigma: &[f64; 2]| !sigma.iter().all(|s| s.is_finite() && *s >= 0.0);
        if let Some(i) = self.sigma.as_ref().and_then(|sigmas| sigmas.iter().position(unsound)) {
            return fault(format!("vertex {i} has a standard deviation that is negative or no number"));
        }
        for (k, sigma) in mesh.edge_sigma.iter().enumerate() {
            let most = EDGE_SIGMAS * sigma + EDGE_SLACK;
            for at in mesh.edge(k).skip(1).take_while(|at| *at < mesh.boundary.len()) {
                let [[u, v], [x, y]] = [self.uv[mesh.boundary[at] as usize], mesh.places[at]];
                let off = (u - x).hypot(v - y);
                let corner = mesh.corners.contains(&(at as u32));
                if off > most && !corner {
                    let [off, most] = [off, most].map(|metres| 1000.0 * metres);
                    return fault(format!("edge {k} lies up to {off:.1} mm off, {most:.1} mm are possible"));
                }
            }
        }
        let turned = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| self.uv[i as usize]);
            (b[0] - a[0]) * (c[1] - a[1]) <= (b[1] - a[1]) * (c[0] - a[0])
        };
        match mesh.triangles.iter().filter(|t| turned(t)).count() {
            0 => Ok(()),
            k => fault(format!("{k} of {} triangles turned over", mesh.triangles.len())),
        }
    }
}

#[cfg(test)]
mod tests;
