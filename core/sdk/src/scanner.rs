//! Scanner plugins: the trait, and the sink of a scan.

use std::time::Duration;

use platen_scan::{Column, ScanEnd, ScanHeader, Window};

use crate::{Device, Error, ErrorKind, Health, Info, Job, Options, Result};

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
    /// The device does not answer; the error contains the remedy.
    fn open(&mut self) -> Result<()> {
        Ok(())
    }

    /// Returns the duration of a scan of `window` in seconds, if known; `None` is the full field of view.
    fn estimate_s(&mut self, window: Option<&Window>) -> Option<f64> {
        let _ = window;
        None
    }

    /// Returns the known state of the instrument after `open` or a scan; a request to the instrument must not take
    /// longer than 100 ms.
    fn health(&mut self) -> Option<Health> {
        None
    }

    /// Searches for devices for at most 3 s, without `open`; the options determine where.
    ///
    /// # Errors
    /// The driver cannot search for devices, or the place to search cannot be reached.
    fn discover(&mut self) -> Result<Vec<Device>> {
        Err(Error::new(ErrorKind::Unsupported, "this driver cannot look for devices"))
    }

    /// Scans: calls [`ScanSink::begin`] once, [`ScanSink::column`] for the columns in any order, [`ScanSink::end`]
    /// once.
    ///
    /// # Errors
    /// When the scan is not complete.
    fn capture(&mut self, job: &Job<'_>, out: &mut ScanSink<'_>) -> Result<()>;

    /// Disconnects, and joins the threads that the plugin started.
    fn close(&mut self) {}
}

/// Receiver of a scan and its job: a [`ScanSink`], or that of a test.
pub trait ScanReceiver {
    /// Acts as [`Job::check`].
    fn check(&self) -> Result<()>;
    /// Acts as [`Job::remaining`].
    fn remaining(&self) -> Duration;
    /// Acts as [`Job::progress`].
    fn progress(&self, fraction: f64, phase: &str);
    /// Acts as [`ScanSink::begin`].
    fn begin(&mut self, header: &ScanHeader) -> Result<()>;
    /// Acts as [`ScanSink::column`].
    fn column(&mut self, column: &Column) -> Result<()>;
    /// Acts as [`ScanSink::end`].
    fn end(&mut self, end: &ScanEnd) -> Result<()>;
}

impl ScanReceiver for ScanSink<'_> {
    fn check(&self) -> Result<()> {
        self.job.check()
    }
    fn remaining(&self) -> Duration {
        self.job.remaining()
    }
    fn progress(&self, fraction: f64, phase: &str) {
        self.job.progress(fraction, phase);
    }
    fn begin(&mut self, header: &ScanHeader) -> Result<()> {
        self.begin(header)
    }
    fn column(&mut self, column: &Column) -> Result<()> {
        self.column(column)
    }
    fn end(&mut self, end: &ScanEnd) -> Result<()> {
        self.end(end)
    }
}

/// Sink of one scan.
#[derive(Debug)]
pub struct ScanSink<'a> {
    pub(crate) job: Job<'a>,
    pub(crate) window: Option<Window>,
    pub(crate) n_rows: Option<u32>,
    pub(crate) ended: bool,
}

impl ScanSink<'_> {
    /// Returns the requested part of the field of view; `None` requests all of it. A driver that cannot restrict a scan
    /// sends all of it.
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
        self.n_rows = Some(header.n_rows);
        self.job.send(header)
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
        self.job.send(column)
    }

    /// Ends the scan. Must be called once, last: a scan without end is discarded.
    ///
    /// # Errors
    /// When the header is missing or the scan has ended already.
    pub fn end(&mut self, end: &ScanEnd) -> Result<()> {
        if self.n_rows.is_none() || self.ended {
            return Err(Error::new(ErrorKind::Internal, "end was called without begin, or twice"));
        }
        self.ended = true;
        self.job.send(end)
    }
}
