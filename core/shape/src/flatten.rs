//! Flattening (parameterization) of the mid-surface mesh: every vertex gets its place (u, v) on the original rectangle.
//!
//! [`Flatten`] is the interface to the methods, which are plugins (Masuda et al., 4.3: angle based and harmonic maps). Here are
//! the parts they share: `domain` checks what can be flattened, `fixed_boundary` solves for a map with its boundary held
//! (the harmonic map), `free_boundary` develops a nearly developable plate with free edges, for the outline of a blank.

#[cfg(any(test, feature = "closed-form"))]
pub mod closed_form;
mod domain;
mod fixed_boundary;
mod free_boundary;

pub use domain::{
    UnfitMesh, check_fit, edges_of_vertices, first_turned, interior, plane_picture, signed_area,
};
pub use fixed_boundary::{cotangents, fixed_boundary};
pub use free_boundary::{LaidFlat, lay_flat, plane_stress};

use crate::mesh::DiskMesh;

/// A flattening's result: the place of every mesh vertex on the original rectangle.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Chart {
    /// Per vertex: (u, v), metres, on the rectangle `[0, W] x [0, H]`. A method that holds the edges only as firmly as
    /// they are known may place vertices of the boundary outside of it by about `edge_sigma` of the mesh.
    pub uv: Vec<[f64; 2]>,
    /// Per vertex, where the method computes it: membrane strain of the mid-surface against the rectangle,
    /// `[e_uu, e_vv, e_uv]` (tensor component, half the engineering shear), positive when stretched.
    pub strain: Option<Vec<[f64; 3]>>,
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
    /// The method answered with something that is no chart of this mesh: its author must act.
    #[error("flattening: not a chart: {what}; report this scan to the author of the flattening")]
    NotAChart { what: String },
}

impl Chart {
    /// Checks that this is a chart of `mesh`: one finite place per vertex, no triangle turned over.
    ///
    /// # Errors
    /// [`FlattenError::NotAChart`] with the first fault.
    pub fn check(&self, mesh: &DiskMesh) -> Result<(), FlattenError> {
        let n = mesh.vertices.len();
        let fault = |what: String| Err(FlattenError::NotAChart { what });
        let lengths =
            [Some(self.uv.len()), self.strain.as_ref().map(Vec::len), self.sigma.as_ref().map(Vec::len)];
        if let Some(len) = lengths.into_iter().flatten().find(|len| *len != n) {
            return fault(format!("{len} values for {n} vertices"));
        }
        if let Some(i) = self.uv.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
            return fault(format!("vertex {i} has no finite place"));
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
