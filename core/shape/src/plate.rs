//! Plate data of a measurement: nominal size and position ([`PlateSpec`]) and the outline as cut ([`Blank`]).

mod blank;
mod spec;

pub use blank::Blank;
pub use spec::{PlateSpec, RegionOfInterest};
