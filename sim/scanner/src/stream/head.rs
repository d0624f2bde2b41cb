//! What a bridge scans with.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use super::message::{ScanLayout, ScanSettings};
use super::{payload, spool};

/// A scanner as its bridge sees it.
pub trait Head: Send + Sync {
    /// What a scan would be, and how long it would take; nothing moves.
    ///
    /// # Errors
    /// Why it cannot scan so, and what to ask for instead.
    fn plan(&self, settings: &ScanSettings) -> Result<Plan, String>;

    /// Takes a planned scan, the `number`-th of the bridge: first `out.begin`, then columns in the order of their
    /// time.
    ///
    /// # Errors
    /// Why there is no scan, or why it stopped.
    fn scan(&self, plan: &Plan, number: u32, out: &mut dyn Receiver) -> Result<(), String>;
}

/// What will be done.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// As it will be.
    pub settings: ScanSettings,
    /// From the command to a scan that no longer changes, seconds.
    pub duration_s: f64,
    /// What the computer takes by itself, however fast the scanner's time runs, seconds.
    pub computing_s: f64,
    /// What is not as asked for, and why.
    pub altered: Vec<String>,
}

/// Who takes a scan.
pub trait Receiver {
    /// The lattice is known.
    fn begin(&mut self, begin: ScanLayout) -> ControlFlow<()>;
    /// A column as its payload is sent; the device's time in it says when it is due.
    fn column(&mut self, payload: Vec<u8>) -> ControlFlow<()>;
}

/// A recording as a scanner: every scan is the one in the file, whatever is asked for.
#[derive(Debug)]
pub struct Recording {
    path: PathBuf,
    duration_s: f64,
}

impl Recording {
    /// Reads the file through once.
    ///
    /// # Errors
    /// It is not there or holds no whole scan.
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
