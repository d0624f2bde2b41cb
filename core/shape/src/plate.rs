//! Input of a measurement: nominal size and position of the plate ([`PlateSpec`]) and the outline it was cut to ([`Blank`]).

mod blank;
mod spec;

pub use blank::Blank;
pub use spec::{PlateSpec, RegionOfInterest};
