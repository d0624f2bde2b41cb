//! Delivery of a scan to the host, from one file or from the next file in a watched folder.

use std::path::{Path, PathBuf};
use std::time::Duration;

use platen_formats::orient::Expected;
use platen_formats::{Oriented, ScanReader};
use platen_scan::data_sheet_range_error_m;
use platen_sdk::{ErrorKind, Job, ScanSink};

use crate::error::{Error, Result};
use crate::watch::{Listing, Watch, list};

/// Settings of reading.
#[derive(Debug, Clone)]
pub(crate) struct Reading {
    /// Number of the scan in a file that holds several, from 1.
    pub(crate) cloud: Option<usize>,
    /// Properties of the scanner that the plant file declares.
    pub(crate) known: Expected,
}

impl Reading {
    /// Opens and checks a file.
    pub(crate) fn open<'a>(
        &self,
        path: &Path,
        alive: &'a (dyn Fn() -> bool + Sync),
    ) -> Result<ScanReader<'a>> {
        Ok(ScanReader::open(path, self.cloud, alive)?)
    }

    /// Decides the orientation of the scan.
    pub(crate) fn orient(
        &self,
        reader: &mut ScanReader<'_>,
        progress: &mut Progress<'_>,
    ) -> Result<Oriented> {
        reader.orient(&self.known, progress)
    }
}

/// Receiver of the share done, 0 to 1; an error ends the work.
pub(crate) type Progress<'a> = dyn FnMut(f64) -> Result<()> + 'a;

/// Returns the progress of a job in the form for the host.
pub(crate) fn progress<'a>(job: &'a Job<'_>, phase: &'a str) -> impl FnMut(f64) -> Result<()> + 'a {
    move |share| {
        job.progress(share, phase);
        Ok(job.check()?)
    }
}

/// Delivers all columns of an oriented scan.
pub(crate) fn deliver(
    job: &Job<'_>,
    reader: &mut ScanReader<'_>,
    oriented: &Oriented,
    out: &mut ScanSink<'_>,
) -> Result<()> {
    let mut header = oriented.header().clone();
    header.range_error_m = header.range_error_m.or_else(|| data_sheet_range_error_m(&header.instrument));
    out.begin(&header)?;
    let mut progress = progress(job, "reading columns");
    let mut columns = reader.columns(oriented)?;
    for number in 0_u32.. {
        let Some(column) = columns.next() else { break };
        out.column(&column?)?;
        if number.is_multiple_of(CHECK_EVERY) {
            progress(columns.share())?;
        }
    }
    Ok(out.end(&columns.finish()?)?)
}

/// Columns between two reports of progress.
const CHECK_EVERY: u32 = 64;

/// A watched folder.
#[derive(Debug)]
pub(crate) struct Folder {
    /// The folder.
    pub(crate) path: PathBuf,
    /// Names of scans, with `{stroke}` and `{job}` for their numbers.
    pub(crate) pattern: String,
    /// Polls for which a file must stay the same.
    pub(crate) stable_polls: u32,
    /// Listing before the trigger; none until the folder could be listed.
    pub(crate) before: Option<Listing>,
    /// Checksum of the previously measured scan.
    pub(crate) measured: Option<u32>,
}

impl Folder {
    /// Lists the folder: its present files are not the next scan.
    pub(crate) fn look(&mut self) -> Result<()> {
        self.before = Some(list(&self.path).map_err(Error::Folder)?);
        Ok(())
    }

    /// Returns the pattern of one stroke.
    pub(crate) fn pattern(
        &self,
        stroke: u64,
        job: u64,
    ) -> std::result::Result<glob::Pattern, glob::PatternError> {
        let named = self.pattern.replace("{stroke}", &stroke.to_string()).replace("{job}", &job.to_string());
        glob::Pattern::new(&named)
    }

    /// Waits for the next scan; returns it with its path. `pause` waits between two polls, receives the reason why
    /// there is no scan yet, and ends the wait with an error.
    pub(crate) fn wait<'a>(
        &mut self,
        reading: &Reading,
        pattern: glob::Pattern,
        progress: &mut Progress<'_>,
        pause: &mut dyn FnMut(String) -> Result<()>,
        alive: &'a (dyn Fn() -> bool + Sync),
    ) -> platen_sdk::Result<(PathBuf, ScanReader<'a>, Oriented)> {
        let mut watch = Watch::new(pattern, self.stable_polls, self.before.take());
        loop {
            let mut sound = Vec::new();
            for name in watch.poll(list(&self.path)) {
                match reading.open(&self.path.join(&name), alive) {
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
                match reading.orient(&mut reader, progress) {
                    Ok(oriented) if self.measured == Some(oriented.checksum()) => {
                        watch.refuse(&name, Error::Repeated.to_string());
                    }
                    Ok(oriented) => return Ok((path, reader, oriented)),
                    Err(error @ Error::Host(_)) => return Err(error.at(&path)),
                    Err(error) => watch.refuse(&name, error.to_string()),
                }
            }
            pause(watch.why()).map_err(|error| error.at(&self.path))?;
        }
    }

    /// Ends the wait; `delivered` is the checksum of the scan if one was delivered. Files present now are not the scan
    /// of the next stroke.
    pub(crate) fn close(&mut self, delivered: Option<u32>) {
        self.before = list(&self.path).ok();
        self.measured = delivered.or(self.measured);
    }
}

/// Waits for `poll` in intervals short enough for the host, and ends early enough before the deadline to report the
/// reason.
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

/// Returns the error for contradictory options.
pub(crate) fn config(what: &str, hint: &str) -> platen_sdk::Error {
    platen_sdk::Error::new(ErrorKind::Config, what).hint(hint)
}
