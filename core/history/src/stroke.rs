//! What is on record about a stroke and a plate.

use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

/// Identity of a measurement: each is scanned at most once.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct StrokeKey {
    /// Plant number of the press.
    pub press: u16,
    /// Number that the press changes when it restarts or the part changes; 0 where it has none.
    pub session: u16,
    /// Number of the stroke.
    pub stroke: u16,
    /// 0 for the first measurement of a stroke.
    pub attempt: u16,
}

impl fmt::Display for StrokeKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "press {} session {} stroke {}", self.press, self.session, self.stroke)?;
        if self.attempt > 0 { write!(f, " attempt {}", self.attempt) } else { Ok(()) }
    }
}

/// How far a stroke has come, in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// Echoed to the press, not scanned.
    Accepted,
    /// Scanned, not judged.
    Scanned,
    /// Judged; the press may not have it.
    Finished,
    /// Done with.
    Acked,
}

/// Judgement of a stroke.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The plate has its target shape.
    Pass,
    /// It has not.
    Fail,
    /// Measured, but too uncertain to judge.
    CannotTell,
    /// Nothing can be said.
    NotMeasured,
}

impl Verdict {
    const ALL: [Self; 4] = [Self::Pass, Self::Fail, Self::CannotTell, Self::NotMeasured];

    /// `pass`, `fail`, `cannot_tell` or `not_measured`.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Fail => "fail",
            Self::CannotTell => "cannot_tell",
            Self::NotMeasured => "not_measured",
        }
    }

    pub(crate) fn from_text(text: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|verdict| verdict.as_str() == text)
    }
}

/// Everything on record about one stroke.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stroke {
    /// Key of the record, never used twice in one history.
    pub run_id: u32,
    /// Its identity.
    pub key: StrokeKey,
    /// Number of the physical plate, [`PlateRecord::plate`].
    pub plate: u32,
    /// Recipe that it was judged by.
    pub recipe: Option<u16>,
    /// A scan of the blank.
    pub baseline: bool,
    /// A trial.
    pub dry_run: bool,
    /// When it was accepted.
    pub accepted: Timestamp,
    /// When it was scanned.
    pub scanned: Option<Timestamp>,
    /// When it was judged.
    pub finished: Option<Timestamp>,
    /// When it was done with.
    pub acked: Option<Timestamp>,
    /// How it was done with, in the press's words.
    pub ack: Option<String>,
    /// Count of published results that its result went out under.
    pub seq: Option<u16>,
    /// Judgement.
    pub verdict: Option<Verdict>,
    /// Why there is no measurement.
    pub reason: Option<String>,
    /// Named figures of the result, in metres, radians, seconds and shares of one.
    pub figures: BTreeMap<String, f64>,
    /// What the press said about the stroke, JSON.
    pub data: String,
    /// The result as it went to the press, JSON.
    pub publication: Option<String>,
    /// The result document.
    pub document: Option<PathBuf>,
    /// The raw scan, while it is kept.
    pub scan: Option<PathBuf>,
    /// SHA-256 of the raw scan, kept for ever.
    pub scan_sha256: Option<String>,
}

impl Stroke {
    /// How far it has come.
    pub fn stage(&self) -> Stage {
        match (self.scanned, self.finished, self.acked) {
            (_, _, Some(_)) => Stage::Acked,
            (_, Some(_), None) => Stage::Finished,
            (Some(_), None, None) => Stage::Scanned,
            (None, None, None) => Stage::Accepted,
        }
    }
}

/// A physical plate: the press's part where it sends a number, else what lay on it between two ends of part.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlateRecord {
    /// Its number in this history.
    pub plate: u32,
    /// The press that bends it.
    pub press: u16,
    /// The press's number of it.
    pub part_id: Option<u32>,
    /// The press's name of it.
    pub part_name: Option<String>,
    /// When its first stroke was accepted.
    pub began: Timestamp,
    /// When the press said that it was done with.
    pub ended: Option<Timestamp>,
    /// How many strokes it has.
    pub strokes: u32,
    /// Judgement of its last stroke that has one.
    pub verdict: Option<Verdict>,
}

/// A line of the audit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Event {
    /// When.
    pub at: Timestamp,
    /// What kind, in one word: `start`, `mode`, `refused_write`.
    pub kind: String,
    /// The stroke that it belongs to.
    pub run_id: Option<u32>,
    /// The rest, for people.
    pub text: String,
}
