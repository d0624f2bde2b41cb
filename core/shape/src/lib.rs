//! Geometry of platen: pure functions from the lattice of a scan to the fitted surface of the plate.
//!
//! The method is that of Masuda et al., "Point-based shape monitoring of plate bending for large-scale storage tanks"
//! (in short "Masuda et al."), with the departures listed in this crate's README. The table lists the modules in the
//! order of the data; no module uses one below it:
//!
//! | module | in -> out | method |
//! |---|---|---|
//! | [`plate`] | - -> [`PlateSpec`], [`Blank`] | nominal size, outline of the blank as cut |
//! | [`extract`] | columns of a scan -> [`Patch`] | connected components, normals of a low-pass copy, region growing |
//! | [`outline`](mod@outline) | patch -> [`Outline`] | longest boundary loop, RANSAC corners, interval-censored maximum likelihood of the edges |
//! | [`mesh`] | patch, outline -> [`DiskMesh`] | Coons patch, mid-surface, Delaunay triangulation |
//! | [`flatten`] | mesh -> [`Chart`] | interface of the flattening plugins; harmonic map and free-boundary development |
//! | [`surface`] | patch, chart -> [`Surface`] | bicubic spline S(u, v), smoothing by restricted maximum likelihood |
//! | [`range_error`] | range error of the scanner -> standard deviation of a place | propagation along the beam |
//! | [`evaluate`] | surface -> places, lines, grid | positions and curvatures with their standard deviations |
//! | [`measure`](mod@measure) | patch, outline -> [`Measurement`] | the stages from mesh to surface in one call |
//! | [`target_surface`] | target shape -> [`TargetSurface`] | closed forms; rigid registration (Kabsch) |
//! | [`template_seat`] | profile under a template -> its seat and gaps | upper convex hull |
//! | [`correspondence`] | two scans of a plate | outline of the blank by a baseline scan; test for a plate put back turned |
//! | [`inspection`] | outline, surface -> figures | dimension checks, bending energy, marker detection, calibration |
//!
//! Without the feature `measure` the crate contains only `plate`, `surface`, `target_surface` and `template_seat`,
//! which a comparison evaluates.
//!
//! Frames and units: scanner frame, metres, radians. This crate never reads a clock, a file or a socket. Every kernel
//! runs on one thread: the same columns give the same result to the last bit.

#[cfg(feature = "measure")]
pub mod correspondence;
#[cfg(feature = "measure")]
pub mod evaluate;
#[cfg(feature = "measure")]
pub mod extract;
#[cfg(feature = "measure")]
pub mod flatten;
#[cfg(feature = "measure")]
pub mod inspection;
#[cfg(feature = "measure")]
pub mod measure;
#[cfg(feature = "measure")]
pub mod mesh;
#[cfg(feature = "measure")]
pub mod outline;
pub mod plate;
#[cfg(feature = "measure")]
pub mod range_error;
pub mod surface;
pub mod target_surface;
pub mod template_seat;

#[cfg(feature = "measure")]
pub use correspondence::{BlankError, Reorientation, reorientation};
#[cfg(feature = "measure")]
pub use extract::{Beyond, Crossing, MixedPixels, Patch, PlaneBehind, PlaneSet, Sample};
#[cfg(feature = "measure")]
pub use flatten::{Chart, Flatten, FlattenError};
#[cfg(feature = "measure")]
pub use inspection::{
    BendingEnergy, CUT_ERROR, Check, EdgeCheck, EdgeDoubt, ShapeChecks, corners_seen, edge_doubts,
};
#[cfg(feature = "measure")]
pub use measure::{MeasureError, Measured, Measurement, Scanned, measure};
#[cfg(feature = "measure")]
pub use mesh::{DiskMesh, DiskParts, MeshError};
#[cfg(feature = "measure")]
pub use outline::{Corner, EdgeCurve, HeightField, Outline, OutlineError};
pub use plate::{Blank, PlateSpec, RegionOfInterest};
#[cfg(feature = "measure")]
pub use range_error::RangeError;

pub use surface::{Surface, SurfaceParts};
pub use target_surface::{Placement, TargetError, TargetSurface};

/// Half width of a 95 % interval in standard deviations; every stated uncertainty and level of detection is expanded by
/// this factor.
pub const EXPANDED: f64 = 1.96;

/// A point or vector in space, metres, scanner frame unless stated otherwise.
pub type Vec3 = nalgebra::Vector3<f64>;
