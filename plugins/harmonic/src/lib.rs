//! Flattening `harmonic`: fixed-boundary harmonic map with cotangent weights.
//!
//! This is the second flattening method of Masuda et al., "Point-based shape monitoring of plate bending for
//! large-scale storage tanks" (section 4.3, equation 4), and the faster of the two. It assigns to each vertex of the
//! mid-surface mesh its position (u, v) on the flat plate.
//!
//! # Method
//!
//! The boundary vertices are fixed at the positions that the mesh gives for them: on the outline of the plate, at their
//! share of the edge's arc length. The interior vertices minimise the discrete Dirichlet energy
//!
//! ```text
//! E = sum over edges ij of k_ij |p_i - p_j|^2,    k_ij = cot a_ij + cot b_ij
//! ```
//!
//! where a_ij and b_ij are the angles opposite edge ij in its two triangles (Pinkall, Polthier, "Computing discrete
//! minimal surfaces and their conjugates", 1993). The normal equations are symmetric positive definite; one sparse
//! Cholesky factorisation serves both coordinates.
//!
//! # Accuracy and limits
//!
//! | plate | error |
//! |---|---|
//! | flat, cylinder, cone, bend bands (bent without stretching) | that of the mesh only, second order in its spacing |
//! | sphere of R 10 m, 5 x 2.5 m | systematic, about 1 mm in the mean |
//! | double curvature in general | systematic, 0.4 to 2 mm: the map preserves angles, the plate preserves lengths; use `elastic` |
//!
//! An error in the position of an edge, or in the arc length along it, enters the interior undamped. The chart contains
//! no uncertainty of its own; the host adds its distance from an elastic membrane to the uncertainty.
//!
//! # Example
//!
//! ```toml
//! [flattening]
//! plugin = "harmonic"
//! ```
//!
//! # Options
//!
//! None.
//!
//! # Errors
//!
//! Refused are: a triangle of zero area; a triangle with all three corners on one edge of the plate; edges whose
//! lengths differ from the sides of the rectangle by more than a tenth.

use platen_numerics::cache_sizes;
use platen_numerics::sparse::SparseError;
use platen_sdk::{Error, ErrorKind, Flattening, Info, Job, Result};
use platen_shape::flatten::{check_fit, cotangents, fixed_boundary};
use platen_shape::{Chart, DiskMesh};

struct Harmonic;

impl Flattening for Harmonic {
    const INFO: Info = Info::new(
        c"harmonic",
        c"Harmonic map",
        c"Fixed-boundary harmonic map: exact on cylinders and cones, about 1 mm wrong on double curvature.",
        c"1.0.0",
    );
    type Options = ();

    fn new((): ()) -> Result<Self> {
        cache_sizes::read();
        Ok(Self)
    }

    fn flatten(&mut self, job: &Job<'_>, mesh: &DiskMesh) -> Result<Chart> {
        check_fit(mesh).map_err(|e| Error::new(ErrorKind::BadData, e.to_string()).hint(e.hint()))?;
        job.check()?;
        let uv = harmonic(mesh).map_err(|e| {
            Error::new(ErrorKind::BadData, e.to_string()).hint("scan again; if it stays, report this scan")
        })?;
        Ok(Chart { uv, ..Chart::default() })
    }
}

/// Returns (u, v) per vertex, metres.
fn harmonic(mesh: &DiskMesh) -> std::result::Result<Vec<[f64; 2]>, SparseError> {
    fixed_boundary(mesh, &cotangents(mesh))
}

platen_sdk::export!(flattening Harmonic);

#[cfg(test)]
mod tests;
