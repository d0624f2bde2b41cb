//! Store of raw scans: copies of kept scans under their SHA-256, `scans/ab/SHA256.e57`, selected by a rule of the plant
//! file.
//!
//! The store contains the scans that are kept longer than `keep_scans`. It may be a network share or the folder of an
//! object store. The record alone determines which scans belong there, so a scan that could not be copied is copied
//! later: after the next scan, or at the next start. A thread of its own copies; a store that hangs stops neither the
//! results nor the retention of scans. Nothing is removed from the store.
//!
//! Limits: the last stroke of a plate is only known once the first stroke of the next plate is recorded.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use platen_history::{Archive, Filter, History, Stroke};
use platen_model::Verdict;
use platen_plant::PlantFile;
use platen_plant::plant::{ScanStore, StoredScans};
use platen_report::output_folder;
use sha2::{Digest as _, Sha256};

use crate::sha256;

/// Number of newest strokes checked after a scan; all strokes are checked at the start.
const NEWEST: u32 = 200;
/// Time after a scan until its result is certainly recorded.
const SETTLED: Duration = Duration::from_secs(10);
/// Bytes copied at a time.
const CHUNK: usize = 1 << 20;

/// Notifies the store when a scan was kept.
#[derive(Debug, Clone)]
pub(super) struct Waker(SyncSender<()>);

impl Waker {
    pub(super) fn wake(&self) {
        // A full channel already contains a notification.
        let _ = self.0.try_send(());
    }
}

/// Starts the thread of the store, where the plant file has one.
pub(super) fn start(plant: &PlantFile, history: Arc<Mutex<History>>) -> Option<Waker> {
    let rule = plant.scan_store.clone()?;
    let (results, record) = (plant.output.folder.clone(), plant.output.history.clone());
    let (waker, woken) = sync_channel(1);
    let copier = Copier { rule, results, record, history };
    let thread = std::thread::Builder::new().name("scan store".into()).spawn(move || copier.serve(&woken));
    thread
        .inspect_err(|error| tracing::error!("scans are not stored: no thread for them: {error}"))
        .ok()
        .map(|_| Waker(waker))
}

struct Copier {
    rule: ScanStore,
    results: PathBuf,
    record: PathBuf,
    history: Arc<Mutex<History>>,
}

impl Copier {
    fn serve(&self, woken: &Receiver<()>) {
        self.sweep(None);
        let mut again = true;
        loop {
            let ended = if again { woken.recv_timeout(SETTLED) } else { woken.recv().map_err(Into::into) };
            if ended == Err(RecvTimeoutError::Disconnected) {
                return;
            }
            again = ended.is_ok();
            self.sweep(Some(NEWEST));
        }
    }

    /// Copies scans that belong into the store and are missing; the first failure ends the pass until the next one.
    fn sweep(&self, newest: Option<u32>) {
        let strokes = Archive::open(&self.record)
            .and_then(|archive| archive.strokes(&Filter { newest, ..Filter::default() }));
        let strokes = match strokes {
            Ok(strokes) => strokes,
            Err(why) => return tracing::warn!("scan store: {why}"),
        };
        for stroke in wanted(&strokes, &self.rule) {
            let run = format!("run-{:06}", stroke.run_id);
            let scan = self.results.join(&run).join(output_folder::SCAN);
            if !scan.is_file() {
                continue;
            }
            let part = format!("press-{}-{run}.part", stroke.key.press);
            let stored = match put(&self.rule.folder, &scan, &part) {
                Ok(stored) => stored,
                Err(why) => {
                    let store = self.rule.folder.display();
                    return tracing::warn!(
                        "{store}: {run}: the scan is not stored: {why}; tried again after the next scan"
                    );
                }
            };
            let mut history = self.history.lock().unwrap_or_else(PoisonError::into_inner);
            if let Err(why) = history.attach_scan(stroke.run_id, &stored.sha256, Some(&stored.path)) {
                return tracing::warn!("scan store: {why}");
            }
        }
    }
}

/// Returns the strokes whose scans belong into the store and are not recorded as stored.
fn wanted<'a>(strokes: &'a [Stroke], rule: &ScanStore) -> Vec<&'a Stroke> {
    let mut last: BTreeMap<u32, u32> = BTreeMap::new();
    for stroke in strokes.iter().filter(|stroke| !stroke.dry_run) {
        last.insert(stroke.plate, stroke.run_id);
    }
    // The plate of the newest stroke may not be finished.
    if let Some(newest) = strokes.last() {
        last.remove(&newest.plate);
    }
    let is = |class: StoredScans| rule.which.contains(&class);
    let belongs = |stroke: &Stroke| {
        stroke.baseline && is(StoredScans::Baseline)
            || last.get(&stroke.plate) == Some(&stroke.run_id) && is(StoredScans::Last)
            || stroke.verdict == Some(Verdict::CannotTell) && is(StoredScans::CannotTell)
            || stroke.verdict == Some(Verdict::NotMeasured) && is(StoredScans::NotMeasured)
            || sampled(stroke, rule.share)
    };
    strokes
        .iter()
        .filter(|stroke| stroke.verdict.is_some() && stroke.scan.is_none() && belongs(stroke))
        .collect()
}

/// Selects a share of all strokes at random, with the same outcome at every call.
fn sampled(stroke: &Stroke, share: f64) -> bool {
    let digest = Sha256::digest(format!("{} {}", stroke.key.press, stroke.run_id));
    let drawn = digest.iter().take(4).fold(0_u32, |number, byte| number << 8 | u32::from(*byte));
    f64::from(drawn) < share * (f64::from(u32::MAX) + 1.0)
}

/// A scan in the store.
#[derive(Debug, PartialEq, Eq)]
struct Stored {
    path: PathBuf,
    sha256: String,
}

/// Copies a scan under its SHA-256, unless it is already there. The scan is read once; the copy appears complete, by
/// one rename.
fn put(store: &Path, scan: &Path, part: &str) -> io::Result<Stored> {
    let scans = store.join("scans");
    std::fs::create_dir_all(&scans)?;
    let part = scans.join(part);
    let (mut from, mut to, mut sha) = (File::open(scan)?, File::create(&part)?, Sha256::new());
    let mut chunk = vec![0; CHUNK];
    loop {
        let n = from.read(&mut chunk)?;
        if n == 0 {
            break;
        }
        sha.update(&chunk[..n]);
        to.write_all(&chunk[..n])?;
    }
    to.sync_all()?;
    let sha256 = sha256::hexadecimal(&sha.finalize());
    let folder = scans.join(&sha256[..2]);
    let path = folder.join(format!("{sha256}.e57"));
    if path.exists() {
        std::fs::remove_file(&part)?;
    } else {
        std::fs::create_dir_all(&folder)?;
        std::fs::rename(&part, &path)?;
    }
    Ok(Stored { path, sha256 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use platen_model::StrokeKey;

    fn stroke(run_id: u32, plate: u32, verdict: Option<Verdict>) -> Stroke {
        Stroke {
            run_id,
            key: StrokeKey { press: 3, session: 1, stroke: run_id as u16, attempt: 0 },
            plate,
            recipe: None,
            baseline: false,
            dry_run: false,
            accepted: jiff::Timestamp::UNIX_EPOCH,
            scanned: None,
            finished: None,
            acked: None,
            ack: None,
            seq: None,
            verdict,
            reason: None,
            figures: BTreeMap::new(),
            data: "{}".to_owned(),
            publication: None,
            document: None,
            scan: None,
            scan_sha256: None,
        }
    }

    fn rule(which: &[StoredScans], share: f64) -> ScanStore {
        ScanStore { folder: PathBuf::new(), which: which.to_vec(), share }
    }

    #[test]
    fn each_class_of_scans_is_stored_by_its_own_rule() {
        use StoredScans::{Baseline, CannotTell, Last, NotMeasured};
        let mut strokes = vec![
            stroke(1, 1, Some(Verdict::Fail)),
            stroke(2, 1, Some(Verdict::CannotTell)),
            stroke(3, 1, Some(Verdict::Pass)),
            stroke(4, 2, Some(Verdict::NotMeasured)),
            stroke(5, 2, Some(Verdict::Fail)),
            stroke(6, 2, None),
        ];
        (strokes[0].baseline, strokes[5].baseline) = (true, true);
        let runs = |which: &[StoredScans]| -> Vec<u32> {
            wanted(&strokes, &rule(which, 0.0)).iter().map(|stroke| stroke.run_id).collect()
        };
        assert!(runs(&[]).is_empty());
        assert_eq!(runs(&[Baseline]), [1], "run 6 has no result yet");
        assert_eq!(runs(&[Last]), [3], "plate 2 may go on");
        assert_eq!(runs(&[CannotTell]), [2]);
        assert_eq!(runs(&[NotMeasured]), [4]);
        assert_eq!(runs(&[Baseline, Last, CannotTell, NotMeasured]), [1, 2, 3, 4]);
        strokes[2].scan = Some("scans/ab/x.e57".into());
        let stored = wanted(&strokes, &rule(&[Last], 1.0));
        assert!(!stored.iter().any(|stroke| stroke.run_id == 3), "it is stored already");
        assert_eq!(stored.len(), 4);
    }

    #[test]
    fn a_share_is_a_share_and_the_same_one_each_time() {
        let strokes: Vec<Stroke> = (1..=10_000).map(|run| stroke(run, run, Some(Verdict::Pass))).collect();
        let drawn = |share| wanted(&strokes, &rule(&[], share)).len();
        assert_eq!((drawn(0.0), drawn(1.0)), (0, 10_000));
        // 100 +- 10 (one standard deviation).
        assert!((60..140).contains(&drawn(0.01)), "{}", drawn(0.01));
    }

    #[test]
    fn a_scan_is_put_once_under_its_digest() {
        let folder = tempfile::tempdir().unwrap();
        let (scan, store) = (folder.path().join("scan.e57"), folder.path().join("store"));
        std::fs::write(&scan, "abc").unwrap();
        let digest = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        let stored = put(&store, &scan, "press-3-run-000001.part").unwrap();
        assert_eq!(stored.sha256, digest);
        assert_eq!(stored.path, store.join(format!("scans/ba/{digest}.e57")));
        let made = std::fs::metadata(&stored.path).unwrap().modified().unwrap();
        assert_eq!(put(&store, &scan, "press-4-run-000001.part").unwrap(), stored);
        assert_eq!(std::fs::metadata(&stored.path).unwrap().modified().unwrap(), made, "put only if absent");
        assert_eq!(std::fs::read_dir(store.join("scans")).unwrap().count(), 1, "no part is left");
    }
}
