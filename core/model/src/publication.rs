//! The result of a stroke as it goes to the press.

use serde::{Deserialize, Serialize};

use crate::{Code, Figures, StrokeKey, Timestamp, Verdict};

/// Result of a stroke, without its identity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Measurement {
    /// Judgement.
    pub verdict: Verdict,
    /// Reason of [`Verdict::NotMeasured`]; `None` with every other verdict.
    #[serde(default)]
    pub reason: Option<Code>,
    /// Figures; empty when nothing was measured.
    pub figures: Figures,
    /// Time of the scan.
    pub scanned_at: Option<Timestamp>,
    /// A warning that does not invalidate the result.
    pub warning: Option<Code>,
}

impl Measurement {
    /// Returns a result without figures, for this reason.
    #[must_use]
    pub fn not_measured(reason: Code) -> Self {
        Self {
            verdict: Verdict::NotMeasured,
            reason: Some(reason),
            figures: Figures::default(),
            scanned_at: None,
            warning: None,
        }
    }
}

/// Result as it stands in the registers: written once, and written again word for word after a restart.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Publication {
    /// Its stroke.
    pub key: StrokeKey,
    /// Key of the record, never used twice by one installation.
    pub run_id: u32,
    /// Count of published results; the commit word.
    pub seq: u16,
    /// Recipe that the plate was judged by.
    pub recipe_id: Option<u16>,
    /// The result.
    pub measurement: Measurement,
}
