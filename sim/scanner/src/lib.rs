//! Terrestrial laser scanner simulated by ray casting, with a press shop around the plate.
//!
//! A [`Scene`] consists of a bent plate and its [`Surroundings`]: dies, table, press, floor, walls, cabinet, people, a
//! chain. Rays are intersected with the curved faces of the plate by Newton's method on parametric patches, which are
//! found through a bounding volume hierarchy. Intersections with boxes and capsules have a closed form. [`scan`] casts
//! one ray per direction of a [`SimLattice`], applies the errors of an [`Instrument`] and delivers [`SimColumn`]s
//! together with the ground truth of every cell.
//!
//! Error model:
//!
//! - range noise that grows with distance and falls with the strength of the echo (reflectivity times cosine of
//!   incidence), optionally with heavy tails (Student's t)
//! - mixed pixels where the footprint straddles an edge (power-weighted mean)
//! - lost echoes: by chance, by weakness, and in the specular lobe of bright metal
//! - cyclic range error of a phase measurement
//! - noise of the reported angles
//! - a back face with collimation and trunnion errors of opposite sign and a displaced origin
//! - columns measured before the laser is warm
//!
//! All random numbers derive from one seed and are assigned per column, so that a scan does not depend on the number of
//! threads.
//!
//! [`stream`] serves scans by the scan bridge protocol, with faults of link, bridge and scanner on request; [`SimScan`]
//! writes them as files.
//!
//! Frame: the scanner's, right-handed, z up; metres, radians. No code is shared with the product.

mod beam;
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

pub use beam::Beam;
pub use column::{SimColumn, SimState, TruthCell};
pub use device::{Device, DeviceError};
pub use files::{E57Encoding, FileError, FileFormat, FileOrder, SimScan};
pub use instrument::{Cyclic, Faces, Instrument, WideErrors};
pub use lattice::{LOWEST_DEG, SimLattice};
pub use measure::INTENSITY_MAX;
pub use ray::{Hit, Label, Ray};
pub use scan::{scan, scan_all};
pub use scene::{MARKER_RADIUS, Scene};
pub use solid::Solid;
pub use surroundings::Surroundings;
pub use truth::{CellCounts, truth_document};
