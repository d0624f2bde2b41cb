//! What is on record about a stroke and a plate.

use std::collections::BTreeMap;
use std::path::PathBuf;

use jiff::Timestamp;
use platen_model::{Stage, StrokeData, StrokeKey, Verdict};
use serde::Serialize;

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
    /// Returns the press's data about the stroke; empty where the record cannot be read any more.
    pub fn press_data(&self) -> StrokeData {
        serde_json::from_str(&self.data).unwrap_or_default()
    }

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
