//! From the lattice to the plate: the geometry of platen, as pure functions of their arguments.
//!
//! The modules follow the data: `extract` finds the plate's scanned face among the samples of a scan,
//! `outline` its boundary loop, four corners and four edge curves, `mesh` the mid-surface mesh, a flattening
//! (a plugin, seen here only as the trait `Flatten`) gives every vertex its place on the original plate (`Blank`: its outline),
//! `surface` fits S(u, v), `evaluate` reads lines, markers and grids off it.
//!
//! Frames and units: scanner frame, metres, radians. This crate never reads a clock, a file or a socket.

mod baseline;
mod blank;
pub mod calibration;
mod checks;
pub mod discs;
pub mod evaluate;
pub mod extract;
pub mod flatten;
mod forming;
pub mod measure;
pub mod mesh;
pub mod outline;
mod patch;
mod plane;
mod plate;
mod sheet;
mod stages;
pub mod surface;
mod target;
mod turned;

pub use baseline::BlankError;
pub use blank::Blank;
pub use checks::{Check, EdgeCheck, ShapeChecks};
pub use flatten::{Chart, Flatten, FlattenError};
pub use forming::Forming;
pub use measure::{MeasureError, Measurement, measure};
pub use mesh::{DiskMesh, DiskParts, MeshError};
pub use outline::{Corner, EdgeCurve, Outline, OutlineError};
pub use patch::{Beyond, Crossing, Patch, Sample};
pub use plate::{PlateSpec, RegionOfInterest};
pub use sheet::Sheet;
pub use stages::{Measured, Scanned};
pub use surface::{Surface, SurfaceParts};
pub use target::{Placement, TargetError, TargetSurface};
pub use turned::{Turned, turned};

/// Half width of a 95 % interval in standard deviations: every stated uncertainty and level of detection is expanded by it.
pub const EXPANDED: f64 = 1.96;

/// A point or vector in space, metres, scanner frame unless said.
pub type Vec3 = nalgebra::Vector3<f64>;
