//! Task of a comparison: its input besides the surfaces, which crosses the plugin boundary as JSON (`platen.task/1`).

use serde::{Deserialize, Serialize};

use crate::{ReferenceLine, Station, Support, Target, Template};

/// Input of a comparison beside the surfaces.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Task {
    /// Name of the plate.
    pub plate: String,
    /// Extent along u, metres.
    pub width: f64,
    /// Extent along v, metres.
    pub height: f64,
    /// Thickness, metres.
    pub thickness: f64,
    /// Target shape, where the plate file has one.
    pub target: Option<Target>,
    /// Lines on the plate.
    pub reference_lines: Vec<ReferenceLine>,
    /// Templates to be laid on lines.
    pub templates: Vec<Template>,
    /// Places with one figure each.
    pub stations: Vec<Station>,
    /// Correlated part of the level of detection of a position between two scans, one sigma: from null pairs, else from the
    /// range error of the scanner's data sheet; metres.
    pub sigma_correlated: f64,
    /// The scanner's systematic uncertainty against a known artefact, one sigma, metres; `None` when never calibrated.
    pub sigma_true: Option<f64>,
    /// Places that rest on the press's supports while the plate is scanned.
    pub supports: Vec<Support>,
    /// The plate rests on other supports than in the scan before.
    pub supports_changed: bool,
}
