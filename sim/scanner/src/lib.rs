//! Ray-casting terrestrial laser scanner with a press shop round the plate.
//!
//! A [`Scene`] is a bent plate (its six curved faces, intersected exactly) and the [`Surroundings`]: dies, table,
//! press, floor, walls, cabinet, people, a chain. [`scan`] looks at it through a [`SimLattice`] of directions with
//! the errors of an [`Instrument`] and delivers [`SimColumn`]s, each with the truth of every cell.
//!
//! Error model: range noise that grows with distance and falls with the strength of the echo (reflectivity times
//! cosine of incidence), optionally with heavy tails; mixed ranges where the footprint straddles an edge; lost echoes, by chance,
//! by weakness and in the mirror lobe of bright metal; cyclic range error; noise of the reported angles; a back
//! face with collimation and trunnion errors of opposite sign, measured from where the scanner has moved
//! to; columns before the laser is warm. Every random number comes from one seed and belongs to a column, so that a scan
//! is the same on any number of threads.
//!
//! Frame: the scanner's, right-handed, z up, metres, radians. Knows nothing of the product.

mod bounds;
mod column;
mod device;
mod files;
mod instrument;
mod lattice;
mod measure;
mod patch;
mod ray;
mod scan;
mod scene;
mod solid;
pub mod stream;
mod surroundings;
mod truth;

pub use column::{SimColumn, SimState, TruthCell};
pub use device::{Device, DeviceError};
pub use files::{E57Encoding, FileError, FileFormat, FileOrder, SimScan};
pub use instrument::{Cyclic, Faces, Instrument};
pub use lattice::{LOWEST_DEG, SimLattice};
pub use measure::INTENSITY_MAX;
pub use ray::{Hit, Label, Ray};
pub use scan::{scan, scan_all};
pub use scene::{MARKER_RADIUS, Scene};
pub use solid::Solid;
pub use surroundings::Surroundings;
pub use truth::{CellCounts, truth_document};
