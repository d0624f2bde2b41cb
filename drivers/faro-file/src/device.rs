//! From a trigger to the sink: one file, or the next scan in a watched folder.

use std::path::{Path, PathBuf};
use std::time::Duration;

use platen_scan::orient::Expected;
use platen_scan::{Column, ScanEnd, ScanHeader};
use platen_sdk::{ErrorKind, Job, ScanSink};

use crate::error::{Error, Result};
use crate::open;
use crate::source::{Receiver, deliver};
use crate::watch::{Listing, Watch, list};

/// How a file is read.
#[derive(Debug, Clone)]
pub(crate) struct Reading {
    /// Which scan of a file that holds several, from 1.
    pub(crate) cloud: Option<usize>,
    /// What the plant says of the scanner.
    pub(crate) known: Expected,
}

impl Reading {
    /// Reads one file.
    pub(crate) fn file(&self, path: &Path, out: &mut dyn Receiver, alive: &dyn Fn() -> bool) -> Result<()> {
        let mut source = open::open(path, self.cloud, alive)?;
        deliver(source.as_mut(), &self.known, None, out)?;
        Ok(())
    }
}

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
        self.before = Some(list(&self.path).map_err(Error::io("listing the watched folder"))?);
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

    /// Waits for the next scan and reads it; `pause` waits between two looks, is told why there is nothing yet,
    /// and ends the waiting with an error. What lies there afterwards is not the scan of the stroke after.
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

    /// The checksum of the scan.
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
                match open::open(&self.path.join(&name), reading.cloud, alive) {
                    Ok(source) => sound.push((name, source)),
                    Err(error) => watch.refuse(&name, error.to_string()),
                }
            }
            if sound.len() > 1 {
                let names: Vec<String> = sound.iter().map(|(name, _)| name.clone()).collect();
                let why = Error::Ambiguous { names: names.clone() }.to_string();
                names.iter().for_each(|name| watch.refuse(name, why.clone()));
            } else if let Some((name, mut source)) = sound.pop() {
                let mut once = Once { out, begun: false };
                match deliver(source.as_mut(), &reading.known, self.measured, &mut once) {
                    Ok(checksum) => return Ok(checksum),
                    // Once columns are on their way there is no second file for this stroke.
                    Err(error) if once.begun || matches!(error, Error::Host(_)) => {
                        return Err(error.at(&self.path.join(name)));
                    }
                    Err(error) => watch.refuse(&name, error.to_string()),
                }
            }
            pause(watch.why()).map_err(|error| error.at(&self.path))?;
        }
    }
}

/// Waits `poll` in slices short enough for the host, and gives up while there is time to say why.
pub(crate) fn pause(job: &Job<'_>, poll: Duration, why: String) -> Result<()> {
    const SLICE: Duration = Duration::from_millis(20);
    let mut left = poll;
    while !left.is_zero() {
        job.check()?;
        if job.remaining() < SLICE * 5 {
            return Err(Error::TooLate { why });
        }
        std::thread::sleep(left.min(SLICE));
        left = left.saturating_sub(SLICE);
    }
    job.progress(0.0, &why);
    Ok(())
}

/// Notes whether anything was delivered.
struct Once<'a> {
    out: &'a mut dyn Receiver,
    begun: bool,
}

impl Receiver for Once<'_> {
    fn check(&mut self, fraction: f64, phase: &str) -> Result<()> {
        self.out.check(fraction, phase)
    }

    fn begin(&mut self, header: &ScanHeader) -> Result<()> {
        self.begun = true;
        self.out.begin(header)
    }

    fn column(&mut self, column: &Column) -> Result<()> {
        self.out.column(column)
    }

    fn end(&mut self, end: &ScanEnd) -> Result<()> {
        self.out.end(end)
    }
}

/// The host as a receiver.
pub(crate) struct ToHost<'a, 'j, 's> {
    pub(crate) job: &'a Job<'j>,
    pub(crate) out: &'a mut ScanSink<'s>,
}

impl Receiver for ToHost<'_, '_, '_> {
    fn check(&mut self, fraction: f64, phase: &str) -> Result<()> {
        self.job.progress(fraction.min(1.0), phase);
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
