//! State of the host in a small file that the running host updates, for `platen status`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use platen_model::{Code, Language};
use platen_plant::press::Press;
use platen_press::{Answer, Durations, Status};
use platen_report::output_folder;
use platen_report::result::ClockRecord;
use serde::{Deserialize, Serialize};
use tokio::sync::{mpsc, watch};

use super::clock::Clock;
use super::disk;
use super::forward_record::{ForwardRecord, ForwardState};
use super::plugin_status::{PluginStates, PluginStatus};
use super::service;
use super::stopping::{PlateInHand, StopRequest, restart_pending};

/// Newest alarm, set by the dispatcher.
pub(super) type NewestAlarm = Arc<Mutex<Option<(jiff::Timestamp, String)>>>;

/// Facts from outside the press side.
#[derive(Debug, Clone, Default)]
pub(super) struct Beside {
    pub(super) alarm: NewestAlarm,
    /// Number of strokes whose documents could not be written.
    pub(super) lost: Arc<AtomicU64>,
    /// Address of the pages, where they are served.
    pub(super) pages: Option<String>,
    pub(super) plugins: PluginStates,
    pub(super) forward: ForwardState,
    pub(super) clock: Clock,
    pub(super) plate: PlateInHand,
}

/// Name of the status file in the output folder.
const FILE: &str = "status.json";

/// State of the handshake between two strokes.
const IDLE: &str = "idle";

/// Time from a reset until the press side has reported its state after it.
const RESET_SHOWS: Duration = Duration::from_millis(400);

/// Returns the file by which `platen press reset` requests a reset of the running host. Permission is given by write
/// access to the output folder.
pub fn reset_request(folder: &Path) -> PathBuf {
    folder.join("reset.request")
}

/// State of the host on one press.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct StatusRecord {
    /// Name of the press.
    pub press: String,
    /// Time of writing, UTC.
    pub at: jiff::Timestamp,
    /// Process of the host.
    pub pid: u32,
    /// State of the handshake.
    pub state: String,
    /// Fault of the link, in words.
    pub link_error: Option<String>,
    /// Content of the error register, in words.
    pub error: Option<String>,
    /// Content of the warning register, in words.
    pub warning: Option<String>,
    /// The newest alarm since the start, in words, and its time.
    pub alarm: Option<(jiff::Timestamp, String)>,
    /// Strokes accepted since the start.
    pub strokes: u64,
    /// Results with a measurement.
    pub measured: u64,
    /// Results without a measurement.
    pub not_measured: u64,
    /// Missed strokes.
    pub missed: u64,
    /// Median and 99 % of trigger to busy, milliseconds.
    pub trigger_to_busy_ms: [Option<f64>; 2],
    /// Median and 99 % of stroke to result, milliseconds.
    pub stroke_to_result_ms: [Option<f64>; 2],
    /// Median and 99 % of result to acknowledge, milliseconds.
    pub result_to_ack_ms: [Option<f64>; 2],
    /// Median and 99 % of the time until a record of the journal would survive a power cut, milliseconds.
    pub journal_ms: [Option<f64>; 2],
    /// Results that the press did not acknowledge in time.
    pub ack_timeouts: u64,
    /// Reads during which the press was writing its block.
    pub torn_reads: u64,
    /// Reads in which the press had changed the host's own block.
    pub rewrites: u64,
    /// Time for which the present result has waited for the press, seconds; null when none waits. At most one waits: no
    /// stroke is accepted before the result is delivered.
    pub result_waits_s: Option<f64>,
    /// Bytes free where results are written; null where unknown.
    pub disk_free: Option<u64>,
    /// Records of the history and result folders that could not be written.
    pub records_lost: u64,
    /// Time out of synchronisation with the press, seconds, without the present loss.
    pub link_down_s: f64,
    /// Counters of the link.
    pub link: LinkRecord,
    /// Time of the last manual reset.
    pub reset_at: Option<jiff::Timestamp>,
    /// Address of the browser pages; null where none are served.
    #[serde(default)]
    pub pages: Option<String>,
    /// Its plugins and their processes.
    #[serde(default)]
    pub plugins: Vec<PluginStatus>,
    /// Forwarding of the record; null where the plant file has none.
    #[serde(default)]
    pub forward: Option<ForwardRecord>,
    /// Clock of the host; null where the system does not report it.
    #[serde(default)]
    pub clock: Option<ClockRecord>,
    /// Whether the program was replaced since the start, so that the next start takes another one.
    #[serde(default)]
    pub restart_pending: bool,
    /// Whether the host stops at the end of the present plate.
    #[serde(default)]
    pub stop_asked: bool,
}

/// Counters of the link since the start.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct LinkRecord {
    /// Requests sent.
    pub requests: u64,
    /// Write requests sent.
    pub writes: u64,
    /// Writes not sent because they are not allowed.
    pub writes_refused: u64,
    /// Connections established.
    pub connections: u64,
    /// Connections dropped because of an error, a timeout or a wrong answer.
    pub poisoned: u64,
    /// Requests without an answer in time.
    pub timeouts: u64,
    /// Refusals by Modbus exception code.
    pub exceptions: BTreeMap<u8, u64>,
    /// Round trips by time: number up to 1, 2, 5, 10, 20, 50, 100, 200, 500 ms, and longer.
    pub round_trips: Vec<u64>,
}

impl StatusRecord {
    pub(super) fn of(
        press: &Press,
        folder: &Path,
        status: &Status,
        beside: &Beside,
        reset_at: Option<jiff::Timestamp>,
    ) -> Self {
        let percentiles = |durations: &Durations| {
            [50.0, 99.0].map(|percent| durations.percentile(percent).map(|d| d.as_secs_f64() * 1000.0))
        };
        let words = |code: Code| {
            let alarm = code.alarm();
            format!("{} {}; {}", code.number(), alarm.text(Language::En), alarm.remedy(Language::En))
        };
        Self {
            press: press.name.clone(),
            at: jiff::Timestamp::now(),
            pid: std::process::id(),
            state: status.state.to_string(),
            link_error: status.link_error.map(words),
            error: status.host.error.map(words),
            warning: status.host.warning.map(words),
            alarm: beside.alarm.lock().unwrap_or_else(PoisonError::into_inner).clone(),
            strokes: status.metrics.strokes,
            measured: status.metrics.measured,
            not_measured: status.metrics.not_measured,
            missed: status.metrics.missed,
            trigger_to_busy_ms: percentiles(&status.metrics.trigger_to_busy),
            stroke_to_result_ms: percentiles(&status.metrics.stroke_to_result),
            result_to_ack_ms: percentiles(&status.metrics.result_to_ack),
            journal_ms: percentiles(&status.metrics.journal),
            ack_timeouts: status.metrics.ack_timeouts,
            torn_reads: status.metrics.torn_reads,
            rewrites: status.metrics.rewrites,
            result_waits_s: status.metrics.result_waits.map(|waits| waits.as_secs_f64()),
            disk_free: disk::free(folder).ok(),
            records_lost: status.metrics.journal_failed + beside.lost.load(Ordering::Relaxed),
            link_down_s: status.metrics.link_down.as_secs_f64(),
            link: LinkRecord {
                requests: status.counts.requests,
                writes: status.counts.writes,
                writes_refused: status.counts.writes_refused,
                connections: status.counts.connects,
                poisoned: status.counts.poisoned,
                timeouts: status.counts.timeouts,
                exceptions: status.counts.exceptions.clone(),
                round_trips: status.counts.round_trips.to_vec(),
            },
            reset_at,
            pages: beside.pages.clone(),
            plugins: beside.plugins.lock().unwrap_or_else(PoisonError::into_inner).clone(),
            forward: beside.forward.lock().unwrap_or_else(PoisonError::into_inner).clone(),
            clock: beside.clock.record(),
            restart_pending: restart_pending(),
            stop_asked: false,
        }
    }

    /// Reads the file that a host keeps in its output folder.
    ///
    /// # Errors
    /// The file is missing or cannot be read.
    pub fn load(folder: &Path) -> std::io::Result<Self> {
        Ok(serde_json::from_slice(&std::fs::read(folder.join(FILE))?)?)
    }
}

/// Updates the file at most once a second, but at once when the state changes; passes on requests for a reset and for a
/// stop.
pub(super) async fn keep(
    folder: PathBuf,
    press: Press,
    mut status: watch::Receiver<Status>,
    beside: Beside,
    answers: mpsc::UnboundedSender<Answer>,
) {
    let request = reset_request(&folder);
    let mut reset_at = None;
    let mut reported = false;
    let mut stop_asked = false;
    loop {
        let asked = StopRequest::take(&folder);
        stop_asked |= asked.is_some();
        let is_idle = status.borrow().state.to_string() == IDLE && beside.plate.is_none();
        if asked == Some(StopRequest::AtOnce) || stop_asked && is_idle {
            tracing::warn!("the host stops, as `platen stop` asked");
            service::stopping();
            // The press side makes the registers safe and ends, and the host with it.
            let _ = answers.send(Answer::Stop);
        }
        if std::fs::remove_file(&request).is_ok() {
            tracing::warn!("faults are reset by `platen press reset`");
            reset_at = Some(jiff::Timestamp::now());
            // A press side that has ended has no faults left.
            let _ = answers.send(Answer::Reset);
            tokio::time::sleep(RESET_SHOWS).await;
        }
        let mut record = StatusRecord::of(&press, &folder, &status.borrow_and_update(), &beside, reset_at);
        record.stop_asked = stop_asked;
        if let Err(error) = write(&folder, &record)
            && !std::mem::replace(&mut reported, true)
        {
            tracing::warn!("{error}; `platen status` will be out of date");
        }
        let state = record.state;
        let changed = async {
            while status.changed().await.is_ok() {
                if status.borrow_and_update().state.to_string() != state {
                    return true;
                }
            }
            false
        };
        if let Ok(false) = tokio::time::timeout(Duration::from_secs(1), changed).await {
            return;
        }
    }
}

fn write(folder: &Path, record: &StatusRecord) -> Result<(), String> {
    std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let text = serde_json::to_vec_pretty(record).map_err(|e| e.to_string())?;
    output_folder::put(folder, FILE, &text).map(drop).map_err(|e| e.to_string())
}
