//! Measurement of a plate: the stages from its samples and outline to its surface S(u, v) in one call.
//!
//! ```text
//! Patch, Outline -> SmoothFace (smooth face and mid-surface) -> DiskMesh -> Chart (the flattening) -> Surface
//! ```

#[cfg(test)]
mod scene;
mod stages;
#[cfg(test)]
mod tests;

pub use stages::{Measured, Scanned};

use std::time::Duration;

use platen_numerics::join::join;
use platen_numerics::spline_fit::Undetermined;

use crate::evaluate::Location;
use crate::flatten::Misplacement;
use crate::mesh::{MeshError, SmoothFace};
use crate::surface::{FitToSamples, Quality, Surface, fit_surface};
use crate::{Blank, Chart, DiskMesh, Flatten, FlattenError, Outline, Patch, PlateSpec, Vec3};

/// Number of vertices of the mesh: about as many as in Masuda et al. (10,188).
pub const N_VERTICES: usize = 10_000;

/// One measured plate.
#[derive(Debug, Clone)]
pub struct Measurement {
    /// The mid-surface over the original rectangle.
    pub surface: Surface,
    /// The mesh that was flattened.
    pub mesh: DiskMesh,
    /// The flattening of the mesh.
    pub chart: Chart,
    /// Distance of the chart from an elastic membrane.
    pub misplacement: Misplacement,
    /// Uncertainty of material points.
    pub location: Location,
    /// The blank's corners (0,0), (W,0), (W,H), (0,H) on the scanned face, metres, scanner frame.
    pub corners: [Vec3; 4],
    /// Quality of the scan.
    pub quality: Quality,
    /// Time of each stage.
    pub timings: Timings,
}

/// Time spent in each stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Timings {
    /// Smooth face, mid-surface and mesh.
    pub mesh: Duration,
    /// Flattening, and the check of its chart.
    pub flatten: Duration,
    /// S(u, v) with its covariance and, at the same time, the chart's distance from an elastic membrane.
    pub surface: Duration,
}

/// Reason why there is no measurement.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeasureError {
    /// No mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// No chart.
    #[error(transparent)]
    Flatten(#[from] FlattenError),
    /// No surface.
    #[error("surface: {0}; scan again with the plate in full view")]
    Surface(#[from] Undetermined),
}

/// Measures a plate whose edges lie on the outline of `blank`. `clock` returns the time since a fixed moment and is
/// read between the stages.
///
/// # Errors
/// [`MeasureError`]: too few samples, a mesh that is not a disk, or a refusal by the flattening.
pub fn measure(
    patch: &Patch,
    outline: &Outline,
    spec: &PlateSpec,
    blank: &Blank,
    flatten: &mut dyn Flatten,
    clock: &mut dyn FnMut() -> Duration,
) -> Result<Measurement, MeasureError> {
    let start = clock();
    let face = SmoothFace::of(patch, outline, spec);
    let (mesh, places) = face.mesh(outline, spec, blank, N_VERTICES)?;
    let meshed = clock();
    let chart = flatten.flatten(&mesh)?;
    chart.check(&mesh)?;
    let flattened = clock();
    // The two are independent. On two threads for speed only: benchmark `measure_but_flattening`.
    let (misplacement, fit) =
        join(|| Misplacement::of(&mesh, &chart), || fit_surface(patch, &face, &places, &chart, spec));
    let (misplacement, FitToSamples { surface, quality }) = (misplacement?, fit?);
    let fitted = clock();
    Ok(Measurement {
        corners: blank.corners.map(|[u, v]| surface.face(u, v)),
        location: Location::new(&mesh, &chart, &misplacement),
        surface,
        mesh,
        chart,
        misplacement,
        quality,
        timings: Timings {
            mesh: meshed.saturating_sub(start),
            flatten: flattened.saturating_sub(meshed),
            surface: fitted.saturating_sub(flattened),
        },
    })
}
