//! From a trigger to the sink.

use platen_scan::orient::Expected;
use platen_scan::{Column, ScanEnd, ScanHeader};
use platen_sdk::{ErrorKind, Job, ScanSink};

use crate::error::Result;
use crate::source::{Receiver, deliver};
use crate::{Options, open};

/// Reads the file of the options into the sink.
pub(crate) fn capture(
    options: &Options,
    known: &Expected,
    job: &Job<'_>,
    out: &mut ScanSink<'_>,
) -> platen_sdk::Result<()> {
    let Some(path) = &options.file else {
        return Err(platen_sdk::Error::new(ErrorKind::Config, "no scan to read").hint("set the option file"));
    };
    let chosen = options.cloud.and_then(|cloud| usize::try_from(cloud).ok());
    let mut host = ToHost { job, out };
    open::open(path, chosen)
        .and_then(|mut source| deliver(source.as_mut(), known, &mut host))
        .map_err(|error| error.at(path))
}

/// The host as a receiver.
struct ToHost<'a, 'j, 's> {
    job: &'a Job<'j>,
    out: &'a mut ScanSink<'s>,
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
