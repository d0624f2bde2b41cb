//! Spool: a scan on disk as the frames ScanBegin, Columns in the order of measurement, and ScanEnd, byte for byte as
//! sent.
//!
//! The same format serves Resume and recordings.

use std::fs::File;
use std::io::{BufReader, Seek, Write};
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::sync::mpsc::Sender;
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::event::Event;
use super::frame::{self, Frame};
use super::message::{Outcome, ScanBegin, ScanEnd, ScanLayout};
use super::payload;

/// Position of a column in the file.
#[derive(Debug, Clone, Copy)]
struct Place {
    at: u64,
    length: u32,
    crc: u32,
    points: u64,
}

/// Scan on disk, in progress or complete.
#[derive(Debug)]
pub(super) struct Spool {
    pub(super) job: String,
    pub(super) number: u32,
    file: File,
    /// Columns are released only after the end of the scan.
    held_back: bool,
    inner: Mutex<Inner>,
}

#[derive(Debug, Default)]
struct Inner {
    begin: Option<ScanLayout>,
    places: Vec<Option<Place>>,
    arrived: Vec<u32>,
    at: u64,
    sequence: u64,
    end: Option<ScanEnd>,
    /// Reason why there will be no scan.
    refused: Option<String>,
    listeners: Vec<Sender<Event>>,
}

impl Spool {
    /// Creates an empty spool in `file`, or in an unnamed temporary file.
    pub(super) fn new(job: &str, number: u32, file: Option<&Path>, held_back: bool) -> std::io::Result<Self> {
        let file = match file {
            Some(path) => File::options().read(true).write(true).create(true).truncate(true).open(path)?,
            None => tempfile::tempfile()?,
        };
        Ok(Self { job: job.to_owned(), number, file, held_back, inner: Mutex::default() })
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notifies `listener` of all later changes.
    pub(super) fn listen(&self, listener: Sender<Event>) {
        self.inner().listeners.push(listener);
    }

    /// Records the lattice.
    pub(super) fn begin(&self, begin: ScanLayout) -> std::io::Result<()> {
        let mut inner = self.inner();
        let message = ScanBegin { job: self.job.clone(), begin: begin.clone() };
        inner.places = vec![None; begin.columns as usize];
        inner.begin = Some(begin);
        inner.append(&self.file, frame::SCAN_BEGIN, self.number, serde_json::to_vec(&message)?)?;
        inner.notify();
        Ok(())
    }

    /// Appends a column.
    pub(super) fn column(&self, bytes: Vec<u8>) -> std::io::Result<()> {
        let mut inner = self.inner();
        let Some(number) = payload::number(&bytes).filter(|n| (*n as usize) < inner.places.len()) else {
            return Err(std::io::Error::other("a column outside of its lattice"));
        };
        let (length, crc, points) = (bytes.len() as u32, crc32c::crc32c(&bytes), payload::points(&bytes));
        let at = inner.append(&self.file, frame::COLUMN, self.number, bytes)?;
        inner.places[number as usize] = Some(Place { at, length, crc, points });
        inner.arrived.push(number);
        inner.notify();
        Ok(())
    }

    /// Records the end of the scan.
    pub(super) fn end(&self, outcome: Outcome, reason: Option<String>) -> std::io::Result<()> {
        let mut inner = self.inner();
        let sound = inner.places.iter().flatten();
        let digest = sound.clone().fold(0, |sum, place| crc32c::crc32c_append(sum, &place.crc.to_le_bytes()));
        let (columns, points) = (sound.clone().count() as u32, sound.map(|place| place.points).sum());
        let end = ScanEnd { outcome, reason, columns, points, digest };
        inner.append(&self.file, frame::SCAN_END, self.number, serde_json::to_vec(&end)?)?;
        inner.end = Some(end);
        inner.notify();
        Ok(())
    }

    /// Records that there will be no scan.
    pub(super) fn refuse(&self, why: String) {
        let mut inner = self.inner();
        inner.refused = Some(why);
        inner.notify();
    }

    /// Returns the reason why there will be no scan.
    pub(super) fn refused(&self) -> Option<String> {
        self.inner().refused.clone()
    }

    /// Returns true when the lattice is known, released or not.
    pub(super) fn has_begun(&self) -> bool {
        self.inner().begin.is_some()
    }

    /// Returns true when the scan has ended or was refused.
    pub(super) fn is_over(&self) -> bool {
        let inner = self.inner();
        inner.end.is_some() || inner.refused.is_some()
    }

    /// Returns the lattice once it is released.
    pub(super) fn begun(&self) -> Option<ScanLayout> {
        let inner = self.inner();
        inner.begin.clone().filter(|_| !self.held_back || inner.end.is_some())
    }

    /// Returns the end of the scan, if recorded.
    pub(super) fn ended(&self) -> Option<ScanEnd> {
        self.inner().end.clone()
    }

    /// Returns the fraction of columns measured.
    pub(super) fn progress(&self) -> f64 {
        let inner = self.inner();
        inner.arrived.len() as f64 / inner.places.len().max(1) as f64
    }

    /// Returns the number of the `nth` measured column once it is released.
    pub(super) fn arrival(&self, nth: usize) -> Option<u32> {
        let inner = self.inner();
        (!self.held_back || inner.end.is_some()).then(|| inner.arrived.get(nth).copied()).flatten()
    }

    /// Returns the size on disk, bytes.
    pub(super) fn bytes(&self) -> u64 {
        self.inner().at
    }

    /// Reads the payload of a measured column.
    pub(super) fn payload(&self, number: u32) -> std::io::Result<Vec<u8>> {
        let place = self.inner().places.get(number as usize).copied().flatten();
        let place = place.ok_or_else(|| std::io::Error::other("the column is not there"))?;
        let mut bytes = vec![0; place.length as usize];
        self.file.read_exact_at(&mut bytes, place.at)?;
        Ok(bytes)
    }
}

impl Inner {
    /// Appends a frame; returns the offset of its payload.
    fn append(&mut self, mut file: &File, kind: u16, scan: u32, payload: Vec<u8>) -> std::io::Result<u64> {
        let bytes = frame::bytes(&Frame { kind, scan, payload }, self.sequence);
        file.write_all(&bytes)?;
        let place = self.at + frame::HEADER as u64;
        self.at += bytes.len() as u64;
        self.sequence += 1;
        Ok(place)
    }

    fn notify(&mut self) {
        self.listeners.retain(|listener| listener.send(Event::ScanAdvanced).is_ok());
    }
}

/// Reads a recording: calls `begun` with the lattice, then `column` for every column, until one returns false.
///
/// # Errors
/// The file is missing or contains no complete scan.
pub(super) fn read_recording(
    path: &Path,
    mut begun: impl FnMut(ScanLayout) -> bool,
    mut column: impl FnMut(Vec<u8>) -> bool,
) -> std::io::Result<()> {
    let broken = |what: String| std::io::Error::other(format!("{}: {what}", path.display()));
    let mut file = BufReader::new(File::open(path).map_err(|error| broken(error.to_string()))?);
    file.rewind()?;
    for sequence in 0.. {
        let frame = frame::read(&mut file, sequence).map_err(|error| {
            broken(format!("frame {sequence}: {error}; the recording is incomplete or invalid"))
        })?;
        let going_on = match frame.kind {
            frame::SCAN_BEGIN => begun(serde_json::from_slice::<ScanBegin>(&frame.payload)?.begin),
            frame::COLUMN => column(frame.payload),
            frame::SCAN_END => return Ok(()),
            _ => true,
        };
        if !going_on {
            return Ok(());
        }
    }
    Ok(())
}
