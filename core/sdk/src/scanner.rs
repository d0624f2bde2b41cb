//! Scanner plugins: trait, and the sink of a scan.

use platen_abi::{frame_flag, payload};
use platen_scan::{Column, Face, Outcome, ScanEnd, ScanHeader, Window};

use crate::sink::Payload;
use crate::{Error, ErrorKind, Info, Job, Options, Result};

/// Plugin that turns a trigger into a lattice, column by column.
pub trait Scanner: Send + Sized + 'static {
    /// Description of the plugin.
    const INFO: Info;
    /// Options of the plugin; `()` for none.
    type Options: Options;

    /// Creates the plugin from checked options. Must not access hardware or files.
    ///
    /// # Errors
    /// When the options contradict each other.
    fn new(options: Self::Options) -> Result<Self>;

    /// Connects to the device; may block.
    ///
    /// # Errors
    /// When the device does not answer, with what to do about it.
    fn open(&mut self) -> Result<()> {
        Ok(())
    }

    /// Returns the duration of a scan of `window` in seconds, if known; `None` is the full field of view.
    fn estimate_s(&mut self, window: Option<&Window>) -> Option<f64> {
        let _ = window;
        None
    }

    /// Prepares for the next trigger.
    ///
    /// # Errors
    /// When the device is not ready to scan.
    fn arm(&mut self, job: &Job<'_>) -> Result<()> {
        job.check()
    }

    /// Scans: calls [`ScanSink::begin`] once, [`ScanSink::column`] for the columns in any order, [`ScanSink::end`] once.
    ///
    /// # Errors
    /// When the scan is not complete.
    fn capture(&mut self, job: &Job<'_>, out: &mut ScanSink<'_>) -> Result<()>;

    /// Disconnects, and joins the threads that the plugin started.
    fn close(&mut self) {}
}

/// Sink of one scan.
#[derive(Debug)]
pub struct ScanSink<'a> {
    pub(crate) job: Job<'a>,
    pub(crate) window: Option<Window>,
    pub(crate) n_rows: Option<u32>,
    pub(crate) simulated: bool,
    pub(crate) ended: bool,
}

impl ScanSink<'_> {
    /// Returns the requested part of the field of view; `None` requests all of it. A driver without such a feature sends all.
    pub fn window(&self) -> Option<&Window> {
        self.window.as_ref()
    }

    /// Sends the header. Must be called once, first.
    ///
    /// # Errors
    /// When called twice, or the job is cancelled.
    pub fn begin(&mut self, header: &ScanHeader) -> Result<()> {
        if self.n_rows.is_some() {
            return Err(Error::new(ErrorKind::Internal, "begin was called twice for one scan"));
        }
        let notes = header.notes.join("\n");
        let mut layout = payload::Layout::of::<payload::Scan>();
        let head = payload::Scan {
            struct_size: size_of::<payload::Scan>() as u32,
            flags: u32::from(header.simulated),
            n_rows: header.n_rows,
            n_columns: header.n_columns,
            azimuth_start: header.azimuth_start,
            azimuth_step: header.azimuth_step,
            elevation_start: header.elevation_start,
            elevation_step: header.elevation_step,
            seam_column: header.seam_column.unwrap_or(u32::MAX),
            intensity_min: header.intensity_range.0,
            intensity_max: header.intensity_range.1,
            acquired_unix_s: header.acquired_unix_s.unwrap_or(0.0),
            instrument: layout.add::<u8>(header.instrument.len()),
            notes: layout.add::<u8>(notes.len()),
        };
        let mut payload = Payload::new(&self.job, &layout)?;
        payload
            .header(&head)
            .array(head.instrument, header.instrument.as_bytes())
            .array(head.notes, notes.as_bytes());
        self.n_rows = Some(header.n_rows);
        self.simulated = header.simulated;
        payload.emit::<payload::Scan>(&self.job, 0, self.flags())
    }

    /// Sends one column.
    ///
    /// # Errors
    /// When the column is invalid, the header is missing, or the job is cancelled.
    pub fn column(&mut self, column: &Column) -> Result<()> {
        let n_rows = self
            .n_rows
            .ok_or_else(|| Error::new(ErrorKind::Internal, "a column was sent before the header"))?;
        column.check(n_rows).map_err(|e| Error::new(ErrorKind::BadData, e.to_string()))?;
        let n = column.len();
        let mut layout = payload::Layout::of::<payload::Column>();
        let head = payload::Column {
            struct_size: size_of::<payload::Column>() as u32,
            index: column.index,
            face: u32::from(column.face == Face::Back),
            first_row: column.first_row,
            range_m: layout.add::<f64>(n),
            azimuth: layout.add::<f64>(n),
            elevation: layout.add::<f64>(n),
            intensity: layout.add::<u16>(n),
            state: layout.add::<u8>(n),
        };
        let state: Vec<u8> = column.state.iter().map(|s| *s as u8).collect();
        let mut payload = Payload::new(&self.job, &layout)?;
        payload
            .header(&head)
            .array(head.range_m, &column.range_m)
            .array(head.azimuth, &column.azimuth)
            .array(head.elevation, &column.elevation)
            .array(head.intensity, &column.intensity)
            .array(head.state, &state);
        payload.emit::<payload::Column>(&self.job, n as u64, self.flags())
    }

    /// Ends the scan. Must be called once, last: a scan without end is discarded.
    ///
    /// # Errors
    /// When the header is missing or the scan has ended already.
    pub fn end(&mut self, end: &ScanEnd) -> Result<()> {
        if self.n_rows.is_none() || self.ended {
            return Err(Error::new(ErrorKind::Internal, "end was called without begin, or twice"));
        }
        let head = payload::ScanEnd {
            struct_size: size_of::<payload::ScanEnd>() as u32,
            columns: end.columns,
            points: end.points,
            warm_up_columns: end.warm_up_columns,
            outcome: match end.outcome {
                Outcome::Complete => 0,
                Outcome::Aborted => 1,
                Outcome::Failed => 2,
            },
        };
        let mut payload = Payload::new(&self.job, &payload::Layout::of::<payload::ScanEnd>())?;
        payload.header(&head);
        self.ended = true;
        payload.emit::<payload::ScanEnd>(&self.job, 0, self.flags() | frame_flag::LAST)
    }

    fn flags(&self) -> u32 {
        if self.simulated { frame_flag::SIMULATED } else { 0 }
    }
}
