//! The harmonic map onto the rectangle.

use platen_shape::DiskMesh;
use platen_shape::flatten::{cotangents, fixed_boundary};
use platen_shape::sparse::SparseError;

/// (u, v) per vertex, metres: boundary by arc length, interior by cotangent weights.
///
/// # Errors
/// [`SparseError`].
pub(crate) fn harmonic(mesh: &DiskMesh) -> Result<Vec<[f64; 2]>, SparseError> {
    fixed_boundary(mesh, &cotangents(mesh))
}
