//! Result of a stroke in the form that is sent to the press.

use serde::{Deserialize, Serialize};

use crate::{Code, Figures, StrokeKey, Timestamp, Verdict};

/// Judgement of a stroke for the press. In documents it is `"pass"`, `"cannot_tell"`, `"fail"` or
/// `{"not_measured": code}`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Judgement {
    /// Verdict of a measurement.
    Measured(Verdict),
    /// No measurement, with the reason.
    NotMeasured {
        /// Reason.
        not_measured: Code,
    },
}

impl From<Verdict> for Judgement {
    fn from(verdict: Verdict) -> Self {
        match verdict {
            Verdict::NotMeasured => Self::NotMeasured { not_measured: Code::EvaluationFailed },
            measured => Self::Measured(measured),
        }
    }
}

/// Result of a stroke, without its identity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Measurement {
    /// Judgement.
    #[serde(rename = "verdict")]
    pub judgement: Judgement,
    /// Figures; empty when nothing was measured.
    pub figures: Figures,
    /// Time of the scan.
    pub scanned_at: Option<Timestamp>,
    /// Warning that does not invalidate the result.
    pub warning: Option<Code>,
}

impl Measurement {
    /// Returns a result without figures, for this reason.
    #[must_use]
    pub fn not_measured(reason: Code) -> Self {
        Self {
            judgement: Judgement::NotMeasured { not_measured: reason },
            figures: Figures::default(),
            scanned_at: None,
            warning: None,
        }
    }

    /// Returns the verdict.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        match self.judgement {
            Judgement::Measured(verdict) => verdict,
            Judgement::NotMeasured { .. } => Verdict::NotMeasured,
        }
    }

    /// Returns the reason why nothing was measured.
    #[must_use]
    pub fn reason(&self) -> Option<Code> {
        match self.judgement {
            Judgement::Measured(_) => None,
            Judgement::NotMeasured { not_measured } => Some(not_measured),
        }
    }
}

/// Result as in the registers: written once, and written again word for word after a restart.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Publication {
    /// Its stroke.
    pub key: StrokeKey,
    /// Key of the record, never used twice by one installation.
    pub run_id: u32,
    /// Count of published results; the commit word.
    pub seq: u16,
    /// Recipe by which the plate was judged.
    pub recipe_id: Option<u16>,
    /// The result.
    pub measurement: Measurement,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_journal_of_an_earlier_version_is_read_and_written_as_it_was() {
        let text = |verdict: &str| {
            format!(
                "{{\"verdict\":{verdict},\"figures\":{{\"values\":{{\"gap.max\":0.5}},\"stations\":[null]}},\
                 \"scanned_at\":null,\"warning\":402}}"
            )
        };
        for (verdict, expected) in [
            ("\"pass\"", Judgement::Measured(Verdict::Pass)),
            ("\"cannot_tell\"", Judgement::Measured(Verdict::CannotTell)),
            ("{\"not_measured\":202}", Judgement::NotMeasured { not_measured: Code::ScanTimeout }),
        ] {
            let read: Measurement = serde_json::from_str(&text(verdict)).unwrap();
            assert_eq!(read.judgement, expected);
            assert_eq!(serde_json::to_string(&read).unwrap(), text(verdict));
        }
    }
}
