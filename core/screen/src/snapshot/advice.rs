//! Advice for the next stroke in the form for the pages: lengths in millimetres, and the sentences of the advisor.

use platen_model::units::mm;
use platen_model::{Advice, CannotAdvise, NextBend, Sentence, Step, Texts};
use platen_report::advice::AdviceRecord;
use serde::Serialize;

/// Advice for the next stroke.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AdvicePart {
    /// Next action.
    pub step: AdvisedStep,
    /// The bend of `bend` and `turn_over`.
    pub bend: Option<AdvisedBend>,
    /// Reason why there is none.
    pub why: Option<Texts>,
    /// Smallest number of strokes left, and a number that is seldom exceeded.
    pub strokes_left: Option<[u32; 2]>,
    /// Sentences of the advisor, most important first.
    pub says: Vec<Sentence>,
    /// Outcome of the advice before; null without one.
    pub last: Option<LastAdvice>,
}

/// Comparison of the last stroke with the advice before it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum LastAdvice {
    /// An angle was advised.
    Made {
        /// Advised angle.
        advised_deg: f64,
        /// Its 95 % interval.
        advised_95_deg: Option<[f64; 2]>,
        /// Angle that the stroke made.
        made_deg: f64,
    },
    /// The stroke was made before the advice was ready.
    TooLate,
}

impl LastAdvice {
    /// Returns the outcome of the advice before the stroke of this record.
    #[must_use]
    pub fn of(record: &AdviceRecord) -> Option<Self> {
        if record.unadvised == Some(CannotAdvise::TooLate) {
            return Some(Self::TooLate);
        }
        let score = record.score?;
        // The angle of a bend is positive towards the scanner, an advised angle in the direction in which the target
        // bends.
        Some(Self::Made {
            advised_deg: score.advised_angle.to_degrees(),
            advised_95_deg: score.advised_95.map(|it| it.map(f64::to_degrees)),
            made_deg: score.made.angle.abs().to_degrees(),
        })
    }
}

/// Next action on the plate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum AdvisedStep {
    /// Bend along a line.
    Bend,
    /// Turn the plate over and bend it back along a line.
    TurnOver,
    /// Bend at the place of the result; the amount cannot be determined.
    Place,
    /// Finished.
    Done,
    /// No advice.
    Cannot,
}

/// A bend along a line.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AdvisedBend {
    /// Ends of the line, (u, v).
    pub line_mm: [[f64; 2]; 2],
    /// Angle that should remain.
    pub angle_deg: f64,
    /// Half width of the interval of the bend's position about the line; null if it cannot be determined.
    pub place_95_mm: Option<f64>,
    /// Depth of the ram; null if it cannot be determined.
    pub depth_mm: Option<f64>,
    /// Depth beyond which the plate could no longer be finished from one side.
    pub depth_not_beyond_mm: Option<f64>,
    /// Largest gap under a template after it: lower end of the 95 % interval, expected, upper end.
    pub gap_after_mm: [f64; 3],
}

impl From<&NextBend> for AdvisedBend {
    fn from(bend: &NextBend) -> Self {
        Self {
            line_mm: bend.line.map(|end| end.map(mm)),
            angle_deg: bend.angle.to_degrees(),
            place_95_mm: bend.place_95.map(mm),
            depth_mm: bend.depth.map(mm),
            depth_not_beyond_mm: bend.depth_not_beyond.map(mm),
            gap_after_mm: bend.gap_after.map(mm),
        }
    }
}

impl From<&Advice> for AdvicePart {
    fn from(advice: &Advice) -> Self {
        let (step, bend, why) = match &advice.step {
            Step::Bend(bend) => (AdvisedStep::Bend, Some(bend.into()), None),
            Step::TurnOver(bend) => (AdvisedStep::TurnOver, Some(bend.into()), None),
            Step::Place { .. } => (AdvisedStep::Place, None, None),
            Step::Done => (AdvisedStep::Done, None, None),
            Step::Cannot { reason } => (AdvisedStep::Cannot, None, Some(reason.texts())),
        };
        Self { step, bend, why, strokes_left: advice.strokes_left, says: advice.says.clone(), last: None }
    }
}
