//! Inspection figures of a measured plate: dimension checks, bending energy, painted markers, scanner calibration.

mod bending_energy;
pub mod calibration;
mod dimension_checks;
mod edge_doubt;
pub mod marker_detection;

pub use bending_energy::BendingEnergy;
pub use dimension_checks::{Check, EdgeCheck, ShapeChecks};
pub use edge_doubt::{CUT_ERROR, EdgeDoubt, corners_seen, edge_doubts};
