//! The triangle mesh of the plate's mid-surface, on which a flattening works.

mod disk;
mod topology;

pub use disk::{DiskMesh, DiskParts, MeshError};
