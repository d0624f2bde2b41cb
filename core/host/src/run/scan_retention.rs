//! Retention of raw scans beside their results.
//!
//! A scan stays in memory until its result has been sent to the press. Then a thread of its own writes it as
//! `run-NNNNNN/scan.e57`; `platen measure` reads it back without any change of a bit. Scans older than the plant file
//! allows are removed, and no other file is.
//!
//! Results have priority. If the disk is nearly full, or the previous scan is still being written, the scan is not kept
//! and the log gives the reason.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

use platen_engine::stroke::ScanBuffer;
use platen_formats::{ScanFile, WriteError};
use platen_history::History;
use platen_plant::plant::{KeepScans, Output};
use platen_report::output_folder;
use platen_scan::{Column, ScanEnd, ScanHeader};

use super::disk;
use super::scan_store::Waker;
use crate::sha256;

/// Bytes of the disk reserved for results and history.
const RESERVE: u64 = 1 << 30;
/// Bytes of a cell in the file: three f64, state, intensity, row and column.
const CELL_BYTES: u64 = 31;
/// Length of the queue of scans.
const WAITING: usize = 1;

#[derive(Debug)]
struct Order {
    run_id: u32,
    folder: PathBuf,
    buffer: ScanBuffer,
}

/// Writes and removes scans on a thread of its own. Drop waits until the last one is written.
#[derive(Debug)]
pub(super) struct ScanRetention {
    orders: Option<SyncSender<Order>>,
    thread: Option<JoinHandle<()>>,
}

impl ScanRetention {
    /// Starts the thread and removes scans that are too old; keeps none where the plant file forbids it.
    pub(super) fn start(output: &Output, history: Arc<Mutex<History>>, store: Option<Waker>) -> Self {
        let age = match output.keep_scans {
            KeepScans::Always => None,
            KeepScans::For(age) => Some(age),
        };
        let (orders, inbox) = sync_channel(WAITING);
        let folder = output.folder.clone();
        let thread = std::thread::Builder::new().name("archive".into()).spawn(move || {
            serve(&folder, age, &inbox, |run_id, sha256| {
                let attached =
                    history.lock().unwrap_or_else(PoisonError::into_inner).attach_scan(run_id, sha256, None);
                if let Err(why) = attached {
                    tracing::warn!("the digest of the scan is not recorded: {why}");
                }
                store.iter().for_each(Waker::wake);
            });
        });
        match thread {
            Ok(thread) if age != Some(Duration::ZERO) => Self { orders: Some(orders), thread: Some(thread) },
            // Without a channel for orders the thread removes old scans and ends.
            Ok(thread) => Self { orders: None, thread: Some(thread) },
            Err(error) => {
                tracing::error!("scans are not kept: no thread for them: {error}");
                Self { orders: None, thread: None }
            }
        }
    }

    /// Returns a buffer for the next scan, if scans are kept.
    pub(super) fn buffer(&self) -> Option<ScanBuffer> {
        self.orders.is_some().then(ScanBuffer::default)
    }

    /// Queues a scan for the folder of its result, which need not exist.
    pub(super) fn keep(&self, run_id: u32, folder: PathBuf, buffer: Option<ScanBuffer>) {
        let (Some(orders), Some(buffer)) = (&self.orders, buffer) else { return };
        match orders.try_send(Order { run_id, folder, buffer }) {
            Ok(()) => {}
            Err(TrySendError::Full(order)) => {
                let folder = order.folder.display();
                tracing::warn!("{folder}: the scan is not kept: the one before is still being written");
            }
            Err(TrySendError::Disconnected(order)) => {
                tracing::error!("{}: the scan is not kept: writing has ended", order.folder.display());
            }
        }
    }
}

impl Drop for ScanRetention {
    fn drop(&mut self) {
        self.orders = None;
        if let Some(thread) = self.thread.take() {
            // A thread that failed has logged the reason.
            let _ = thread.join();
        }
    }
}

/// Writes scans as they arrive; `kept` receives the run and the digest of each.
fn serve(results: &Path, age: Option<Duration>, inbox: &Receiver<Order>, kept: impl Fn(u32, &str)) {
    // Ages are measured on the monotonic clock while the host runs: setting the clock forward removes nothing.
    let (start, since) = (SystemTime::now(), Instant::now());
    let clean = || {
        clean(results, age, start + since.elapsed()).unwrap_or_else(|e| {
            tracing::warn!("{}: old scans are not removed: {e}", results.display());
        });
    };
    clean();
    while let Ok(Order { run_id, folder, buffer }) = inbox.recv() {
        match write(&folder, buffer) {
            Ok(sha256) => kept(run_id, &sha256),
            Err(why) => tracing::warn!("{}: the scan is not kept: {why}", folder.display()),
        }
        clean();
    }
}

/// Writes a scan into a folder and returns its digest.
fn write(folder: &Path, buffer: ScanBuffer) -> Result<String, String> {
    let (header, columns, end) = buffer.finish()?;
    std::fs::create_dir_all(folder).map_err(|e| e.to_string())?;
    let cells: usize = columns.iter().map(Column::len).sum();
    let needed = cells as u64 * CELL_BYTES;
    check_room(needed, disk::free(folder).map_err(|e| e.to_string())?)?;
    let path = folder.join(output_folder::SCAN);
    save(&path, &header, columns, &end).map_err(|e| e.to_string())?;
    sha256::of_file(&path).map_err(|e| e.to_string())
}

/// Writes a scan; each column is freed once it is written.
fn save(path: &Path, header: &ScanHeader, columns: Vec<Column>, end: &ScanEnd) -> Result<(), WriteError> {
    let mut file = ScanFile::create(path)?;
    let mut writer = file.writer(header)?;
    columns.into_iter().try_for_each(|column| writer.push(&column))?;
    let written = writer.finish(end)?;
    file.persist(written).map(drop)
}

/// Refuses a scan of `needed` bytes that would reduce the [`RESERVE`].
fn check_room(needed: u64, free: u64) -> Result<(), String> {
    if free >= needed.saturating_add(RESERVE) {
        return Ok(());
    }
    let [needed, free] = [needed, free].map(|bytes| bytes / 1_000_000);
    Err(format!("it needs {needed} MB, {free} MB are free and 1 GB is left to results; make room"))
}

/// Removes scans older than `age` and partial files of an interrupted host, and no other file.
fn clean(results: &Path, age: Option<Duration>, now: SystemTime) -> std::io::Result<()> {
    if !results.exists() {
        return Ok(());
    }
    for run in std::fs::read_dir(results)? {
        let run = run?;
        let number = run.file_name().to_string_lossy().strip_prefix("run-").map(str::to_owned);
        let is_run = number.is_some_and(|n| n.len() >= 6 && n.bytes().all(|b| b.is_ascii_digit()));
        if !is_run || !run.file_type()?.is_dir() {
            continue;
        }
        for file in std::fs::read_dir(run.path())? {
            let file = file?;
            let name = file.file_name().to_string_lossy().into_owned();
            if !file.file_type()?.is_file() || !remove(&name, age, file.metadata()?.modified()?, now) {
                continue;
            }
            std::fs::remove_file(file.path())?;
            tracing::info!("removed {}", file.path().display());
        }
    }
    Ok(())
}

/// Returns whether a file is a scan that is too old, or a partial file of another process.
fn remove(name: &str, age: Option<Duration>, modified: SystemTime, now: SystemTime) -> bool {
    let old = |limit| now.duration_since(modified).is_ok_and(|age| age > limit);
    let half =
        name.strip_prefix(output_folder::SCAN).and_then(|rest| rest.strip_prefix('.')?.strip_suffix(".part"));
    // `scan.e57.<process>.<random>.part`
    let half = half.map(|half| half.split_once('.').map_or(half, |(process, _)| process));
    match half {
        Some(process) => process.parse() != Ok(std::process::id()) && process.parse::<u32>().is_ok(),
        None => name == output_folder::SCAN && age.is_some_and(old),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_gigabyte_is_left_to_results() {
        assert_eq!(check_room(31_000_000, RESERVE + 31_000_000), Ok(()));
        let refused = check_room(31_000_000, RESERVE + 30_000_000).unwrap_err();
        assert!(refused.starts_with("it needs 31 MB, 1103 MB are free"), "{refused}");
        assert!(check_room(u64::MAX, u64::MAX - 1).is_err());
    }

    #[test]
    fn only_own_scans_of_enough_age_are_removed() {
        const DAY: Duration = Duration::from_secs(86_400);
        let folder = std::env::temp_dir().join(format!("platen-archive-{}", std::process::id()));
        let now = SystemTime::now();
        let put = |name: &str, days: u32| {
            let path = folder.join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(&path, "x").unwrap();
            std::fs::File::options().write(true).open(&path).unwrap().set_modified(now - DAY * days).unwrap();
            path
        };
        let old = put("run-000001/scan.e57", 61);
        let half = put("run-000002/scan.e57.1.a2B4c6.part", 0);
        let kept = [
            put("run-000002/scan.e57", 59),
            put("run-000001/result.json", 900),
            put("run-000001/first.e57", 900),
            put("run-000001/scan.e57.bak.part", 900),
            put("run-000001/inner/scan.e57", 900),
            put("run-1/scan.e57", 900),
            put("run-00000a/scan.e57", 900),
            put("mine-000001/scan.e57", 900),
            put("scan.e57", 900),
        ];
        #[cfg(unix)]
        std::os::unix::fs::symlink(folder.join("mine-000001"), folder.join("run-000007")).unwrap();
        clean(&folder, None, now).unwrap();
        assert!(old.exists() && !half.exists());
        clean(&folder, Some(60 * DAY), now).unwrap();
        assert!(!old.exists());
        kept.iter().for_each(|path| assert!(path.exists(), "{}", path.display()));
        // Setting the clock back removes nothing.
        clean(&folder, Some(60 * DAY), now - 900 * DAY).unwrap();
        clean(&folder, Some(Duration::ZERO), now).unwrap();
        assert!(!kept[0].exists() && kept[1].exists());
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
