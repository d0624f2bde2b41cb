//! Verdict on a plate, ordered from good to bad.

use serde::{Deserialize, Serialize};

/// Judgement of a plate against its limits. Nothing is good by default: a fact that is not known is `CannotTell`.
///
/// Ordered from good to bad, so that the verdict of several comparisons is their maximum.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Within every limit by more than the uncertainty.
    Pass,
    /// A limit lies within the uncertainty, or a part that is needed was not seen.
    CannotTell,
    /// Beyond a limit by more than the uncertainty.
    Fail,
    /// No measurement.
    NotMeasured,
}

impl Verdict {
    const ALL: [Self; 4] = [Self::Pass, Self::CannotTell, Self::Fail, Self::NotMeasured];

    /// Returns the name in documents and in the database: `pass`, `cannot_tell`, `fail` or `not_measured`.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::CannotTell => "cannot_tell",
            Self::Fail => "fail",
            Self::NotMeasured => "not_measured",
        }
    }

    /// Returns the verdict with this name.
    #[must_use]
    pub fn from_text(text: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|verdict| verdict.as_str() == text)
    }

    /// Returns the verdict as readable text: the name with spaces.
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
