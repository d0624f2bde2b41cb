//! What `platen status` shows: a small file that the running host keeps up to date.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use platen_plant::press::Press;
use platen_press::{Code, Durations, Language, Status};
use serde::{Deserialize, Serialize};
use tokio::sync::watch;

/// The newest alarm, as the dispatcher hears it.
pub(super) type NewestAlarm = Arc<Mutex<Option<(jiff::Timestamp, String)>>>;

/// How things stand on one press.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct StatusRecord {
    /// Name of the press.
    pub press: String,
    /// When this was written, UTC.
    pub at: jiff::Timestamp,
    /// Process of the host.
    pub pid: u32,
    /// State of the handshake.
    pub state: String,
    /// What is wrong with the link, in words.
    pub link_error: Option<String>,
    /// What stands in the error register, in words.
    pub error: Option<String>,
    /// What stands in the warning register, in words.
    pub warning: Option<String>,
    /// The newest alarm since the start, in words, and when it came.
    pub alarm: Option<(jiff::Timestamp, String)>,
    /// Strokes accepted since the start.
    pub strokes: u64,
    /// Results with a measurement.
    pub measured: u64,
    /// Results without.
    pub not_measured: u64,
    /// Strokes missed.
    pub missed: u64,
    /// Median and 99 % of trigger to busy, milliseconds.
    pub trigger_to_busy_ms: [Option<f64>; 2],
    /// Median and 99 % of stroke to result, milliseconds.
    pub stroke_to_result_ms: [Option<f64>; 2],
}

impl StatusRecord {
    fn of(press: &Press, status: &Status, alarm: &NewestAlarm) -> Self {
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
            alarm: alarm.lock().unwrap_or_else(PoisonError::into_inner).clone(),
            strokes: status.metrics.strokes,
            measured: status.metrics.measured,
            not_measured: status.metrics.not_measured,
            missed: status.metrics.missed,
            trigger_to_busy_ms: percentiles(&status.metrics.trigger_to_busy),
            stroke_to_result_ms: percentiles(&status.metrics.stroke_to_result),
        }
    }

    /// Reads the file that a host keeps in its output folder.
    ///
    /// # Errors
    /// When there is none, or it cannot be read.
    pub fn load(folder: &Path) -> std::io::Result<Self> {
        Ok(serde_json::from_slice(&std::fs::read(folder.join("status.json"))?)?)
    }
}

/// Keeps the file up to date, at most once a second but at once when the state changes.
pub(super) async fn keep(
    path: PathBuf,
    press: Press,
    mut status: watch::Receiver<Status>,
    alarm: NewestAlarm,
) {
    let mut reported = false;
    loop {
        let record = StatusRecord::of(&press, &status.borrow_and_update(), &alarm);
        let written = write(&path, &record);
        if let Err(error) = written.as_ref().map_err(|e| format!("{}: {e}", path.display()))
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

fn write(path: &Path, record: &StatusRecord) -> std::io::Result<()> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    let part = path.with_extension("part");
    std::fs::write(&part, serde_json::to_vec_pretty(record)?)?;
    std::fs::rename(part, path)
}
