//! State of the forwarding: `forward.json` in the output folder.
//!
//! The file is written by `platen forward` and read by the host and by `platen status`.

use std::path::Path;

use serde::{Deserialize, Serialize};

/// Name of the file.
pub const FILE: &str = "forward.json";

/// State of a forwarder.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ForwardStatus {
    /// Time of this state.
    pub at: jiff::Timestamp,
    /// Number of the process.
    pub pid: u32,
    /// State of each sink.
    pub sinks: Vec<SinkStatus>,
}

/// State of a sink.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SinkStatus {
    /// Name in the plant file.
    pub name: String,
    /// Kind: `postgresql`, `mqtt`, `sparkplug`.
    pub kind: String,
    /// True while the sink is connected.
    pub connected: bool,
    /// Reason why the sink is not connected, with the action to take.
    pub error: Option<String>,
    /// Number of changes of the record that the sink does not have.
    pub backlog: u64,
    /// Age of the oldest of them, seconds.
    pub behind_s: Option<f64>,
    /// Number of changes sent since the forwarder started.
    pub sent: u64,
    /// Number of changes that the sink has under the same key with other content.
    pub conflicts: u64,
    /// Changes that it refused for their content.
    pub refused: u64,
    /// It keeps this press's changes apart: another host has the name.
    pub apart: Option<String>,
}

impl SinkStatus {
    pub(crate) fn new(name: &str, kind: &str) -> Self {
        Self {
            name: name.to_owned(),
            kind: kind.to_owned(),
            connected: false,
            error: None,
            backlog: 0,
            behind_s: None,
            sent: 0,
            conflicts: 0,
            refused: 0,
            apart: None,
        }
    }

    /// Returns the state as a line for people.
    #[must_use]
    pub fn line(&self) -> String {
        let mut line = match (&self.error, self.connected) {
            (Some(error), _) => format!("not connected: {error}"),
            (None, true) => "connected".to_owned(),
            (None, false) => "connecting".to_owned(),
        };
        if self.backlog > 0 {
            let age = self.behind_s.map(|s| format!(", the oldest {} old", age(s))).unwrap_or_default();
            line += &format!("; {} changes to send{age}", self.backlog);
        } else {
            line += "; up to date";
        }
        for (count, what) in
            [(self.conflicts, "differ from what is there"), (self.refused, "refused for their content")]
        {
            if count > 0 {
                line += &format!("; {count} {what}");
            }
        }
        if let Some(apart) = &self.apart {
            line += &format!("; {apart}");
        }
        line
    }
}

fn age(seconds: f64) -> String {
    match seconds {
        s if s < 120.0 => format!("{s:.0} s"),
        s if s < 7200.0 => format!("{:.0} min", s / 60.0),
        s if s < 172_800.0 => format!("{:.0} h", s / 3600.0),
        s => format!("{:.0} d", s / 86_400.0),
    }
}

impl ForwardStatus {
    /// Reads the state of an output folder; `None` where no forwarder has run.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn load(folder: &Path) -> std::io::Result<Option<Self>> {
        match std::fs::read(folder.join(FILE)) {
            Ok(bytes) => Ok(serde_json::from_slice(&bytes).ok()),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error),
        }
    }

    pub(crate) fn write(&self, folder: &Path) -> std::io::Result<()> {
        let text = serde_json::to_vec_pretty(self)?;
        let part = folder.join(format!("{FILE}.part"));
        std::fs::write(&part, text)?;
        std::fs::rename(part, folder.join(FILE))
    }
}
