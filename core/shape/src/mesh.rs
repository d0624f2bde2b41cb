//! The triangle mesh of the plate's mid-surface, on which a flattening works.

mod disk;

pub use disk::{DiskMesh, DiskParts, MeshError};
