//! Scanner drivers as the host sees them.

use std::time::Duration;

use platen_plant::OptionValue;
use platen_scan::{Column, Outcome, ScanEnd, ScanHeader, Window};
use platen_sdk::exchange::DecodeError;

use super::instance::InputFrame;

use super::{Emitted, Instance, JobSpec, Kind, Library, PluginError};

/// Largest lattice believed: beyond the finest scanner's 17,351 x 40,960 cells.
const MAX_ROWS: u32 = 1 << 16;
const MAX_COLUMNS: u32 = 1 << 17;

/// What comes out of a scan, in this order: one header, then columns in any order.
#[derive(Debug)]
pub enum ScanEvent {
    /// What is coming.
    Begin(ScanHeader),
    /// One column, checked against the header.
    Column(Column),
}

/// A scanner driver with its options.
#[derive(Debug)]
pub struct Scanner(Instance);

impl Scanner {
    /// Makes a driver of checked options.
    ///
    /// # Errors
    /// As [`Instance::create`].
    pub fn create(library: &Library, values: &[OptionValue]) -> Result<Self, PluginError> {
        Instance::create(library, Kind::Scanner, values).map(Self)
    }

    /// The instance: opening, arming, estimating.
    pub fn instance(&self) -> &Instance {
        &self.0
    }

    /// Seconds that a scan takes, when the driver knows.
    ///
    /// # Errors
    /// When the driver hangs.
    pub fn estimate(
        &self,
        window: Option<&Window>,
        limit: Duration,
    ) -> Result<Option<Duration>, PluginError> {
        let seconds = self.0.estimate_s(window, limit)?;
        Ok(seconds.and_then(|s| Duration::try_from_secs_f64(s).ok()))
    }

    /// Scans. Every event goes to `sink` as it arrives; when `sink` says stop, the scan is cancelled.
    ///
    /// # Errors
    /// The driver's reason, the deadline, or what was wrong with what it sent. Without `Ok` there was no scan.
    pub fn scan(
        &self,
        spec: JobSpec,
        window: Option<&Window>,
        sink: &mut dyn FnMut(ScanEvent) -> std::ops::ControlFlow<()>,
    ) -> Result<ScanEnd, PluginError> {
        let mut reader = Reader { driver: self.0.name(), n_rows: None, end: None };
        let mut job =
            self.0.start(spec, window.map(|window| InputFrame::new(window, None)).into_iter().collect());
        while let Some(frame) = job.next_frame() {
            match reader.read(&frame) {
                Ok(None) => {}
                Ok(Some(event)) => {
                    if sink(event).is_break() {
                        job.cancel();
                    }
                }
                Err(error) => {
                    job.cancel();
                    let hung = matches!(job.finish(), Err(PluginError::Hangs { .. }));
                    tracing::debug!(hung, "cancelled a driver that misbehaved");
                    return Err(error);
                }
            }
        }
        job.finish()?;
        reader.end.ok_or_else(|| reader.misbehaved("the scan has no end"))
    }
}

/// Reads a scan's frames in their order.
struct Reader<'a> {
    driver: &'a str,
    n_rows: Option<u32>,
    end: Option<ScanEnd>,
}

impl Reader<'_> {
    fn misbehaved(&self, what: impl Into<String>) -> PluginError {
        PluginError::Misbehaved { name: self.driver.to_owned(), what: what.into() }
    }

    fn read(&mut self, frame: &Emitted) -> Result<Option<ScanEvent>, PluginError> {
        if self.end.is_some() {
            return Err(self.misbehaved(format!("{} after the scan's end", frame.format)));
        }
        let malformed = |e: DecodeError| self.misbehaved(format!("a malformed {}: {e}", frame.format));
        match self.n_rows {
            None if frame.is::<ScanHeader>() => {
                let header: ScanHeader = frame.decode().map_err(malformed)?;
                check(&header).map_err(|what| self.misbehaved(what))?;
                self.n_rows = Some(header.n_rows);
                Ok(Some(ScanEvent::Begin(header)))
            }
            Some(n_rows) if frame.is::<Column>() => {
                let column: Column = frame.decode().map_err(malformed)?;
                column.check(n_rows).map_err(|e| self.misbehaved(e.to_string()))?;
                if column.index >= MAX_COLUMNS {
                    return Err(self.misbehaved(format!("column {} of at most {MAX_COLUMNS}", column.index)));
                }
                Ok(Some(ScanEvent::Column(column)))
            }
            Some(_) if frame.is::<ScanEnd>() => {
                let end: ScanEnd = frame.decode().map_err(malformed)?;
                if end.outcome != Outcome::Complete {
                    return Err(self.misbehaved("success without a complete scan"));
                }
                self.end = Some(end);
                Ok(None)
            }
            _ => Err(self.misbehaved(format!("a frame {} out of turn", frame.format))),
        }
    }
}

fn check(header: &ScanHeader) -> Result<(), String> {
    if !(1..=MAX_ROWS).contains(&header.n_rows) || header.n_columns > MAX_COLUMNS {
        return Err(format!("a lattice of {} x {} cells", header.n_rows, header.n_columns));
    }
    let steps = [header.azimuth_step, header.elevation_step];
    let starts = [header.azimuth_start, header.elevation_start];
    if steps.iter().all(|s| s.is_finite() && *s > 0.0 && *s < 1.0) && starts.iter().all(|s| s.is_finite()) {
        Ok(())
    } else {
        Err(format!("angular steps {steps:?} from {starts:?} rad"))
    }
}
