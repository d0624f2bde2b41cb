//! Flattening by least membrane energy onto the known outline, that of the blank or the rectangle as ordered: the default.
//!
//! A plate that is pressed to a sphere or a torus must stretch and shrink in its own plane. This flattening looks for the
//! places (u, v) at which the plate, drawn from its flat shape onto the measured mid-surface, has stored the least
//! membrane energy (St. Venant and Kirchhoff, plane stress). It starts from the harmonic map and takes Newton's steps
//! with a Hessian made positive triangle by triangle; no triangle is ever turned over.
//!
//! # The boundary
//!
//! The material slides along the plate's edges. Across an edge, and in the corners along both of their edges, it is held
//! by springs as stiff as the outline is known (`edge_sigma` and `corner_sigma` of the mesh). Where the plate must be
//! strained the springs are as good as rigid; on a rolled plate they let a wrong inset of the outline go to both sides
//! evenly instead of into the lengths between them. So the chart may leave the outline by about the uncertainty of
//! the edge. A boundary without springs is not safe: up to 11 mm wrong.
//!
//! # What it answers
//!
//! - (u, v) per vertex: exact on flat, rolled and conical plates; on a sphere of R 10 m, 5 x 2.5 m, 0.01 mm from the material
//!   when that follows least energy and 0.24 mm (mean; 0.39 mm at most) when its fibres along one side keep their length.
//! - Strain per vertex: Green's, area-weighted over the triangles around it.
//! - Uncertainty per vertex: the distance between those two laws of the material. What the edges' own uncertainty leaves
//!   between them is not in it; the host adds that for every flattening.
//!
//! # What it needs
//!
//! Vertices that lie on the surface. Noise along the surface does no harm: a vertex that is measured elsewhere in the
//! surface is another material point, and gets its (u, v). Noise across it makes every length longer by half the square of
//! the slope: s mm at a spacing of h mm strain the mesh by about (s/h)^2, evenly spread 0.1 mm at 40 mm 6e-6, but 0.5 mm
//! 1.6e-4, as much as a stroke may leave. Give it a smoothed surface, not the scanner's points.
//!
//! # Example
//!
//! ```toml
//! [flattening]
//! plugin = "elastic"
//! ```
//!
//! | option | unit | default | |
//! |---|---|---|---|
//! | `poisson_ratio` | | 0.3 | 0 to 0.5; steel in the elastic range 0.3, flowing 0.5 |
//!
//! # Refused
//!
//! A triangle without area, a triangle with all corners on one edge of the plate, edges that differ from the sides of
//! the rectangle by more than a tenth, a mesh so rough that no minimum is found.

mod chart;
mod hold;
mod membrane;
mod minimum;
mod spread;

use platen_sdk::{Error, ErrorKind, Flattening, Info, Job, Result, options};
use platen_shape::{Chart, DiskMesh};

options! {
    /// Options of the elastic flattening.
    pub struct Options {
        /// Share of a stretch by which the steel shrinks across it.
        poisson_ratio: f64 = 0.3, min 0.0, max 0.5;
    }
}

struct Elastic(Options);

impl Flattening for Elastic {
    const INFO: Info = Info::new(
        c"elastic",
        c"Least membrane energy",
        c"Least membrane energy onto the known outline: right on double curvature, with strain and uncertainty.",
        c"1.0.0",
    );
    type Options = Options;

    fn new(options: Options) -> Result<Self> {
        Ok(Self(options))
    }

    fn flatten(&mut self, job: &Job<'_>, mesh: &DiskMesh) -> Result<Chart> {
        platen_shape::flatten::check_fit(mesh)
            .map_err(|e| Error::new(ErrorKind::BadData, e.to_string()).hint(e.hint()))?;
        chart::elastic(mesh, self.0.poisson_ratio, || job.check())
    }
}

platen_sdk::export!(flattening Elastic);

#[cfg(test)]
mod tests;
