//! Scanner behind a bridge: the trait of heads, and recordings replayed as one.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use super::message::{ScanLayout, ScanSettings};
use super::{payload, spool};

/// Scanner head behind a bridge.
pub trait Head: Send + Sync {
    /// Plans a scan with these settings; nothing moves.
    ///
    /// # Errors
    /// Reason why the settings are impossible, with permitted values.
    fn plan(&self, settings: &ScanSettings) -> Result<Plan, String>;

    /// Takes a planned scan, the `number`-th of the bridge: calls `out.begin`, then `out.column` in the order of
    /// measurement.
    ///
    /// # Errors
    /// Reason why there is no scan, or why it stopped.
    fn scan(&self, plan: &Plan, number: u32, out: &mut dyn Receiver) -> Result<(), String>;
}

/// Plan of a scan.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Settings of the scan.
    pub settings: ScanSettings,
    /// Duration from the command to a scan that no longer changes, seconds.
    pub duration_s: f64,
    /// Computing time, a lower bound of the duration at any time scale, seconds.
    pub computing_s: f64,
    /// Deviations from the requested settings, with reasons.
    pub altered: Vec<String>,
}

/// Receiver of a scan.
pub trait Receiver {
    /// Receives the lattice.
    fn begin(&mut self, begin: ScanLayout) -> ControlFlow<()>;
    /// Receives a column as its payload; the device time in it is the time at which it is due.
    fn column(&mut self, payload: Vec<u8>) -> ControlFlow<()>;
}

/// Recording as a scanner: every scan is the recorded one, whatever is requested.
#[derive(Debug)]
pub struct Recording {
    path: PathBuf,
    duration_s: f64,
}

impl Recording {
    /// Opens a recording and reads it once to its end.
    ///
    /// # Errors
    /// The file is missing or contains no complete scan.
    pub fn open(path: &Path) -> std::io::Result<Self> {
        let mut duration_s = 0.0_f64;
        spool::read_recording(
            path,
            |_| true,
            |column| {
                duration_s = duration_s.max(payload::time_s(&column));
                true
            },
        )?;
        Ok(Self { path: path.into(), duration_s })
    }
}

impl Head for Recording {
    fn plan(&self, settings: &ScanSettings) -> Result<Plan, String> {
        let altered = vec![format!("a recording is replayed: {}", self.path.display())];
        Ok(Plan { settings: *settings, duration_s: self.duration_s, computing_s: 0.0, altered })
    }

    fn scan(&self, plan: &Plan, _: u32, out: &mut dyn Receiver) -> Result<(), String> {
        let receiver = std::cell::RefCell::new(out);
        let begun = |mut begin: ScanLayout| {
            begin.altered.extend_from_slice(&plan.altered);
            receiver.borrow_mut().begin(begin).is_continue()
        };
        let column = |bytes| receiver.borrow_mut().column(bytes).is_continue();
        spool::read_recording(&self.path, begun, column).map_err(|error| error.to_string())
    }
}
