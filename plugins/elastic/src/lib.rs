//! Flattening `elastic`: the chart of least elastic energy of the membrane on the known outline.
//!
//! It is the default flattening.
//!
//! A plate that is pressed to a sphere or a torus stretches and shrinks in its own plane. This flattening finds the
//! positions (u, v) at which the plate, deformed from its flat shape onto the measured mid-surface, stores the least
//! membrane energy. It replaces the flattenings of Masuda et al., "Point-based shape monitoring of plate bending for
//! large-scale storage tanks" (section 4.3; plugins `abf` and `harmonic`), which are wrong by about a millimetre on
//! double curvature.
//!
//! # Method
//!
//! 1. *Start.* The fixed-boundary harmonic map; with uniform weights (Tutte) where obtuse angles fold it.
//! 2. *Energy.* St. Venant-Kirchhoff material in plane stress, constant strain per triangle, plus springs at the
//!    boundary:
//!
//!    ```text
//!    W(x) = sum over triangles of A psi(E) + sum over springs of k (n . (x - x_known))^2 / 2
//!    psi  = 1/2 S : E,   S = ((1 - nu) E + nu tr(E) I) / (1 - nu^2),   E = (F'F - I) / 2
//!    ```
//! 3. *Minimum.* Newton's method with line search (Armijo); the Hessian is projected triangle by triangle onto the
//!    positive semidefinite matrices (Teran, Sifakis, Irving, Fedkiw, "Robust quasistatic finite elements and flesh
//!    simulation", 2005). No triangle is ever inverted.
//!
//! # Boundary
//!
//! The material slides freely along the plate's edges. Across an edge, and at the corners along both of their edges,
//! springs hold it. The more certain the outline (`edge_sigma` and `corner_sigma` of the mesh), the stiffer the
//! springs. Where the plate must be strained, the springs are practically rigid. On a rolled plate they distribute a
//! wrong inset of the outline to two opposite edges instead of stretching the plate. The chart may therefore leave the
//! outline by about the uncertainty of the edge. A free boundary is not safe: it gives errors of up to 11 mm.
//!
//! # Results
//!
//! - (u, v) per vertex: exact on flat, rolled and conical plates. On a sphere of R 10 m, 5 x 2.5 m, the error is 0.01
//!   mm if the material follows least energy. If its fibres along one side keep their length, it is 0.24 mm in the mean
//!   and 0.39 mm at most.
//! - Uncertainty per vertex: the distance between these two material laws. It does not include the edges' own
//!   uncertainty, which the host adds for every flattening.
//!
//! # Limits
//!
//! The vertices must lie on the surface. Noise along the surface is harmless: the vertex is another material point and
//! receives that point's (u, v). Noise across the surface lengthens every side by half the square of the slope: s mm at
//! a spacing of h mm strain the mesh by about (s/h)^2. This is 6e-6 for 0.1 mm at 40 mm, but 1.6e-4 for 0.5 mm, as much
//! as a stroke may leave. The input must be a smoothed surface, not the scanner's points.
//!
//! # Example
//!
//! ```toml
//! [flattening]
//! plugin = "elastic"
//! [flattening.options]
//! poisson_ratio = 0.3
//! ```
//!
//! # Options
//!
//! | key | unit | default | range | meaning |
//! |---|---|---|---|---|
//! | `poisson_ratio` | 1 | 0.3 | 0 to 0.5 | Poisson's ratio nu; steel in the elastic range 0.3, flowing 0.5 |
//!
//! # Errors
//!
//! Refused are: a triangle of zero area; a triangle with all three corners on one edge of the plate; edges whose
//! lengths differ from the sides of the rectangle by more than a tenth; a mesh so rough that no minimum is found.

mod boundary_springs;
mod chart;
mod material_law_bound;
mod membrane;
mod newton;

use platen_numerics::cache_sizes;
use platen_sdk::{Error, ErrorKind, Flattening, Info, Job, Result, options};
use platen_shape::flatten::check_fit;
use platen_shape::{Chart, DiskMesh};

options! {
    /// Options of `elastic`.
    pub struct Options {
        /// Poisson's ratio: share of a stretch by which the steel shrinks across it.
        poisson_ratio: f64 = 0.3, min 0.0, max 0.5;
    }
}

struct Elastic(Options);

impl Flattening for Elastic {
    const INFO: Info = Info::new(
        c"elastic",
        c"Least membrane energy",
        c"Least membrane energy onto the known outline: right on double curvature, with uncertainty.",
        c"1.0.0",
    );
    type Options = Options;

    fn new(options: Options) -> Result<Self> {
        cache_sizes::read();
        Ok(Self(options))
    }

    fn flatten(&mut self, job: &Job<'_>, mesh: &DiskMesh) -> Result<Chart> {
        check_fit(mesh).map_err(|e| Error::new(ErrorKind::BadData, e.to_string()).hint(e.hint()))?;
        chart::elastic(mesh, self.0.poisson_ratio, || job.check())
    }
}

platen_sdk::export!(flattening Elastic);

#[cfg(test)]
mod tests;
