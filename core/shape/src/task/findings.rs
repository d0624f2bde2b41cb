//! What a comparison answers.

use serde::{Deserialize, Serialize};

/// Judgement. There is no good by default: what is not known is `CannotTell`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Within every limit, by more than the uncertainty.
    Pass,
    /// A limit lies within the uncertainty, or something was not seen.
    CannotTell,
    /// Outside a limit, by more than the uncertainty.
    Fail,
    /// There is no measurement.
    NotMeasured,
}

impl Verdict {
    /// As it is told to people.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::CannotTell => "cannot tell",
            Self::Fail => "fail",
            Self::NotMeasured => "not measured",
        }
    }
}

/// The answer of one comparison.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
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

/// A named figure. Names are dotted, e.g. `deviation.max`, `gap.max`, `station.S1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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

/// How one board lies on the plate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TemplateFinding {
    /// Name of the template.
    pub name: String,
    /// Name of its line.
    pub line: String,
    /// Seat that was judged.
    pub seat: super::Seat,
    /// The board rocks on the plate.
    pub rocks: bool,
    /// Largest gap, metres; signed for a held board.
    pub max_gap: f64,
    /// Its expanded uncertainty (95 %), metres.
    pub uncertainty: f64,
    /// Where it is.
    pub max_gap_at: [f64; 2],
    /// Where the board touches.
    pub contacts: Vec<Contact>,
    /// Place of the board's first end along the line, metres.
    pub start: f64,
    /// Gap at equal steps from the first end to the last, metres.
    pub gap: Vec<f64>,
    /// Largest gap that passes, metres.
    pub limit: f64,
    /// -1 not bent enough, 0 within, 1 bent too far.
    pub sense: i8,
    /// Judgement.
    pub verdict: Verdict,
    /// Sentence for the operator.
    pub says: String,
}

/// A place where a board touches.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// Place on the plate.
    pub at: [f64; 2],
    /// False when the plate was not seen there.
    pub seen: bool,
}
