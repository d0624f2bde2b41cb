//! Hand-over of one file's scan, or of the next one in a watched folder, to the host.

use std::path::{Path, PathBuf};
use std::time::Duration;

use platen_formats::orient::Expected;
use platen_formats::{Oriented, ScanReader};
use platen_scan::{Column, ScanEnd, ScanHeader};
use platen_sdk::{ErrorKind, Job, ScanSink};

use crate::error::{Error, Result};
use crate::watch::{Listing, Watch, list};

/// Receiver of a scan: the host, or a test.
pub(crate) trait Receiver {
    /// Called every 65,536 cells; an error ends the work.
    fn check(&mut self, fraction: f64, phase: &str) -> Result<()>;
    /// First.
    fn begin(&mut self, header: &ScanHeader) -> Result<()>;
    /// In any order.
    fn column(&mut self, column: &Column) -> Result<()>;
    /// Last.
    fn end(&mut self, end: &ScanEnd) -> Result<()>;
}

/// Settings of reading.
#[derive(Debug, Clone)]
pub(crate) struct Reading {
    /// Number of the scan in a file that holds several, from 1.
    pub(crate) cloud: Option<usize>,
    /// Declarations of the plant about the scanner.
    pub(crate) known: Expected,
}

impl Reading {
    /// Reads one file.
    pub(crate) fn file(&self, path: &Path, out: &mut dyn Receiver, alive: &dyn Fn() -> bool) -> Result<()> {
        let mut reader = ScanReader::open(path, self.cloud, alive)?;
        let oriented = self.orient(&mut reader, out)?;
        deliver(reader, &oriented, out)
    }

    fn orient(&self, reader: &mut ScanReader<'_>, out: &mut dyn Receiver) -> Result<Oriented> {
        reader.orient(&self.known, |share| out.check(share, "looking at the lattice"))
    }
}

/// Delivers all columns of an oriented scan.
fn deliver(mut reader: ScanReader<'_>, oriented: &Oriented, out: &mut dyn Receiver) -> Result<()> {
    out.begin(oriented.header())?;
    let mut columns = reader.columns(oriented)?;
    for number in 0_u32.. {
        let Some(column) = columns.next() else { break };
        out.column(&column?)?;
        if number.is_multiple_of(CHECK_EVERY) {
            out.check(columns.share(), "reading columns")?;
        }
    }
    out.end(&columns.finish()?)
}

/// Columns between two reports of progress.
const CHECK_EVERY: u32 = 64;

/// Where scans arrive.
#[derive(Debug)]
pub(crate) struct Folder {
    /// The folder.
    pub(crate) path: PathBuf,
    /// Names of scans, with `{stroke}` and `{job}` for their numbers.
    pub(crate) pattern: String,
    /// Polls for which a file must stay the same.
    pub(crate) stable_polls: u32,
    /// What lay there before the trigger; nothing until it could be listed.
    pub(crate) before: Option<Listing>,
    /// Checksum of the scan measured before.
    pub(crate) measured: Option<u32>,
}

impl Folder {
    /// Notes what lies there now: none of it is the next scan.
    pub(crate) fn look(&mut self) -> Result<()> {
        self.before = Some(list(&self.path).map_err(Error::Folder)?);
        Ok(())
    }

    /// The pattern of one stroke.
    pub(crate) fn pattern(
        &self,
        stroke: u64,
        job: u64,
    ) -> std::result::Result<glob::Pattern, glob::PatternError> {
        let named = self.pattern.replace("{stroke}", &stroke.to_string()).replace("{job}", &job.to_string());
        glob::Pattern::new(&named)
    }

    /// Waits for the next scan and delivers it. `pause` waits between two polls, receives the reason why there is no
    /// scan yet, and ends the wait with an error. Files present afterwards are not the scan of the next stroke.
    pub(crate) fn follow(
        &mut self,
        reading: &Reading,
        pattern: glob::Pattern,
        out: &mut dyn Receiver,
        pause: &mut dyn FnMut(String) -> Result<()>,
        alive: &dyn Fn() -> bool,
    ) -> platen_sdk::Result<()> {
        let watch = Watch::new(pattern, self.stable_polls, self.before.take());
        let outcome = self.wait(watch, reading, out, pause, alive);
        self.before = list(&self.path).ok();
        self.measured = Some(outcome?);
        Ok(())
    }

    /// Returns the checksum of the scan delivered.
    fn wait(
        &self,
        mut watch: Watch,
        reading: &Reading,
        out: &mut dyn Receiver,
        pause: &mut dyn FnMut(String) -> Result<()>,
        alive: &dyn Fn() -> bool,
    ) -> platen_sdk::Result<u32> {
        loop {
            let due = watch.poll(list(&self.path));
            let mut sound = Vec::new();
            for name in due {
                match ScanReader::open(&self.path.join(&name), reading.cloud, alive) {
                    Ok(reader) => sound.push((name, reader)),
                    Err(error) => watch.refuse(&name, error.to_string()),
                }
            }
            if sound.len() > 1 {
                let names: Vec<String> = sound.iter().map(|(name, _)| name.clone()).collect();
                let why = Error::Ambiguous(names.clone()).to_string();
                names.iter().for_each(|name| watch.refuse(name, why.clone()));
            } else if let Some((name, mut reader)) = sound.pop() {
                let path = self.path.join(&name);
                match reading.orient(&mut reader, out) {
                    Ok(oriented) if self.measured == Some(oriented.checksum()) => {
                        watch.refuse(&name, Error::Repeated.to_string());
                    }
                    // Once columns are delivered there is no second file for this stroke.
                    Ok(oriented) => {
                        let delivered = deliver(reader, &oriented, out);
                        return delivered.map(|()| oriented.checksum()).map_err(|error| error.at(&path));
                    }
                    Err(error @ Error::Host(_)) => return Err(error.at(&path)),
                    Err(error) => watch.refuse(&name, error.to_string()),
                }
            }
            pause(watch.why()).map_err(|error| error.at(&self.path))?;
        }
    }
}

/// Waits `poll` in slices short enough for the host, and ends early enough before the deadline to report the reason.
pub(crate) fn pause(job: &Job<'_>, poll: Duration, why: String) -> Result<()> {
    const SLICE: Duration = Duration::from_millis(20);
    let mut left = poll;
    while !left.is_zero() {
        job.check()?;
        if job.remaining() < SLICE * 5 {
            return Err(Error::TooLate(why));
        }
        std::thread::sleep(left.min(SLICE));
        left = left.saturating_sub(SLICE);
    }
    job.progress(0.0, &why);
    Ok(())
}

/// The host as a receiver.
pub(crate) struct ToHost<'a, 'j, 's> {
    pub(crate) job: &'a Job<'j>,
    pub(crate) out: &'a mut ScanSink<'s>,
}

impl Receiver for ToHost<'_, '_, '_> {
    fn check(&mut self, fraction: f64, phase: &str) -> Result<()> {
        self.job.progress(fraction, phase);
        Ok(self.job.check()?)
    }

    fn begin(&mut self, header: &ScanHeader) -> Result<()> {
        Ok(self.out.begin(header)?)
    }

    fn column(&mut self, column: &Column) -> Result<()> {
        Ok(self.out.column(column)?)
    }

    fn end(&mut self, end: &ScanEnd) -> Result<()> {
        Ok(self.out.end(end)?)
    }
}

/// The options contradict each other.
pub(crate) fn config(what: &str, hint: &str) -> platen_sdk::Error {
    platen_sdk::Error::new(ErrorKind::Config, what).hint(hint)
}
