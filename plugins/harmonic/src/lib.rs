//! Flattening by harmonic map: the paper's second method (HM, section 4.3, equation 4), its fastest.
//!
//! The boundary is laid where the mesh says, on the plate's outline by its share of each edge's arc length; the interior follows by minimising
//! sum k_ij |p_i - p_j|^2 with k_ij = cot a_ij + cot b_ij, the cotangents of the angles opposite to the edge ij. One
//! sparse Cholesky factorisation serves both coordinates.
//!
//! # When to use it
//!
//! Exact, up to the mesh, on plates that are bent without stretching: flat, cylinder, cone, bend bands. On double
//! curvature it is wrong by a systematic 0.4 to 2 mm (sphere R 10 m, 5 x 2.5 m: 1 mm mean), since it spreads angles
//! evenly instead of lengths; there use `elastic`. Both errors of the edge's place and of its length along the edge
//! pass into the interior undamped. It tells neither strain nor uncertainty.
//!
//! # Example
//!
//! ```toml
//! [flattening]
//! plugin = "harmonic"
//! ```
//!
//! It has no options.
//!
//! # Refused
//!
//! A triangle without area, a triangle with all corners on one edge of the plate, edges that differ from the sides of
//! the rectangle by more than a tenth.

mod map;

use platen_sdk::{Error, ErrorKind, Flattening, Info, Job, Result};
use platen_shape::{Chart, DiskMesh};

struct Harmonic;

impl Flattening for Harmonic {
    const INFO: Info = Info::new(
        c"harmonic",
        c"Harmonic map",
        c"The paper's harmonic map: exact on cylinders and cones, about 1 mm wrong on double curvature.",
        c"1.0.0",
    );
    type Options = ();

    fn new((): ()) -> Result<Self> {
        Ok(Self)
    }

    fn flatten(&mut self, job: &Job<'_>, mesh: &DiskMesh) -> Result<Chart> {
        platen_shape::flatten::check_fit(mesh)
            .map_err(|e| Error::new(ErrorKind::BadData, e.to_string()).hint(e.hint()))?;
        job.check()?;
        let uv = map::harmonic(mesh).map_err(|e| {
            Error::new(ErrorKind::BadData, e.to_string()).hint("scan again; if it stays, report this scan")
        })?;
        Ok(Chart { uv, ..Chart::default() })
    }
}

platen_sdk::export!(flattening Harmonic);

#[cfg(test)]
mod tests;
