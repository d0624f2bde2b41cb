//! Flattening `abf`: angle based flattening (ABF++) with a fixed-boundary layout.
//!
//! The first flattening method of Masuda et al., "Point-based shape monitoring of plate bending for large-scale storage
//! tanks" (section 4.3, equation 3). It assigns each vertex of the mid-surface mesh its place (u, v) on the flat plate.
//!
//! # Method
//!
//! 1. *Angles.* Of all sets of angles that a plane mesh can have, the one nearest to the measured mesh's, relative to each
//!    angle:
//!
//!    ```text
//!    minimise   sum (x_i - b_i)^2 / b_i^2
//!    subject to x_1 + x_2 + x_3 = pi                     in each triangle,
//!               sum of angles = 2 pi                     around each interior vertex,
//!               sum of (ln sin x_next - ln sin x_last) = 0   around each interior vertex (the ring closes)
//!    ```
//!
//!    with b the measured angles, scaled at interior vertices so that they sum to 2 pi.
//! 2. *Layout.* Least squares in these angles with the whole boundary fixed at the places that the mesh gives for it, on the
//!    outline at their share of the edge's arc length; that sets the scale too. It equals the fixed-boundary solve with the
//!    cotangents of the new angles: with a fixed boundary the conformal energy differs from Dirichlet's by a constant, the
//!    area of the rectangle.
//!
//! # Solution
//!
//! Newton's method for angles and multipliers. The angles and the triangles' multipliers are eliminated in closed form
//! (Sheffer, Levy, Mogilnitsky, Bogomyakov, "ABF++: fast and robust angle based flattening", 2005). The remaining system
//! couples two multipliers per interior vertex with those of its neighbours. Differences from ABF++:
//!
//! - With its sign flipped the remaining system is symmetric positive definite, so it is solved by sparse Cholesky instead
//!   of LU, and the factor is reused as long as the steps shrink fast.
//! - The length constraint is stated in logarithms (Zayer, Levy, Seidel, "Linear angle based parameterization", 2007).
//! - The second derivatives of the constraints are left out of the Hessian. That costs a step or two and no accuracy.
//!
//! # Accuracy and limits
//!
//! For comparison with Masuda et al.; it has no advantage over `harmonic`. ABF is for charts whose boundary is free; a plate's is known,
//! and with that fixed both give the same chart, within 0.0001 mm on the sample plates. It is exact where a plate is bent
//! without stretching, and wrong by about a millimetre on double curvature, because it preserves angles where the plate
//! preserves lengths; use `elastic` there. The chart contains no uncertainty of its own; the host counts its distance from an elastic membrane.
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
//! Refused are: a triangle of zero area; a triangle with all three corners on one edge of the plate; edges whose lengths
//! differ from the sides of the rectangle by more than a tenth; a mesh so rough that no plane angles are found near its own.

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
