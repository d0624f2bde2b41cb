//! Correspondence of material points between scans of one plate.
//!
//! - `baseline`: outline of the blank from a scan of it, to which the edges of all later scans are mapped.
//! - `reorientation`: test whether the plate was put back turned or with its other face up, so that its corners have
//!   the wrong names.
//!
//! Neither is in Masuda et al., who map to the nominal rectangle and keep the plate's orientation.

mod baseline;
mod reorientation;

pub use baseline::BlankError;
pub use reorientation::{Reorientation, reorientation};
