//! Harmonic map as a flattening without its plugin.
//!
//! It is that of Masuda et al., "Point-based shape monitoring of plate bending for large-scale storage tanks".

#![allow(unreachable_pub, reason = "test code")]

use platen_shape::flatten::{cotangents, fixed_boundary};
use platen_shape::{Chart, DiskMesh, Flatten, FlattenError};

pub struct Harmonic;

impl Flatten for Harmonic {
    fn flatten(&mut self, mesh: &DiskMesh) -> Result<Chart, FlattenError> {
        let refused = |message| FlattenError::Refused { message, hint: "a test's own fault".into() };
        let uv = fixed_boundary(mesh, &cotangents(mesh)).map_err(|e| refused(e.to_string()))?;
        Ok(Chart { uv, ..Chart::default() })
    }
}
