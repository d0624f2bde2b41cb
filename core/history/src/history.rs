//! Writer of a history; each step of a stroke is on the disk before the method returns.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use jiff::Timestamp;
use rusqlite::{Connection, OptionalExtension, Transaction, named_params};

use crate::archive::{self, Archive, text};
use crate::lock::Lock;
use crate::{Error, StrokeKey, Verdict, schema};

/// Half the range of the press's stroke counter, which wraps at 65535. The same key within this number of runs is the
/// same stroke, beyond it a new one.
pub(crate) const RECENT_RUNS: u32 = 32_768;

/// Writer of a history, for the strokes of one press. Its methods block until the record is on the disk.
#[derive(Debug)]
pub struct History {
    archive: Archive,
    press: u16,
    _lock: Lock,
}

/// Record of a stroke at its acceptance.
#[derive(Debug, Clone, PartialEq)]
pub struct Accepted {
    /// Identity; `press` is that of the [`History`].
    pub key: StrokeKey,
    /// Number of the record.
    pub run_id: u32,
    /// The press's part number; 0 counts as none.
    pub part_id: Option<u32>,
    /// The press's part name.
    pub part_name: Option<String>,
    /// Recipe number of the plate file.
    pub recipe: Option<u16>,
    /// Whether it is a scan of the blank.
    pub baseline: bool,
    /// Whether it is a trial.
    pub dry_run: bool,
    /// All data of the press, JSON.
    pub data: String,
}

/// Result of a stroke.
#[derive(Debug, Clone, PartialEq)]
pub struct Finished {
    /// Identity of the stroke.
    pub key: StrokeKey,
    /// Number of the record.
    pub run_id: u32,
    /// Sequence number under which the result is published.
    pub seq: u16,
    /// Verdict.
    pub verdict: Verdict,
    /// Reason of a missing measurement.
    pub reason: Option<String>,
    /// Named figures, in metres, radians, seconds and fractions.
    pub figures: BTreeMap<String, f64>,
    /// Published result, JSON; after a restart it is published again unchanged.
    pub publication: String,
}

impl History {
    /// Opens the history of `press` for writing; creates it, with its folder, if it does not exist.
    ///
    /// # Errors
    /// [`Error::InUse`] naming the other process, [`Error::Unreachable`], [`Error::Foreign`], [`Error::Storage`].
    pub fn open(path: &Path, press: u16, now: Timestamp) -> Result<Self, Error> {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)
                .map_err(|source| Error::Unreachable { path: folder.to_owned(), source })?;
        }
        let lock = Lock::take(path, now)?;
        let connection = schema::open_writer(path)?;
        let draw = "INSERT OR IGNORE INTO journal (press, owner) VALUES (?1, abs(random() % 65535) + 1)";
        connection.execute(draw, [press]).map_err(Error::storage(path))?;
        Ok(Self { archive: Archive::new(connection, path), press, _lock: lock })
    }

    /// Returns the history for reading.
    pub fn archive(&self) -> &Archive {
        &self.archive
    }

    /// Records the acceptance of a stroke, before it is echoed to the press and scanned. The same again changes
    /// nothing.
    ///
    /// # Errors
    /// [`Error::Contradiction`] when the run id belongs to another stroke, or the stroke is recorded under another run
    /// id: a stroke is measured at most once. [`Error::Storage`].
    pub fn accept(&mut self, stroke: &Accepted, now: Timestamp) -> Result<(), Error> {
        self.own(stroke.key)?;
        let contradiction = |why: String| Err(Error::Contradiction { key: stroke.key, why });
        let (path, transaction) = self.begin()?;
        let storage = Error::storage(&path);
        let earlier = "SELECT press, session, stroke, attempt FROM stroke WHERE run_id = ?1";
        let earlier = transaction.query_row(earlier, [stroke.run_id], archive::key).optional();
        match earlier.map_err(&storage)? {
            Some(key) if key == stroke.key => return Ok(()),
            Some(key) => return contradiction(format!("run id {} is that of {key}", stroke.run_id)),
            None => {}
        }
        if let Some(run_id) = newest(&transaction, stroke.key).map_err(&storage)?
            && stroke.run_id.saturating_sub(run_id) < RECENT_RUNS
        {
            return contradiction(format!("is on record as run {run_id}; a stroke is measured once"));
        }
        let plate = plate(&transaction, stroke, now).map_err(&storage)?;
        let sql = "INSERT INTO stroke (run_id, press, session, stroke, attempt, plate, recipe, baseline, dry_run, \
                   accepted, data) VALUES (:run_id, :press, :session, :stroke, :attempt, :plate, :recipe, :baseline, \
                   :dry_run, :accepted, :data)";
        let values = named_params! {
            ":run_id": stroke.run_id, ":press": stroke.key.press, ":session": stroke.key.session,
            ":stroke": stroke.key.stroke, ":attempt": stroke.key.attempt, ":plate": plate,
            ":recipe": stroke.recipe, ":baseline": stroke.baseline, ":dry_run": stroke.dry_run,
            ":accepted": text(now), ":data": stroke.data,
        };
        transaction.execute(sql, values).map_err(&storage)?;
        transaction.commit().map_err(&storage)
    }

    /// Records that a stroke was scanned. The same again changes nothing.
    ///
    /// # Errors
    /// [`Error::Contradiction`] when the stroke was never accepted; [`Error::Storage`].
    pub fn scanned(&mut self, key: StrokeKey, now: Timestamp) -> Result<(), Error> {
        let sql = "UPDATE stroke SET scanned = ifnull(scanned, ?2) WHERE run_id = ?1";
        self.step(key, |transaction, run_id| transaction.execute(sql, (run_id, text(now))).map(drop))
    }

    /// Records the result of a stroke, before it is published. The same again changes nothing.
    ///
    /// # Errors
    /// [`Error::Contradiction`] when the stroke was never accepted, or has a different result; [`Error::Storage`].
    pub fn finish(&mut self, result: &Finished, now: Timestamp) -> Result<(), Error> {
        let Finished { key, run_id, .. } = *result;
        self.own(key)?;
        let contradiction = |why: String| Err(Error::Contradiction { key, why });
        let (path, transaction) = self.begin()?;
        let storage = Error::storage(&path);
        if newest(&transaction, key).map_err(&storage)? != Some(run_id) {
            return contradiction(format!("has a result under run {run_id}, but was not accepted under it"));
        }
        let recorded = "SELECT publication FROM stroke WHERE run_id = ?1";
        let recorded: Option<String> =
            transaction.query_row(recorded, [run_id], |row| row.get(0)).map_err(&storage)?;
        match recorded {
            Some(same) if same == result.publication => return Ok(()),
            Some(_) => return contradiction(format!("run {run_id} has another result already; it stands")),
            None => {}
        }
        let sql = "UPDATE stroke SET finished = :now, seq = :seq, verdict = :verdict, reason = :reason, \
                   figures = :figures, publication = :publication WHERE run_id = :run_id";
        let figures = serde_json::to_string(&result.figures)
            .map_err(|error| Error::Contradiction { key, why: format!("its figures: {error}") })?;
        let values = named_params! {
            ":now": text(now), ":seq": result.seq, ":verdict": result.verdict.as_str(), ":reason": result.reason,
            ":figures": figures, ":publication": result.publication, ":run_id": run_id,
        };
        transaction.execute(sql, values).map_err(&storage)?;
        let count = "UPDATE journal SET result_seq = ?2 WHERE press = ?1";
        transaction.execute(count, (key.press, result.seq)).map_err(&storage)?;
        transaction.commit().map_err(&storage)
    }

    /// Records the end of a stroke: the press has acknowledged the result, or never will. `how` is the name of the
    /// acknowledgement. The same again changes nothing.
    ///
    /// # Errors
    /// [`Error::Contradiction`] when the stroke was never accepted; [`Error::Storage`].
    pub fn acked(&mut self, key: StrokeKey, how: &str, now: Timestamp) -> Result<(), Error> {
        let sql = "UPDATE stroke SET ack = ifnull(ack, ?3), acked = ifnull(acked, ?2) WHERE run_id = ?1";
        self.step(key, |transaction, run_id| transaction.execute(sql, (run_id, text(now), how)).map(drop))
    }

    /// Records the end of the part: later strokes without a part number belong to a new plate.
    ///
    /// # Errors
    /// [`Error::Storage`].
    pub fn part_end(&mut self, now: Timestamp) -> Result<(), Error> {
        let sql = "UPDATE plate SET ended = ?2 WHERE press = ?1 AND ended IS NULL";
        let ended = self.archive.connection().execute(sql, (self.press, text(now)));
        ended.map(drop).map_err(self.storage())
    }

    /// Records the path of a run's result document.
    ///
    /// # Errors
    /// [`Error::NoSuchRun`], [`Error::Storage`].
    pub fn attach_document(&mut self, run_id: u32, document: &Path) -> Result<(), Error> {
        let document = document.to_string_lossy();
        self.change(run_id, "UPDATE stroke SET document = ?2 WHERE run_id = ?1", (run_id, document))
    }

    /// Records the SHA-256 of a run's raw scan and, once it lies in the scan store, its path there.
    ///
    /// # Errors
    /// [`Error::NoSuchRun`], [`Error::Storage`].
    pub fn attach_scan(&mut self, run_id: u32, sha256: &str, stored: Option<&Path>) -> Result<(), Error> {
        let stored = stored.map(Path::to_string_lossy);
        self.change(
            run_id,
            "UPDATE stroke SET scan_sha256 = ?2, scan = ifnull(?3, scan) WHERE run_id = ?1",
            (run_id, sha256, stored),
        )
    }

    /// Applies one change to the newest run of a stroke.
    fn step(
        &mut self,
        key: StrokeKey,
        change: impl FnOnce(&Transaction<'_>, u32) -> rusqlite::Result<()>,
    ) -> Result<(), Error> {
        self.own(key)?;
        let (path, transaction) = self.begin()?;
        let storage = Error::storage(&path);
        let Some(run_id) = newest(&transaction, key).map_err(&storage)? else {
            return Err(Error::Contradiction { key, why: "was never accepted".to_owned() });
        };
        change(&transaction, run_id).map_err(&storage)?;
        transaction.commit().map_err(&storage)
    }

    fn change(&mut self, run_id: u32, sql: &str, values: impl rusqlite::Params) -> Result<(), Error> {
        match self.archive.connection().execute(sql, values).map_err(self.storage())? {
            0 => Err(Error::NoSuchRun { path: self.archive.path().to_owned(), run_id }),
            _ => Ok(()),
        }
    }

    /// Begins a transaction, which rolls back when dropped without a commit.
    fn begin(&mut self) -> Result<(PathBuf, Transaction<'_>), Error> {
        let path = self.archive.path().to_owned();
        let transaction = self.archive.connection_mut().transaction();
        let transaction = transaction.map_err(Error::storage(&path))?;
        Ok((path, transaction))
    }

    fn own(&self, key: StrokeKey) -> Result<(), Error> {
        if key.press == self.press {
            return Ok(());
        }
        Err(Error::Contradiction { key, why: format!("this history was opened for press {}", self.press) })
    }

    pub(crate) fn press(&self) -> u16 {
        self.press
    }

    pub(crate) fn storage(&self) -> impl Fn(rusqlite::Error) -> Error + use<'_> {
        Error::storage(self.archive.path())
    }
}

/// Returns the run id of the newest record of a stroke.
fn newest(connection: &Connection, key: StrokeKey) -> rusqlite::Result<Option<u32>> {
    let sql =
        "SELECT max(run_id) FROM stroke WHERE press = ?1 AND session = ?2 AND stroke = ?3 AND attempt = ?4";
    connection.query_row(sql, (key.press, key.session, key.stroke, key.attempt), |row| row.get(0))
}

/// Returns the physical plate of a stroke, inserting it if it is new: the plate with the part number, else the one that
/// has not ended.
fn plate(connection: &Connection, stroke: &Accepted, now: Timestamp) -> rusqlite::Result<u32> {
    let part_id = stroke.part_id.filter(|part_id| *part_id != 0);
    let sql = "SELECT plate FROM plate WHERE press = ?1 AND part_id IS ?2 AND (?2 IS NOT NULL OR ended IS NULL) \
               ORDER BY plate DESC LIMIT 1";
    let known: Option<u32> =
        connection.query_row(sql, (stroke.key.press, part_id), |row| row.get(0)).optional()?;
    if let Some(plate) = known {
        connection.execute("UPDATE plate SET ended = NULL WHERE plate = ?1", [plate])?;
        return Ok(plate);
    }
    let sql = "INSERT INTO plate (press, part_id, part_name, began) VALUES (?1, ?2, ?3, ?4) RETURNING plate";
    let values = (stroke.key.press, part_id, &stroke.part_name, text(now));
    connection.query_row(sql, values, |row| row.get(0))
}

#[cfg(test)]
mod tests {
    use super::{Accepted, History};
    use crate::StrokeKey;

    #[test]
    fn a_full_disk_is_reported_and_harms_no_record() {
        let folder = tempfile::tempdir().unwrap();
        let now = jiff::Timestamp::UNIX_EPOCH;
        let mut history = History::open(&folder.path().join("history.sqlite"), 1, now).unwrap();
        let stroke = |number: u16, data: String| Accepted {
            key: StrokeKey { press: 1, session: 1, stroke: number, attempt: 0 },
            run_id: u32::from(number),
            part_id: None,
            part_name: None,
            recipe: None,
            baseline: false,
            dry_run: false,
            data,
        };
        history.accept(&stroke(1, "{}".to_owned()), now).unwrap();
        // SQLite's own limit on the size of the file raises the same error as a full disk.
        let pages: u32 =
            history.archive.connection().pragma_query_value(None, "page_count", |row| row.get(0)).unwrap();
        history.archive.connection().pragma_update(None, "max_page_count", pages).unwrap();
        let error = history.accept(&stroke(2, "x".repeat(100_000)), now).unwrap_err();
        assert!(error.to_string().ends_with("database or disk is full"), "{error}");
        assert_eq!(history.recall().unwrap().run_id, 1);

        history.archive.connection().pragma_update(None, "max_page_count", pages + 100).unwrap();
        history.accept(&stroke(2, "x".repeat(100_000)), now).unwrap();
        assert_eq!(history.recall().unwrap().run_id, 2);
    }
}
