//! Scanner drivers.

use platen_abi::{frame_flag, payload};
use platen_scan::{Column, Face, Outcome, ScanEnd, ScanHeader, Window};

use crate::sink::Payload;
use crate::{Error, ErrorKind, Info, Job, Options, Result};

/// Turns a trigger into a lattice, column by column.
pub trait Scanner: Send + Sized + 'static {
    /// What it is.
    const INFO: Info;
    /// Its options.
    type Options: Options;

    /// Takes the options. Touches no hardware and no file.
    ///
    /// # Errors
    /// When the options contradict each other.
    fn new(options: Self::Options) -> Result<Self>;

    /// Connects; may block.
    ///
    /// # Errors
    /// When the device does not answer, with what to do about it.
    fn open(&mut self) -> Result<()> {
        Ok(())
    }

    /// Seconds that a scan of `window` (everything, when `None`) takes, when known.
    fn estimate_s(&mut self, window: Option<&Window>) -> Option<f64> {
        let _ = window;
        None
    }

    /// Prepares for the next trigger.
    ///
    /// # Errors
    /// When the device cannot scan now.
    fn arm(&mut self, job: &Job<'_>) -> Result<()> {
        job.check()
    }

    /// Scans: one [`ScanSink::begin`], the columns in any order, one [`ScanSink::end`].
    ///
    /// # Errors
    /// When the scan did not become complete.
    fn capture(&mut self, job: &Job<'_>, out: &mut ScanSink<'_>) -> Result<()>;

    /// Disconnects; joins own threads.
    fn close(&mut self) {}
}

/// Where a scan goes.
#[derive(Debug)]
pub struct ScanSink<'a> {
    pub(crate) job: Job<'a>,
    pub(crate) window: Option<Window>,
    pub(crate) n_rows: Option<u32>,
    pub(crate) simulated: bool,
    pub(crate) ended: bool,
}

impl ScanSink<'_> {
    /// The part of the dome that is wanted; everything when `None`. A driver that cannot restrict itself sends all.
    pub fn window(&self) -> Option<&Window> {
        self.window.as_ref()
    }

    /// Says what is coming. Once, first.
    ///
    /// # Errors
    /// When called twice, or cancelled.
    pub fn begin(&mut self, header: &ScanHeader) -> Result<()> {
        if self.n_rows.is_some() {
            return Err(Error::new(ErrorKind::Internal, "the scan was begun twice"));
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
    /// When the column is not sound, the scan was not begun, or the job is cancelled.
    pub fn column(&mut self, column: &Column) -> Result<()> {
        let n_rows =
            self.n_rows.ok_or_else(|| Error::new(ErrorKind::Internal, "a column came before the header"))?;
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

    /// Says that all columns were sent. Once, last: without it there was no scan.
    ///
    /// # Errors
    /// When the scan was not begun or has ended.
    pub fn end(&mut self, end: &ScanEnd) -> Result<()> {
        if self.n_rows.is_none() || self.ended {
            return Err(Error::new(
                ErrorKind::Internal,
                "the scan's end came without its beginning, or twice",
            ));
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
