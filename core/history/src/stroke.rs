//! Records of strokes and plates, as read from the database.

use std::collections::BTreeMap;
use std::path::PathBuf;

use jiff::Timestamp;
use platen_model::{Stage, StrokeData, StrokeKey, Verdict};
use serde::Serialize;

/// Record of one stroke.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stroke {
    /// Number of the record, unique in the history.
    pub run_id: u32,
    /// Identity.
    pub key: StrokeKey,
    /// Number of the physical plate, [`PlateRecord::plate`].
    pub plate: u32,
    /// Recipe number of the plate file.
    pub recipe: Option<u16>,
    /// Whether it is a scan of the blank.
    pub baseline: bool,
    /// Whether it is a trial.
    pub dry_run: bool,
    /// Time of acceptance.
    pub accepted: Timestamp,
    /// Time of the scan.
    pub scanned: Option<Timestamp>,
    /// Time of the result.
    pub finished: Option<Timestamp>,
    /// Time of the acknowledgement, or of giving up on it.
    pub acked: Option<Timestamp>,
    /// Name of the acknowledgement.
    pub ack: Option<String>,
    /// Sequence number under which the result was published.
    pub seq: Option<u16>,
    /// Verdict.
    pub verdict: Option<Verdict>,
    /// Reason of a missing measurement.
    pub reason: Option<String>,
    /// Named figures of the result, in metres, radians, seconds and fractions.
    pub figures: BTreeMap<String, f64>,
    /// All data of the press, JSON.
    pub data: String,
    /// Published result, JSON.
    pub publication: Option<String>,
    /// Path of the result document.
    pub document: Option<PathBuf>,
    /// Path of the raw scan in the scan store, where it is stored.
    pub scan: Option<PathBuf>,
    /// SHA-256 of the raw scan, where it was kept.
    pub scan_sha256: Option<String>,
}

impl Stroke {
    /// Returns the data of the press; the default where the record cannot be parsed.
    pub fn press_data(&self) -> StrokeData {
        serde_json::from_str(&self.data).unwrap_or_default()
    }

    /// Returns the last stage that was reached.
    pub fn stage(&self) -> Stage {
        match (self.scanned, self.finished, self.acked) {
            (_, _, Some(_)) => Stage::Acked,
            (_, Some(_), None) => Stage::Finished,
            (Some(_), None, None) => Stage::Scanned,
            (None, None, None) => Stage::Accepted,
        }
    }
}

/// Physical plate: the press's part where it sends a part number, else the strokes between two ends of part.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlateRecord {
    /// Number in this history.
    pub plate: u32,
    /// Number of the press.
    pub press: u16,
    /// The press's part number.
    pub part_id: Option<u32>,
    /// The press's part name.
    pub part_name: Option<String>,
    /// Acceptance of the first stroke.
    pub began: Timestamp,
    /// End of the part, as signalled by the press.
    pub ended: Option<Timestamp>,
    /// Number of strokes.
    pub strokes: u32,
    /// Verdict of the last stroke that has one.
    pub verdict: Option<Verdict>,
}
