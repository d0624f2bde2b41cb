//! What is asked of a comparison and what it answers: plain data that crosses the plugin boundary as JSON.
//!
//! Lengths in metres, angles in radians, places as (u, v) on the original rectangle.

mod findings;
mod target;

pub use findings::{Contact, Figure, Findings, TemplateFinding, Verdict};
pub use target::{Facing, RadiusOf, Target, TargetShape};

use serde::{Deserialize, Serialize};

/// What is asked of a comparison.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Task {
    /// Name of the plate.
    pub plate: String,
    /// Extent along u.
    pub width: f64,
    /// Extent along v.
    pub height: f64,
    /// Thickness.
    pub thickness: f64,
    /// What the plate is to become, when the plate file says so.
    pub target: Option<Target>,
    /// Lines on the plate.
    pub reference_lines: Vec<ReferenceLine>,
    /// Boards to be laid on lines.
    pub templates: Vec<Template>,
    /// Places of which single figures are wanted.
    pub stations: Vec<Station>,
    /// Correlated part of the level of detection of a position, one sigma, from null pairs; 0 when not calibrated.
    pub sigma_correlated: f64,
    /// The scanner's systematic uncertainty against a known artefact, one sigma; `None` when never calibrated.
    pub sigma_true: Option<f64>,
    /// Places that rest on the press's supports while the plate is scanned.
    pub supports: Vec<[f64; 2]>,
    /// The plate rests on other supports than in the scan before.
    pub supports_changed: bool,
}

/// A straight line on the original rectangle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReferenceLine {
    /// Name.
    pub name: String,
    /// First point.
    pub from: [f64; 2],
    /// Last point.
    pub to: [f64; 2],
}

/// A board whose edge is the target's section along a line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Template {
    /// Name.
    pub name: String,
    /// Name of the reference line that it lies on.
    pub line: String,
    /// Length of the board.
    pub chord: f64,
    /// Where its middle lies.
    pub centre: Centre,
    /// Largest gap that passes.
    pub limit: f64,
    /// How it is held.
    pub seat: Seat,
}

/// Where the middle of a board lies.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Centre {
    /// Along the line, from its first point.
    At(f64),
    /// The place with the largest gap is searched along the line.
    Worst,
}

/// How a board is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Seat {
    /// It rests where it comes to rest; judged balanced when it rocks.
    Gravity,
    /// Equal gaps at both ends.
    Balanced,
    /// Both ends are set on the profile.
    Held,
}

/// A place of which one figure is wanted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Station {
    /// Name.
    pub name: String,
    /// Place.
    pub at: [f64; 2],
    /// Which figure.
    pub quantity: Quantity,
}

/// Figures of a station.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Measured minus target along the target's normal.
    Deviation,
    /// Gap of the nearest template.
    Gap,
    /// Target's curvature minus measured, along the line of bending.
    CurvatureDeficit,
}
