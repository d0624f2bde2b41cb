//! Flattening `abf`: angle based flattening (ABF++) with a fixed-boundary layout.
//!
//! This is the first flattening method of Masuda et al., "Point-based shape monitoring of plate bending for large-scale
//! storage tanks" (section 4.3, equation 3). It assigns to each vertex of the mid-surface mesh its position (u, v) on
//! the flat plate.
//!
//! # Method
//!
//! 1. *Angles.* Of all sets of angles that a plane mesh can have, the method finds the one nearest to the angles of the
//!    measured mesh, relative to each angle:
//!
//!    ```text
//!    minimise   sum (x_i - b_i)^2 / b_i^2
//!    subject to x_1 + x_2 + x_3 = pi                     in each triangle,
//!               sum of angles = 2 pi                     around each interior vertex,
//!               sum of (ln sin x_next - ln sin x_last) = 0   around each interior vertex (the ring closes)
//!    ```
//!
//!    with b the measured angles, scaled at interior vertices so that they sum to 2 pi.
//! 2. *Layout.* A least-squares layout with these angles. The whole boundary is fixed at the positions that the mesh
//!    gives for it, on the outline at their share of the edge's arc length; this also determines the scale. The layout
//!    equals the fixed-boundary solve with the cotangents of the new angles: with a fixed boundary the conformal energy
//!    differs from Dirichlet's by a constant, the area of the rectangle.
//!
//! # Solution
//!
//! The equations for angles and multipliers are solved by Newton's method. The angles and the triangles' multipliers
//! are eliminated in closed form (Sheffer, Levy, Mogilnitsky, Bogomyakov, "ABF++: fast and robust angle based
//! flattening", 2005). The remaining system couples two multipliers per interior vertex with those of its neighbours.
//! Differences from ABF++:
//!
//! - With its sign flipped the remaining system is symmetric positive definite, so it is solved by sparse Cholesky
//!   instead of LU, and the factor is reused as long as the steps shrink fast.
//! - The length constraint is stated in logarithms (Zayer, Levy, Seidel, "Linear angle based parameterization", 2007).
//! - The second derivatives of the constraints are left out of the Hessian. This costs one or two additional steps and
//!   no accuracy.
//!
//! # Accuracy and limits
//!
//! This plugin exists for comparison with Masuda et al.; it has no advantage over `harmonic`. ABF is made for charts
//! with a free boundary. The boundary of a plate is known, and with a fixed boundary both give the same chart, within
//! 0.0001 mm on the sample plates. The chart is exact where a plate is bent without stretching. On double curvature it
//! is wrong by about a millimetre, because it preserves angles where the plate preserves lengths; use `elastic` there.
//! The chart contains no uncertainty of its own; the host adds its distance from an elastic membrane to the
//! uncertainty.
//!
//! # Example
//!
//! ```toml
//! [flattening]
//! plugin = "abf"
//! ```
//!
//! # Options
//!
//! None.
//!
//! # Errors
//!
//! Refused are: a triangle of zero area; a triangle with all three corners on one edge of the plate; edges whose
//! lengths differ from the sides of the rectangle by more than a tenth; a mesh so rough that no plane angles are found
//! near its own.

mod angles;
mod chart;
mod reduced_system;

use platen_numerics::cache_sizes;
use platen_sdk::{Error, ErrorKind, Flattening, Info, Job, Result};
use platen_shape::flatten::check_fit;
use platen_shape::{Chart, DiskMesh};

struct Abf;

impl Flattening for Abf {
    const INFO: Info = Info::new(
        c"abf",
        c"Angle based flattening",
        c"Angle based flattening (ABF++): keeps angles, about 1 mm wrong on double curvature.",
        c"1.0.0",
    );
    type Options = ();

    fn new((): ()) -> Result<Self> {
        cache_sizes::read();
        Ok(Self)
    }

    fn flatten(&mut self, job: &Job<'_>, mesh: &DiskMesh) -> Result<Chart> {
        check_fit(mesh).map_err(|e| Error::new(ErrorKind::BadData, e.to_string()).hint(e.hint()))?;
        let uv = chart::abf(mesh, || job.check())?;
        Ok(Chart { uv, ..Chart::default() })
    }
}

platen_sdk::export!(flattening Abf);

#[cfg(test)]
mod tests;
