//! History of a plate: the input of an advisor besides the surfaces; it crosses the plugin boundary as JSON
//! (`platen.record/1`).

use serde::{Deserialize, Serialize};

use crate::{Task, TemplateFinding};

/// Strokes of a plate so far, with what the press and the scans said of them, in the order of the strokes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PlateHistory {
    /// Plate, target, lines and templates.
    pub task: Task,
    /// Templates as the comparisons laid them at the last scan.
    pub templates: Vec<TemplateFinding>,
    /// Die in use; `None` when the plant file has none of the press's number.
    pub die: Option<Die>,
    /// Steel of the plate; `None` when the plate file names none.
    pub steel: Option<Steel>,
    /// Strokes since the blank, the last one last.
    pub strokes: Vec<PressedStroke>,
    /// Prior of the depth law.
    pub like: Option<LikePlates>,
    /// The plate may be turned over on this press.
    pub may_turn_over: bool,
    /// The press reports the depth of its ram.
    #[serde(default = "reported")]
    pub tells_depth: bool,
}

/// Returns the default: records older than this field are from presses that report the depth.
fn reported() -> bool {
    true
}

/// A die set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Die {
    /// Number that the press reports (`die_id`).
    pub id: u16,
    /// Distance between the shoulders, metres.
    pub opening: f64,
    /// Nearest distance of a bend line from an edge of the plate, metres.
    pub edge: f64,
    /// Radius of the punch, metres; `None` where the plant file names none.
    #[serde(default)]
    pub punch_radius: Option<f64>,
}

/// Steel of a plate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Steel {
    /// Grade, as ordered.
    pub grade: Option<String>,
    /// Mean yield strength of the certificates, pascals.
    pub yield_strength: f64,
    /// Heat number.
    pub heat: Option<String>,
}

/// One stroke of the press.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default)]
pub struct PressedStroke {
    /// Row of the record; 0 outside a host.
    pub run_id: i64,
    /// Number of the stroke, as the press counts.
    pub stroke: u16,
    /// Bend that was advised before it and followed.
    pub wanted: Option<WantedBend>,
    /// Deepest position of the ram below its touch on a flat plate of nominal thickness, metres.
    pub depth: Option<f64>,
    /// Largest force, newtons.
    pub force: Option<f64>,
    /// Its bends are not known.
    pub not_measured: bool,
    /// A stroke before it was not measured: the bends are those of both, and the depth belongs to one of them alone.
    pub missed_before: bool,
    /// Bends that this stroke made, the largest first.
    pub bends: Vec<Bend>,
}

/// Bend that was advised before a stroke.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct WantedBend {
    /// Place of the line's middle (u, v), metres.
    pub at: [f64; 2],
    /// Angle, radians.
    pub angle: f64,
    /// Depth, metres.
    pub depth: Option<f64>,
}

/// A bend that a stroke made, as the surfaces before and after it show.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Bend {
    /// Its middle (u, v), metres.
    pub at: [f64; 2],
    /// Direction of its straight lines, from u towards v, radians.
    pub direction: f64,
    /// Rotation from one side to the other, radians, positive towards the scanner.
    pub angle: f64,
    /// Standard deviation of the angle, radians.
    pub sigma: f64,
}

/// Prior of the depth law, from earlier plates of the same kind (die set, thickness, grade, direction of the bends).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LikePlates {
    /// Number of plates.
    pub plates: u32,
    /// Mean of the depth law's offset, metres, and slope, metres per radian.
    pub mean: [f64; 2],
    /// Their covariance between plates, row by row.
    pub covariance: [[f64; 2]; 2],
    /// Standard deviation of reported minus wanted depth, metres; `None` before any advice was followed.
    pub ram_sigma: Option<f64>,
}
