//! Source of the scans for `measure`, `inspect`, `convert` and `scan`: a file read by the driver `faro-file`, or the
//! plant's scanner.

use std::path::Path;
use std::time::Duration;

use platen_formats::{ScanFile, Written};
use platen_plant::Value;
use platen_scan::{Column, ScanEnd, ScanHeader, Window};

use super::CliError;
use crate::progress;
use platen_engine::pipeline;
use platen_engine::plugin::{CancelToken, Catalogue, JobSpec, PluginError, RunningScan, Scanner};

/// Longest time to read a file: minutes for the finest full dome.
pub(super) const READ_LIMIT: Duration = Duration::from_secs(1800);
/// Columns between two updates of the progress display.
const SHOW_EVERY: u32 = 32;

/// Opens the file driver for one file; `cloud` chooses one of several scans, from 1.
pub(super) fn open(catalogue: &Catalogue, scan: &Path, cloud: Option<u32>) -> Result<Scanner, CliError> {
    let file = ("file", Value::Path(std::path::absolute(scan)?));
    let cloud = cloud.map(|cloud| ("cloud", Value::Int(i64::from(cloud))));
    let (library, values) = pipeline::load_with(catalogue, "faro-file", [file].into_iter().chain(cloud))?;
    let scanner = Scanner::create(&library, &values)?;
    scanner.instance().open(READ_LIMIT).map_err(|e| CliError::Failed(format!("{}: {e}", scan.display())))?;
    Ok(scanner)
}

/// A scan in progress, shown on the terminal until it is dropped.
pub(super) struct ShownScan<'a> {
    scan: RunningScan<'a>,
    what: &'a str,
    file: Option<&'a Path>,
    columns: u32,
}

/// Starts a scan that is displayed under the name `what` and stops on Ctrl-C. Its errors begin with `file`.
pub(super) fn follow<'a>(
    scanner: &'a Scanner,
    limit: Duration,
    window: Option<&Window>,
    what: &'a str,
    file: Option<&'a Path>,
) -> Result<ShownScan<'a>, CliError> {
    let job = JobSpec { cancel: interrupt(), ..JobSpec::untriggered(limit) };
    progress::phase(what);
    let scan = scanner.start(job, window).inspect_err(|_| progress::done()).map_err(|e| failed(file, e))?;
    Ok(ShownScan { scan, what, file, columns: 0 })
}

impl ShownScan<'_> {
    pub(super) fn header(&self) -> &ScanHeader {
        self.scan.header()
    }

    pub(super) fn finish(mut self) -> Result<ScanEnd, CliError> {
        self.scan.finish().map_err(|e| failed(self.file, e))
    }

    pub(super) fn write(mut self, mut file: ScanFile) -> Result<Written, CliError> {
        let mut writer = file.writer(self.header())?;
        for column in &mut self {
            writer.push(&column?)?;
        }
        let written = writer.finish(&self.finish()?)?;
        Ok(file.persist(written)?)
    }
}

impl Iterator for ShownScan<'_> {
    type Item = Result<Column, CliError>;

    fn next(&mut self) -> Option<Self::Item> {
        let column = self.scan.next()?.map_err(|e| failed(self.file, e));
        self.columns += 1;
        if self.columns % SHOW_EVERY == 1 {
            let expected = self.header().n_columns.max(1);
            progress::share(self.what, f64::from(self.columns) / f64::from(expected));
        }
        Some(column)
    }
}

impl Drop for ShownScan<'_> {
    fn drop(&mut self) {
        progress::done();
    }
}

fn failed(file: Option<&Path>, error: PluginError) -> CliError {
    CliError::Failed(
        file.map(|file| format!("{}: ", file.display())).unwrap_or_default() + &error.to_string(),
    )
}

/// Returns a token that Ctrl-C cancels, so that an interrupted scan leaves no partial file. If the system has no thread
/// for it, Ctrl-C ends the program at once.
fn interrupt() -> CancelToken {
    let token = CancelToken::default();
    let cancelled = token.clone();
    let wait = move || {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
        if runtime.is_ok_and(|runtime| runtime.block_on(tokio::signal::ctrl_c()).is_ok()) {
            cancelled.cancel();
        }
    };
    if let Err(error) = std::thread::Builder::new().name("interrupt".into()).spawn(wait) {
        tracing::debug!("no thread for Ctrl-C: {error}");
    }
    token
}
