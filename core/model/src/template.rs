//! Templates: straight or curved gauges laid on a reference line, whose gap to the plate is judged.

use serde::{Deserialize, Serialize};

/// A gauge whose edge is the target's section along a reference line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Template {
    /// Name; `T1`, `T2` by its place in the plate file where none is given.
    pub name: String,
    /// Name of the reference line that it lies on.
    pub line: String,
    /// Length, metres.
    pub chord: f64,
    /// Place of its middle.
    pub centre: Centre,
    /// Largest gap that passes, metres.
    pub limit: f64,
    /// Seat.
    pub seat: Seat,
    /// Origin of the rule, printed beside its verdict. Not sent to plugins.
    #[serde(skip)]
    pub source: Option<String>,
}

/// Place of a template's middle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Centre {
    /// Along the line from its first point, metres.
    At(f64),
    /// The place with the largest gap is searched along the line.
    Worst,
}

/// Seat of a template on the plate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Seat {
    /// At rest under its weight; judged balanced when it rocks.
    Gravity,
    /// Equal gaps at both ends.
    Balanced,
    /// Both ends on the profile.
    Held,
}
