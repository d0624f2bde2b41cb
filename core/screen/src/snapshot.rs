//! Snapshot of press, plate, stroke and result at one moment: document `platen.screen/1`, sent as events and as
//! `/api/v1/state`.
//!
//! Every snapshot is complete: a page that has missed ten snapshots is correct after the eleventh. Unknown values are
//! null. `result` is the result of the present plate and stroke, or null; it is never the result of an earlier stroke.

mod advice;

use platen_model::{Audience, Code, Severity, Texts, Verdict};
use platen_report::result::Next;
use serde::Serialize;

pub use advice::{AdvicePart, AdvisedBend, AdvisedStep, LastAdvice};

/// Version of the document.
pub const SCHEMA: &str = "platen.screen/1";

/// State at one moment.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Snapshot {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Identifier of this start of the host; every start has another one.
    pub boot: String,
    /// Count of snapshots since the start.
    pub seq: u64,
    /// Host.
    pub host: HostPart,
    /// Press.
    pub press: PressPart,
    /// Scanner.
    pub scanner: ScannerPart,
    /// Record of strokes.
    pub record: RecordPart,
    /// Present plate.
    pub plate: Option<PlatePart>,
    /// Present stroke.
    pub stroke: Option<StrokePart>,
    /// Result of the present stroke.
    pub result: Option<ResultPart>,
    /// The newest strokes of this plate, including the present one, oldest first.
    pub strip: Vec<StripPart>,
    /// Active alarms, the most urgent first.
    pub alarms: Vec<ShownAlarm>,
}

/// Host.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HostPart {
    /// Version of the program.
    pub version: &'static str,
    /// Mode of the plant file: `off`, `listen`, `dry-run`, `simulate`, `measure`.
    pub mode: &'static str,
    /// State of the handshake, as in `platen status`.
    pub state: String,
    /// Results do not come from a real plate: the mode, or a simulated scanner.
    pub simulated: bool,
}

/// Press.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PressPart {
    /// Its name.
    pub name: String,
    /// Press and host are synchronised.
    pub in_step: bool,
    /// Its heartbeat changes; true if the press has no heartbeat.
    pub alive: bool,
    /// The next stroke will be measured.
    pub ready: bool,
}

/// Scanner.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ScannerPart {
    /// Its state.
    pub state: ScannerState,
    /// Time of one scan, where its driver plans scans.
    pub estimate_s: Option<f64>,
}

/// State of the scanner.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ScannerState {
    /// Not yet queried.
    Unknown,
    /// In reach.
    Ready,
    /// Not in reach.
    NotReady,
    /// In reach, but its calibration is not valid.
    NotCalibrated,
}

/// Record of strokes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RecordPart {
    /// Every stroke so far is on record.
    pub complete: bool,
    /// Records that could not be written.
    pub lost: u64,
}

/// Present plate.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlatePart {
    /// Its name from the plate file, else from the press; null before the first measurement if the press gives no name.
    pub id: Option<String>,
    /// Number of the part at the press.
    pub part: Option<u32>,
    /// Recipe at the press.
    pub recipe: Option<u16>,
    /// Extent along u and v.
    pub size_mm: Option<[f64; 2]>,
    /// Edge that faces the press, as a direction in (u, v).
    pub press_side: Option<[i8; 2]>,
}

/// Present stroke.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StrokePart {
    /// Its record; null before it is scanned.
    pub run: Option<u32>,
    /// Its number at the press.
    pub number: u16,
    /// 0 for its first measurement.
    pub attempt: u16,
    /// The stroke is a scan of the blank.
    pub baseline: bool,
    /// Its stage.
    pub stage: Stage,
    /// Start of its scan, milliseconds since 1970.
    pub since_ms: Option<i64>,
    /// Share of its scan that is done, percent; while it is scanned, and if the driver reports it.
    pub scanned_percent: Option<u8>,
}

/// Stage of a stroke.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// Accepted; waiting for a clear view.
    Accepted,
    /// Being scanned.
    Scanning,
    /// Being measured.
    Measuring,
    /// Given up, or its result is about to be written.
    Ending,
    /// Its result is in the registers.
    Done,
}

/// Result of the present stroke.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ResultPart {
    /// Its record.
    pub run: u32,
    /// Verdict.
    pub verdict: Verdict,
    /// Reason of "not measured".
    pub reason: Option<Code>,
    /// Reason in words.
    pub why: Option<Texts>,
    /// Template with the largest gap per limit.
    pub worst: Option<Worst>,
    /// Place of the next hit, or the reason why there is none; null in documents older than this field, and where
    /// nothing was measured.
    pub next: Option<Next>,
    /// An earlier stroke bent the plate at this place; false while that is unknown.
    pub again: bool,
    /// Advice for the next stroke; null if the plant file shows none, and until it is ready.
    pub advice: Option<AdvicePart>,
    /// Names of the fields that can be shown as maps.
    pub fields: Vec<String>,
}

/// Template with the largest gap per limit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Worst {
    /// Largest gap.
    pub gap_mm: f64,
    /// Its expanded uncertainty (95 %).
    pub uncertainty_mm: f64,
    /// Limit.
    pub limit_mm: f64,
    /// Its place.
    pub at_mm: [f64; 2],
    /// -1 under-bent, 0 within the limit, 1 bent too far.
    pub sense: i8,
}

/// Stroke of the present plate.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StripPart {
    /// Label.
    pub label: String,
    /// Verdict.
    pub verdict: Verdict,
    /// Largest gap.
    pub gap_mm: Option<f64>,
}

/// Active alarm.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ShownAlarm {
    /// Number.
    pub code: Code,
    /// Severity.
    pub severity: Severity,
    /// Person who must act.
    pub audience: Audience,
    /// Start of the alarm, milliseconds since 1970.
    pub since_ms: i64,
    /// Fault.
    pub text: Texts,
    /// Remedy.
    pub remedy: Texts,
    /// Number of times that it was raised since the start of the host.
    pub count: u64,
}

impl ShownAlarm {
    /// Returns an alarm with the texts of the alarm table.
    #[must_use]
    pub fn new(code: Code, since_ms: i64, count: u64) -> Self {
        let alarm = code.alarm();
        Self {
            code,
            severity: alarm.severity,
            audience: alarm.audience,
            since_ms,
            text: alarm.texts,
            remedy: alarm.remedies,
            count,
        }
    }
}
