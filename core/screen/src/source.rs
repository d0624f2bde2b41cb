//! Data source of the pages: a trait that the host implements with its press side, its record and its files.

use std::sync::Arc;
use std::time::Duration;

use platen_model::{Field, Verdict};
use platen_report::result::ResultRecord;
use platen_report::sequence::Sequence;
use serde::Serialize;
use tokio::sync::watch;

use crate::{CYCLE_LIMIT, PressPart, Snapshot};

/// Files of a stroke that may be read, besides the sections of its templates (`section-NAME.svg`).
pub const FILES: [&str; 11] = [
    "result.json",
    "reference_lines.csv",
    "grid.csv",
    "plate.ply",
    "plate.vtk",
    "scan.e57",
    "strokes.svg",
    "curvature_deficit.svg",
    "deviation.svg",
    "curvature_deficit.png",
    "deviation.png",
];

/// Failure to read for a page.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// The plate, stroke, field or file does not exist.
    #[error("{0}")]
    NotFound(String),
    /// It exists but cannot be read.
    #[error("{0}")]
    Unreadable(String),
}

/// Data source of the pages. Calls that read the record or files may block.
pub trait Source: Send + Sync + 'static {
    /// Returns the present snapshot, and every later one.
    fn snapshots(&self) -> watch::Receiver<Arc<Snapshot>>;

    /// Returns the time since the last report of the press cycle: it grows while the cycle is stopped.
    fn cycle_age(&self) -> Duration;

    /// Returns the newest plates on record, newest first.
    ///
    /// # Errors
    /// The record cannot be read.
    fn plates(&self) -> Result<Vec<PlateRow>, SourceError>;

    /// Returns the strokes of a plate, oldest first.
    ///
    /// # Errors
    /// No such plate, or the record cannot be read.
    fn strokes(&self, plate: u32) -> Result<Vec<StrokeRow>, SourceError>;

    /// Returns the bends of a plate in their order; `None` where they cannot be evaluated.
    ///
    /// # Errors
    /// No such plate, or the record cannot be read.
    fn sequence(&self, plate: u32) -> Result<Option<Sequence>, SourceError>;

    /// Returns the result document of a stroke.
    ///
    /// # Errors
    /// No such stroke, or it was not measured.
    fn result(&self, run: u32) -> Result<Arc<ResultRecord>, SourceError>;

    /// Returns a field of a stroke.
    ///
    /// # Errors
    /// No such stroke or field.
    fn field(&self, run: u32, name: &str) -> Result<Arc<Field>, SourceError>;

    /// Returns the scanned face of a stroke on an even grid, v outer, u inner: nodes of a side, and of each node x, y,
    /// z, metres, scanner frame, and 1 where it was seen, else 0.
    ///
    /// # Errors
    /// No such stroke, or it was not measured.
    fn mesh(&self, run: u32) -> Result<(usize, Vec<[f32; 4]>), SourceError>;

    /// Returns a file of a stroke's folder; the server requests only names of a fixed list.
    ///
    /// # Errors
    /// No such stroke or file.
    fn file(&self, run: u32, name: &str) -> Result<Vec<u8>, SourceError>;

    /// Returns the HTML report of a plate.
    ///
    /// # Errors
    /// No such plate, or the record cannot be read.
    fn report(&self, plate: u32) -> Result<String, SourceError>;

    /// Returns the figures of the engineer's page.
    fn engineer(&self) -> Engineer;

    /// Returns the metrics in the Prometheus text format.
    fn metrics(&self) -> String;
}

/// Returns the present snapshot. While the press cycle is stopped it has no result, since the result may be that of an
/// earlier stroke (rule R2).
pub(crate) fn present(source: &dyn Source) -> Arc<Snapshot> {
    let snapshot = source.snapshots().borrow().clone();
    if source.cycle_age() <= CYCLE_LIMIT {
        return snapshot;
    }
    let press = PressPart { in_step: false, ready: false, ..snapshot.press.clone() };
    Arc::new(Snapshot { press, result: None, strip: Vec::new(), ..Snapshot::clone(&snapshot) })
}

/// Sign of life.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Beat {
    /// Value of the snapshot.
    pub boot: String,
    /// Number of the newest snapshot.
    pub seq: u64,
    /// Time since the last report of the press cycle.
    pub cycle_age_ms: u64,
}

/// Plate on record.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlateRow {
    /// Its number in the record.
    pub plate: u32,
    /// Its name.
    pub name: String,
    /// Number of the part at the press.
    pub part: Option<u32>,
    /// Time of its first stroke.
    pub first: String,
    /// Number of its strokes.
    pub strokes: usize,
    /// Verdict of its last stroke.
    pub verdict: Verdict,
    /// -1 under-bent, 0 within the limit, 1 bent too far.
    pub sense: i8,
}

/// Stroke on record.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StrokeRow {
    /// Its record.
    pub run: u32,
    /// Number or `blank`, attempt, `trial`.
    pub label: String,
    /// Time of the trigger.
    pub accepted: String,
    /// Verdict.
    pub verdict: Verdict,
    /// Reason where it was not measured.
    pub reason: Option<String>,
    /// Largest gap under a template, and its expanded uncertainty (95 %).
    pub gap_mm: Option<f64>,
    /// Uncertainty of `gap_mm`.
    pub uncertainty_mm: Option<f64>,
    /// -1 under-bent, 0 within the limit, 1 bent too far.
    pub sense: i8,
    /// Names of its files.
    pub files: Vec<String>,
}

/// Figures of the engineer's page.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Engineer {
    /// Registers that the host reads, then those that it writes.
    pub registers: [Vec<RegisterRow>; 2],
    /// The last strokes, newest first.
    pub timeline: Vec<TimelineRow>,
    /// Loaded plugins.
    pub plugins: Vec<PluginRow>,
    /// Alarms since the start, by number: code, text, count.
    pub alarms: Vec<(u16, String, u64)>,
    /// Named figures of link, scanner, calibration, disk and record, in display order.
    pub figures: Vec<(String, String)>,
    /// Files in force: path and SHA-256 or CRC.
    pub files: Vec<(String, String)>,
}

/// One register field.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RegisterRow {
    /// Address from 0.
    pub address: u16,
    /// Number of words.
    pub words: u16,
    /// Name of the field.
    pub name: String,
    /// Value as text.
    pub value: String,
}

/// One stroke of the timeline; times in milliseconds from the trigger.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TimelineRow {
    /// Stroke.
    pub stroke: String,
    /// Verdict.
    pub verdict: Verdict,
    /// Times to the end of the scan, to the result, to the acknowledgement.
    pub steps_ms: [Option<f64>; 3],
}

/// One plugin.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PluginRow {
    /// Its use in the plant file.
    pub role: String,
    /// Its name.
    pub name: String,
    /// Its version.
    pub version: String,
    /// File of its library.
    pub file: String,
    /// State of its process.
    pub state: String,
}
