//! Triangle mesh of the plate's mid-surface, on which a flattening works (Masuda et al., 4.2).
//!
//! In: patch and outline. Out: the [`DiskMesh`] of about 10,000 vertices. The steps in order:
//!
//! - `coons_patch` spans the edges;
//! - `facets` project samples onto it;
//! - `smooth_face` is the smoothed face, and the mid-surface half the thickness below;
//! - `triangulation` selects vertices and joins them by Delaunay's criterion;
//! - `topology` and `disk` check that the result is one disk.
//!
//! Masuda et al. mesh the scanned face; the mid-surface is the one that bending does not stretch.

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
