//! Scanner drivers as the host sees them.

use std::time::Duration;

use platen_abi::payload::{self, Header, Malformed};
use platen_scan::{Column, Face, Outcome, ScanEnd, ScanHeader, State, Window, wrap_azimuth};

use super::instance::{InputFrame, raw_window};
use super::job::HostBuffer;
use platen_plant::OptionValue;

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
        let mut job = self.0.start(spec, window.map(window_frame).into_iter().collect());
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

fn window_frame(window: &Window) -> InputFrame {
    let mut buffer = HostBuffer::new(size_of::<payload::Window>());
    payload::put_header(buffer.bytes_mut(), &raw_window(window));
    InputFrame { format: payload::Window::FORMAT, role: None, buffer }
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
        let is = |format: &std::ffi::CStr| frame.format.as_bytes() == format.to_bytes();
        if self.end.is_some() {
            return Err(self.misbehaved(format!("{} after the scan's end", frame.format)));
        }
        let malformed = |e: Malformed| self.misbehaved(format!("a malformed {}: {e}", frame.format));
        match self.n_rows {
            None if is(payload::Scan::FORMAT) => {
                let header = header(frame.bytes()).map_err(malformed)?;
                check(&header).map_err(|what| self.misbehaved(what))?;
                self.n_rows = Some(header.n_rows);
                Ok(Some(ScanEvent::Begin(header)))
            }
            Some(n_rows) if is(payload::Column::FORMAT) => {
                let column = column(frame.bytes()).map_err(malformed)?;
                column.check(n_rows).map_err(|e| self.misbehaved(e.to_string()))?;
                if column.index >= MAX_COLUMNS {
                    return Err(self.misbehaved(format!("column {} of at most {MAX_COLUMNS}", column.index)));
                }
                Ok(Some(ScanEvent::Column(column)))
            }
            Some(_) if is(payload::ScanEnd::FORMAT) => {
                let end = end(frame.bytes()).map_err(malformed)?;
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

fn header(bytes: &[u8]) -> Result<ScanHeader, Malformed> {
    let head: payload::Scan = payload::read(bytes)?;
    Ok(ScanHeader {
        n_rows: head.n_rows,
        n_columns: head.n_columns,
        azimuth_start: head.azimuth_start,
        azimuth_step: head.azimuth_step,
        elevation_start: head.elevation_start,
        elevation_step: head.elevation_step,
        seam_column: (head.seam_column != u32::MAX).then_some(head.seam_column),
        intensity_range: (head.intensity_min, head.intensity_max),
        simulated: head.flags & 1 != 0,
        instrument: payload::text(bytes, head.instrument)?,
        acquired_unix_s: (head.acquired_unix_s != 0.0).then_some(head.acquired_unix_s),
        notes: payload::text(bytes, head.notes)?.lines().map(str::to_owned).collect(),
    })
}

fn column(bytes: &[u8]) -> Result<Column, Malformed> {
    let head: payload::Column = payload::read(bytes)?;
    let state = |code: &u8| match code {
        0 => State::Valid,
        1 => State::DirectionOnly,
        _ => State::NoReturn,
    };
    Ok(Column {
        index: head.index,
        face: if head.face == 0 { Face::Front } else { Face::Back },
        first_row: head.first_row,
        range_m: payload::slice::<f64>(bytes, head.range_m)?.to_vec(),
        azimuth: payload::slice(bytes, head.azimuth)?.iter().map(|a: &f64| wrap_azimuth(*a)).collect(),
        elevation: payload::slice::<f64>(bytes, head.elevation)?.to_vec(),
        intensity: payload::slice::<u16>(bytes, head.intensity)?.to_vec(),
        state: payload::slice::<u8>(bytes, head.state)?.iter().map(state).collect(),
    })
}

fn end(bytes: &[u8]) -> Result<ScanEnd, Malformed> {
    let head: payload::ScanEnd = payload::read(bytes)?;
    Ok(ScanEnd {
        columns: head.columns,
        points: head.points,
        warm_up_columns: head.warm_up_columns,
        outcome: match head.outcome {
            0 => Outcome::Complete,
            1 => Outcome::Aborted,
            _ => Outcome::Failed,
        },
    })
}
