//! Output of a comparison: figures, judgement and sentences, which cross the plugin boundary as JSON
//! (`platen.findings/1`).

use serde::{Deserialize, Serialize};

use crate::{Field, Seat, Verdict};

/// Figures, judgement and sentences of one comparison.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default)]
pub struct Findings {
    /// Judgement; `None` for a comparison that does not judge.
    pub verdict: Option<Verdict>,
    /// Sentences for the operator, most important first.
    pub says: Vec<String>,
    /// Named figures.
    pub figures: Vec<Figure>,
    /// One for each template.
    pub templates: Vec<TemplateFinding>,
}

/// A named figure of one comparison: names are its own, dotted. Those of the press's registers (`deviation.max`, `gap.max`, `station.S1`) reach
/// the press only from the comparison that the plant file makes their source.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Figure {
    /// Name.
    pub name: String,
    /// Value, in `unit`.
    pub value: f64,
    /// `m`, `1/m`, `rad` or `1`.
    pub unit: String,
    /// Expanded uncertainty (95 %), same unit, where known.
    pub uncertainty: Option<f64>,
    /// Place on the plate, where it has one.
    pub at: Option<[f64; 2]>,
}

impl Figure {
    /// Makes a figure without uncertainty and place.
    #[must_use]
    pub fn new(name: impl Into<String>, value: f64, unit: &str) -> Self {
        Self { name: name.into(), value, unit: unit.into(), uncertainty: None, at: None }
    }

    /// Adds the expanded uncertainty (95 %).
    #[must_use]
    pub fn uncertainty(self, uncertainty: f64) -> Self {
        Self { uncertainty: Some(uncertainty), ..self }
    }

    /// Adds the place on the plate.
    #[must_use]
    pub fn at(self, place: [f64; 2]) -> Self {
        Self { at: Some(place), ..self }
    }
}

/// Contact of one template with the plate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TemplateFinding {
    /// Name of the template.
    pub name: String,
    /// Name of its line.
    pub line: String,
    /// Seat that was judged.
    pub seat: Seat,
    /// The template rocks on the plate.
    pub rocks: bool,
    /// Largest gap, metres; signed for a held template.
    pub max_gap: f64,
    /// Its expanded uncertainty (95 %), metres.
    pub uncertainty: f64,
    /// Its place.
    pub max_gap_at: [f64; 2],
    /// Contacts.
    pub contacts: Vec<Contact>,
    /// Place of the template's first end along the line, metres.
    pub start: f64,
    /// Gap at equal steps from the first end to the last, metres.
    pub gap: Vec<f64>,
    /// Largest gap that passes, metres.
    pub limit: f64,
    /// -1 under-bent, 0 within the limit, 1 over-bent.
    pub sense: i8,
    /// Judgement.
    pub verdict: Verdict,
    /// Sentence for the operator.
    pub says: String,
}

/// A place where a template touches.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Contact {
    /// Place on the plate.
    pub at: [f64; 2],
    /// False when the plate was not seen there.
    pub seen: bool,
}

/// Output of one comparison.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Report {
    /// Name of the plugin; empty until the host has received the report.
    pub comparison: String,
    /// Figures, judgement, sentences.
    pub findings: Findings,
    /// Fields over the plate.
    pub fields: Vec<Field>,
}

impl Report {
    /// Combines the parts as a plugin returns them; the host adds the plugin's name.
    #[must_use]
    pub fn new(findings: Findings, fields: Vec<Field>) -> Self {
        Self { comparison: String::new(), findings, fields }
    }
}
