//! From samples and outline to the triangle mesh of the plate's mid-surface, on which a flattening works.

mod disk;
mod edges;
mod error;
mod face;
mod facets;
mod topology;
mod triangulate;

pub use disk::{DiskMesh, DiskParts};
pub use error::MeshError;
pub use face::Face;
pub(crate) use facets::Facets;
