//! Figures of a measured plate beside its surface: dimension checks, bending energy, painted markers, calibration of the
//! scanner.

mod bending_energy;
pub mod calibration;
mod dimension_checks;
pub mod marker_detection;

pub use bending_energy::BendingEnergy;
pub use dimension_checks::{Check, EdgeCheck, ShapeChecks};
