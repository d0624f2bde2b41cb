//! State of `platen forward` for the host and `platen status`, from the file that the forwarder keeps in the output
//! folder.

use std::path::Path;
use std::sync::{Arc, Mutex};

use platen_forward::{ForwardStatus, SinkStatus};
use serde::{Deserialize, Serialize};

/// Age of the state above which the forwarder does not run, seconds.
const STALE_S: f64 = 10.0;

/// State of the forwarding as the host sees it.
pub(super) type ForwardState = Arc<Mutex<Option<ForwardRecord>>>;

/// State of the forwarding.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ForwardRecord {
    /// Whether `platen forward` runs.
    pub running: bool,
    /// Its sinks, as last reported.
    pub sinks: Vec<SinkStatus>,
}

impl ForwardRecord {
    /// Reads the state file of the forwarder in an output folder.
    #[must_use]
    pub fn load(folder: &Path) -> Self {
        let found = ForwardStatus::load(folder).ok().flatten();
        let age =
            |status: &ForwardStatus| jiff::Timestamp::now().duration_since(status.at).as_secs_f64().abs();
        let running = found.as_ref().is_some_and(|status| age(status) < STALE_S);
        Self { running, sinks: found.map(|status| status.sinks).unwrap_or_default() }
    }

    /// Returns one line for each sink; a single line if the forwarder has never run.
    #[must_use]
    pub fn lines(&self) -> Vec<(String, String)> {
        let not = if self.running { "" } else { "platen forward does not run; its last state: " };
        let lines: Vec<_> = self
            .sinks
            .iter()
            .map(|sink| (format!("sink {}", sink.name), format!("{not}{}", sink.line())))
            .collect();
        match lines.is_empty() {
            true => vec![(
                "sinks".to_owned(),
                "platen forward has not run; start it with this plant file".to_owned(),
            )],
            false => lines,
        }
    }
}
