//! Where `measure`, `inspect`, `convert` and `scan` get their scans from.

use std::path::Path;
use std::time::Duration;

use platen_plant::Value;
use platen_scan::{ScanEnd, Window};

use super::CliError;
use crate::progress;
use crate::scan_file::Sink;
use platen_engine::pipeline;
use platen_engine::plugin::{CancelToken, Catalogue, JobSpec, PluginError, ScanEvent, Scanner};

/// A file of the finest full dome takes minutes to read.
pub(super) const READ_LIMIT: Duration = Duration::from_secs(1800);
/// Columns between two looks at the progress.
const SHOW_EVERY: u32 = 32;

/// The file driver, set to one file and, where it holds several scans, to one of them, counted from 1.
pub(super) fn open(catalogue: &Catalogue, scan: &Path, cloud: Option<u32>) -> Result<Scanner, CliError> {
    let file = ("file", Value::Path(std::path::absolute(scan)?));
    let cloud = cloud.map(|cloud| ("cloud", Value::Int(i64::from(cloud))));
    let (library, values) = pipeline::load_with(catalogue, "faro-file", [file].into_iter().chain(cloud))?;
    let scanner = Scanner::create(&library, &values)?;
    scanner.instance().open(READ_LIMIT).map_err(|e| CliError::Failed(format!("{}: {e}", scan.display())))?;
    Ok(scanner)
}

/// Scans, shows how far it is, and stops on Ctrl-C.
pub(super) fn follow(
    scanner: &Scanner,
    limit: Duration,
    window: Option<&Window>,
    what: &str,
    sink: &mut Sink<'_>,
) -> Result<ScanEnd, PluginError> {
    let job = JobSpec { cancel: interrupt(), ..JobSpec::untriggered(limit) };
    let (mut columns, mut expected) = (0_u32, 0);
    progress::phase(what);
    let end = scanner.scan(job, window, &mut |event| {
        match &event {
            ScanEvent::Begin(header) => expected = header.n_columns,
            ScanEvent::Column(_) => columns += 1,
        }
        if columns % SHOW_EVERY == 1 {
            progress::share(what, f64::from(columns) / f64::from(expected.max(1)));
        }
        sink(event)
    });
    progress::done();
    end
}

/// A token that Ctrl-C cancels, so that an interrupted scan leaves nothing behind. Where the system has no thread for
/// that, Ctrl-C ends the program at once.
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
