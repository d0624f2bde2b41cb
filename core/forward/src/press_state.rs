//! State of the press for live views, from the status file that the host writes to its output folder.

use std::path::Path;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

/// File that the host writes at least once a second.
const FILE: &str = "status.json";
/// Age of the file, seconds, from which the host counts as not running or hung.
const STALE_S: f64 = 5.0;

/// State of the press and its host.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(crate) struct PressState {
    schema: &'static str,
    /// True while changes are forwarded.
    pub(crate) online: bool,
    /// True while the host runs.
    pub(crate) running: bool,
    /// State of the press cycle.
    pub(crate) state: Option<String>,
    /// Fault of the link to the press.
    pub(crate) link_error: Option<String>,
    /// Fault in `error_code`.
    pub(crate) error: Option<String>,
    /// Warning in `warning_code`.
    pub(crate) warning: Option<String>,
}

/// Members of the host's status file that are read.
#[derive(Deserialize)]
struct Status {
    at: Timestamp,
    state: String,
    link_error: Option<String>,
    error: Option<String>,
    warning: Option<String>,
}

impl PressState {
    /// Reads the state; a host that has not written for 5 s counts as not running.
    pub(crate) fn load(folder: &Path) -> Self {
        let status = std::fs::read(folder.join(FILE))
            .ok()
            .and_then(|bytes| serde_json::from_slice::<Status>(&bytes).ok());
        match status.filter(|it| Timestamp::now().duration_since(it.at).as_secs_f64().abs() < STALE_S) {
            Some(Status { state, link_error, error, warning, .. }) => {
                Self { running: true, state: Some(state), link_error, error, warning, ..Self::online() }
            }
            None => Self::online(),
        }
    }

    /// Returns the state without a forwarder: nothing is known.
    pub(crate) fn nobody() -> Self {
        Self { online: false, ..Self::online() }
    }

    fn online() -> Self {
        Self {
            schema: "platen.state/1",
            online: true,
            running: false,
            state: None,
            link_error: None,
            error: None,
            warning: None,
        }
    }

    pub(crate) fn json(&self) -> Vec<u8> {
        // A struct of texts and flags can always be written as JSON.
        serde_json::to_vec(self).unwrap_or_default()
    }
}
