//! Cursors of the sinks: the last change that each sink has, in `forward.sqlite` beside the record.
//!
//! A cursor moves only when its sink has acknowledged a change. Losing the file means that changes are sent again,
//! which changes nothing at the sinks. A record that was restored from a backup has other changes after the backup than
//! it had before it was lost. A cursor that belongs to the former owner number is therefore set back to the beginning
//! of the new one.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use platen_history::Owner;
use rusqlite::{Connection, OptionalExtension as _};

/// Table of this file; written by this module alone.
const SCHEMA: &str = "
    CREATE TABLE IF NOT EXISTS cursor (sink TEXT PRIMARY KEY, owner INTEGER NOT NULL, n INTEGER NOT NULL) STRICT;
    CREATE TABLE IF NOT EXISTS refused (sink TEXT NOT NULL, owner INTEGER NOT NULL, n INTEGER NOT NULL, why TEXT NOT NULL, PRIMARY KEY (sink, owner, n)) STRICT;
    CREATE TABLE IF NOT EXISTS birth (sink TEXT PRIMARY KEY, bd_seq INTEGER NOT NULL) STRICT;";

/// Failure of the file of cursors.
#[derive(Debug, thiserror::Error)]
#[error("{}: {why}", path.display())]
pub struct CursorError {
    /// The file.
    pub path: PathBuf,
    /// Reason, with the action to take.
    pub why: String,
}

/// Cursors of one host's sinks, open in one process at a time.
#[derive(Debug)]
pub(crate) struct Cursors {
    connection: Connection,
    path: PathBuf,
}

impl Cursors {
    /// Opens the file, and creates it if there is none.
    ///
    /// # Errors
    /// [`CursorError`], also while another process has the file open.
    pub(crate) fn open(path: &Path) -> Result<Self, CursorError> {
        let error = |e: rusqlite::Error| CursorError { path: path.to_owned(), why: sentence(&e) };
        let connection = Connection::open(path).map_err(error)?;
        // The lock is kept until the process ends, in whatever way. A write-ahead log with NORMAL syncs no commit: a
        // power cut loses the last moves of a cursor, and the disk remains free for the host's record.
        let setup = format!(
            "PRAGMA locking_mode = EXCLUSIVE; PRAGMA journal_mode = WAL; PRAGMA synchronous = NORMAL; BEGIN EXCLUSIVE; {SCHEMA} COMMIT;"
        );
        connection.execute_batch(&setup).map_err(error)?;
        Ok(Self { connection, path: path.to_owned() })
    }

    /// Returns the number of the last change that a sink has, of a record with these owner numbers; 0 for a new sink.
    ///
    /// # Errors
    /// [`CursorError`].
    pub(crate) fn of(&self, sink: &str, owners: &[Owner]) -> Result<u64, CursorError> {
        let sql = "SELECT owner, n FROM cursor WHERE sink = ?1";
        let stored =
            self.connection.query_row(sql, [sink], |row| Ok((row.get::<_, u16>(0)?, row.get::<_, i64>(1)?)));
        let Some((owner, n)) = stored.optional().map_err(|e| self.error(&e))? else { return Ok(0) };
        Ok(resumed(owner, n.unsigned_abs(), owners))
    }

    /// Sets the cursor of a sink.
    ///
    /// # Errors
    /// [`CursorError`].
    pub(crate) fn set(&self, sink: &str, owner: u16, n: u64) -> Result<(), CursorError> {
        let sql = "INSERT INTO cursor VALUES (?1, ?2, ?3) ON CONFLICT (sink) DO UPDATE SET owner = excluded.owner, n = excluded.n";
        self.run(sql, (sink, owner, signed(n)))
    }

    /// Records a change that a sink refused for its content.
    ///
    /// # Errors
    /// [`CursorError`].
    pub(crate) fn refuse(&self, sink: &str, owner: u16, n: u64, why: &str) -> Result<(), CursorError> {
        self.run("INSERT OR REPLACE INTO refused VALUES (?1, ?2, ?3, ?4)", (sink, owner, signed(n), why))
    }

    /// Returns the number of changes that a sink has refused.
    ///
    /// # Errors
    /// [`CursorError`].
    pub(crate) fn refused(&self, sink: &str) -> Result<u64, CursorError> {
        let sql = "SELECT count(*) FROM refused WHERE sink = ?1";
        let count = self.connection.query_row(sql, [sink], |row| row.get::<_, i64>(0));
        count.map(i64::unsigned_abs).map_err(|e| self.error(&e))
    }

    /// Returns the next number of a birth and death pair of Sparkplug, 0 to 255, never that of the previous session.
    ///
    /// # Errors
    /// [`CursorError`].
    pub(crate) fn next_birth(&self, sink: &str) -> Result<u8, CursorError> {
        let sql = "INSERT INTO birth VALUES (?1, 0) ON CONFLICT (sink) DO UPDATE SET bd_seq = (bd_seq + 1) % 256 RETURNING bd_seq";
        self.connection.query_row(sql, [sink], |row| row.get(0)).map_err(|e| self.error(&e))
    }

    fn run(&self, sql: &str, values: impl rusqlite::Params) -> Result<(), CursorError> {
        let done = self.connection.prepare_cached(sql).and_then(|mut statement| statement.execute(values));
        done.map(drop).map_err(|e| self.error(&e))
    }

    fn error(&self, error: &rusqlite::Error) -> CursorError {
        CursorError { path: self.path.clone(), why: sentence(error) }
    }
}

/// Cursors that several tasks use.
#[derive(Debug, Clone)]
pub(crate) struct SharedCursors(Arc<Mutex<Cursors>>);

impl SharedCursors {
    pub(crate) fn open(path: &Path) -> Result<Self, CursorError> {
        Ok(Self(Arc::new(Mutex::new(Cursors::open(path)?))))
    }

    pub(crate) fn lock(&self) -> MutexGuard<'_, Cursors> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Returns the change at which a cursor continues in a record with these owner numbers.
fn resumed(owner: u16, n: u64, owners: &[Owner]) -> u64 {
    match owners.iter().position(|it| it.owner == owner) {
        // Changes up to the next owner number are those that the cursor has counted; later ones are different changes.
        Some(k) => owners.get(k + 1).map_or(n, |next| n.min(next.after_change)),
        // The cursor belongs to another record.
        None => 0,
    }
}

fn sentence(error: &rusqlite::Error) -> String {
    match error.sqlite_error_code() {
        Some(rusqlite::ErrorCode::DatabaseBusy) => {
            "another platen forward has it; stop that one first".to_owned()
        }
        Some(rusqlite::ErrorCode::NotADatabase) => {
            "is damaged; remove it, and every stroke is sent again, which changes nothing at the sinks"
                .to_owned()
        }
        _ => format!("{error}; make room on the disk or repair it"),
    }
}

fn signed(n: u64) -> i64 {
    i64::try_from(n).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cursor_survives_and_one_process_has_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("forward.sqlite");
        let owners = [Owner { owner: 7, after_change: 0 }];
        let cursors = Cursors::open(&path).unwrap();
        assert_eq!(cursors.of("historian", &owners).unwrap(), 0);
        cursors.set("historian", 7, 41).unwrap();
        assert!(Cursors::open(&path).unwrap_err().to_string().contains("another platen forward has it"));
        drop(cursors);
        let cursors = Cursors::open(&path).unwrap();
        assert_eq!(cursors.of("historian", &owners).unwrap(), 41);
        assert_eq!(cursors.of("broker", &owners).unwrap(), 0);
        assert_eq!([0, 1, 2].map(|_| cursors.next_birth("scada").unwrap()), [0, 1, 2]);
    }

    #[test]
    fn a_restored_record_is_sent_from_where_it_parted() {
        let owners = [Owner { owner: 7, after_change: 0 }, Owner { owner: 9, after_change: 30 }];
        assert_eq!(
            resumed(7, 41, &owners),
            30,
            "changes 31 to 41 of owner 7 are lost; those of owner 9 are new"
        );
        assert_eq!(resumed(7, 20, &owners), 20, "it had not got that far");
        assert_eq!(resumed(9, 41, &owners), 41);
        assert_eq!(resumed(5, 41, &owners), 0, "a cursor of another record");
    }
}
