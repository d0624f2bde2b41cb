//! Angle based flattening, ABF++: the paper's first method (section 4.3, equation 3).
//!
//! Of all sets of angles that a plane mesh can have, the one is taken that is nearest to the measured mesh's, relative
//! to each angle:
//!
//! ```text
//! minimise   sum (x_i - b_i)^2 / b_i^2
//! subject to x1 + x2 + x3 = pi                          in each triangle,
//!            sum of angles = 2 pi                       around each interior vertex,
//!            sum of ln sin (next) - ln sin (last) = 0   around each interior vertex, so that the ring closes
//! ```
//!
//! with b the measured angles, at interior vertices scaled to 2 pi in sum. Then the vertices are laid out by least squares
//! in these angles, the boundary held where the mesh says, on the outline by its share of each edge's arc length; that sets the scale too.
//!
//! # How it is solved
//!
//! Newton's method for the angles and multipliers; angles and the triangles' multipliers are eliminated by hand (Sheffer,
//! Levy, Mogilnitsky, Bogomyakov, "ABF++: fast and robust angle based flattening", 2005). What remains couples two
//! multipliers per interior vertex with those of its neighbours. Its sign flipped, it is symmetric and positive definite,
//! so a sparse Cholesky factor serves where ABF++ has LU, and the factor is kept as long as the steps shrink fast. The length
//! constraint stands in logarithms (Zayer, Levy, Seidel, "Linear angle based parameterization", 2007); the curvature of
//! the constraints is left out of the Hessian, which costs a step or two and no accuracy.
//!
//! Least squares in given angles with all of the boundary held is the fixed-boundary solve with the cotangents of those
//! angles: the conformal energy differs from Dirichlet's by the area of the rectangle alone.
//!
//! # When to use it
//!
//! To compare with the paper. As the harmonic map it is exact where a plate is bent without stretching, and wrong by a
//! millimetre on double curvature, since it keeps angles where the plate keeps lengths; `elastic` does not.
//!
//! # Example
//!
//! ```toml
//! [flattening]
//! plugin = "abf"
//! ```
//!
//! It has no options.
//!
//! # Refused
//!
//! A triangle without area, a triangle with all corners on one edge of the plate, edges that differ from the sides of
//! the rectangle by more than a tenth, a mesh so rough that no plane angles are found near its own.

mod angles;
mod chart;
mod reduced;

use platen_sdk::{Error, ErrorKind, Flattening, Info, Job, Result};
use platen_shape::{Chart, DiskMesh};

struct Abf;

impl Flattening for Abf {
    const INFO: Info = Info::new(
        c"abf",
        c"Angle based flattening",
        c"The paper's angle based flattening (ABF++): keeps angles, about 1 mm wrong on double curvature.",
        c"1.0.0",
    );
    type Options = ();

    fn new((): ()) -> Result<Self> {
        Ok(Self)
    }

    fn flatten(&mut self, job: &Job<'_>, mesh: &DiskMesh) -> Result<Chart> {
        platen_shape::flatten::check_fit(mesh)
            .map_err(|e| Error::new(ErrorKind::BadData, e.to_string()).hint(e.hint()))?;
        let uv = chart::abf(mesh, || job.check())?;
        Ok(Chart { uv, ..Chart::default() })
    }
}

platen_sdk::export!(flattening Abf);

#[cfg(test)]
mod tests;
