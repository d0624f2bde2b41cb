//! From samples and outline to the triangle mesh of the plate's mid-surface, on which a flattening works.

mod coons_patch;
mod disk;
mod error;
mod facets;
mod smooth_face;
mod topology;
mod triangulation;

pub use disk::{DiskMesh, DiskParts};
pub use error::MeshError;
pub(crate) use facets::Facets;
pub use smooth_face::SmoothFace;
