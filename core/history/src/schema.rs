//! Opening of the database: a new one is created, a foreign file is refused.

use std::path::{Path, PathBuf};
use std::time::Duration;

use rusqlite::{Connection, OpenFlags};

use crate::Error;

/// Marks a SQLite file as a history of platen: "pltn".
const APPLICATION_ID: i32 = 0x706c_746e;
/// Format of the first release, which had another numbering.
const FIRST: i32 = 1;
/// Format that this program writes: 100 x major + minor.
const VERSION: i32 = 101;
/// Steps from one minor format to the next; an empty database receives all of them.
const STEPS: [&str; 2] = [include_str!("schema.sql"), include_str!("schema-1.1.sql")];

/// Longest wait for a reader's checkpoint; in write-ahead mode the writer itself never waits.
const BUSY: Duration = Duration::from_secs(5);

/// Opens the database for writing, and creates it if it is new. The caller holds the lock.
pub(crate) fn open_writer(path: &Path) -> Result<Connection, Error> {
    let storage = Error::storage(path);
    let mut connection = Connection::open(path).map_err(&storage)?;
    connection.busy_timeout(BUSY).map_err(&storage)?;
    if is_empty(&connection, path)? {
        create(&mut connection).map_err(&storage)?;
    }
    let format = check(&connection, path)?;
    if format < VERSION {
        extend(&mut connection, path, format)?;
    }
    connection
        .execute_batch("PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL; PRAGMA foreign_keys = ON;")
        .map_err(&storage)?;
    Ok(connection)
}

/// Opens the database for reading, with or without a writer. An unfinished transaction of a dead process is rolled back
/// first.
pub(crate) fn open_reader(path: &Path) -> Result<Connection, Error> {
    std::fs::metadata(path).map_err(|source| Error::Unreachable { path: path.to_owned(), source })?;
    match read_only(path) {
        Err(Error::Storage { source, .. }) if needs_rollback(&source) => {
            roll_back(path).map_err(Error::storage(path))?;
            read_only(path)
        }
        opened => opened,
    }
}

fn read_only(path: &Path) -> Result<Connection, Error> {
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let connection = Connection::open_with_flags(path, flags).map_err(Error::storage(path))?;
    connection.busy_timeout(BUSY).map_err(Error::storage(path))?;
    check(&connection, path)?;
    Ok(connection)
}

/// Returns whether a rollback journal lies beside the database; a read-only connection may not apply it.
fn needs_rollback(error: &rusqlite::Error) -> bool {
    error.sqlite_error().is_some_and(|error| error.extended_code == rusqlite::ffi::SQLITE_READONLY_ROLLBACK)
}

/// Applies the rollback journal. SQLite does so before the first read of a connection that may write, unless a living
/// process holds it.
fn roll_back(path: &Path) -> rusqlite::Result<()> {
    let connection = Connection::open_with_flags(path, OpenFlags::SQLITE_OPEN_READ_WRITE)?;
    connection.busy_timeout(BUSY)?;
    connection.query_row("SELECT count(*) FROM sqlite_schema", [], |_| Ok(()))
}

/// Creates all tables and both marks in one transaction. A process that dies here leaves an empty file, which the next
/// one fills.
fn create(connection: &mut Connection) -> rusqlite::Result<()> {
    let transaction = connection.transaction()?;
    for step in STEPS {
        transaction.execute_batch(step)?;
    }
    transaction.pragma_update(None, "application_id", APPLICATION_ID)?;
    transaction.pragma_update(None, "user_version", VERSION)?;
    transaction.commit()
}

/// Extends an older minor format: first a checked copy beside the database, then one transaction. If the process dies
/// here, the older format remains and the next process starts again. Existing rows and columns are not changed.
fn extend(connection: &mut Connection, path: &Path, from: i32) -> Result<(), Error> {
    let storage = Error::storage(path);
    let copy = copy_path(path, from);
    copy_checked(connection, path, &copy)?;
    let transaction = connection.transaction().map_err(&storage)?;
    for step in &STEPS[usize::try_from(from % 100 + 1).unwrap_or(STEPS.len()).min(STEPS.len())..] {
        transaction.execute_batch(step).map_err(&storage)?;
    }
    transaction.pragma_update(None, "user_version", VERSION).map_err(&storage)?;
    transaction.commit().map_err(&storage)
}

/// Returns the path of the copy that is made before a format is extended: `history.sqlite.1.0`.
fn copy_path(path: &Path, format: i32) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(format!(".{}", words(format)));
    PathBuf::from(name)
}

/// Copies a database in one read transaction, with or without a writer, and checks the copy. An incomplete copy never
/// has the final name.
pub(crate) fn copy_checked(connection: &Connection, path: &Path, copy: &Path) -> Result<(), Error> {
    let storage = Error::storage(copy);
    let mut part = copy.as_os_str().to_owned();
    part.push(".part");
    let part = PathBuf::from(part);
    let unreachable = |source| Error::Unreachable { path: part.clone(), source };
    if part.exists() {
        std::fs::remove_file(&part).map_err(unreachable)?;
    }
    connection.execute("VACUUM INTO ?1", [part.to_string_lossy()]).map_err(&storage)?;
    let found = damage(&Connection::open(&part).map_err(&storage)?).map_err(&storage)?;
    if let Some(found) = found {
        return Err(Error::Foreign {
            path: path.to_owned(),
            why: format!("is damaged: {found}; restore it from a backup (`platen history restore`)"),
        });
    }
    std::fs::File::open(&part).and_then(|file| file.sync_all()).map_err(unreachable)?;
    std::fs::rename(&part, copy).map_err(unreachable)
}

/// Returns the first damage that SQLite finds in a database.
pub(crate) fn damage(connection: &Connection) -> rusqlite::Result<Option<String>> {
    let found: String = connection.query_row("PRAGMA integrity_check(1)", [], |row| row.get(0))?;
    Ok((found != "ok").then_some(found))
}

/// Returns a format as text: 1.1.
pub(crate) fn words(format: i32) -> String {
    format!("{}.{}", format / 100, format % 100)
}

fn is_empty(connection: &Connection, path: &Path) -> Result<bool, Error> {
    let tables = "SELECT count(*) = 0 FROM sqlite_schema";
    connection.query_row(tables, [], |row| row.get(0)).map_err(|source| refuse(path, source))
}

/// Returns the format of a history. Any format of the same major number can be read and written, since later minor ones
/// only add to it.
fn check(connection: &Connection, path: &Path) -> Result<i32, Error> {
    let pragma = |name: &str| -> Result<i32, Error> {
        connection.pragma_query_value(None, name, |row| row.get(0)).map_err(|source| refuse(path, source))
    };
    let foreign = |why: String| Err(Error::Foreign { path: path.to_owned(), why });
    if pragma("application_id")? != APPLICATION_ID {
        return foreign("is a database, but not a history of platen; name another file".to_owned());
    }
    match pragma("user_version")? {
        FIRST => Ok(100),
        format if format / 100 == VERSION / 100 => Ok(format),
        other => foreign(format!(
            "has format {}, this program reads format {}; use the program that wrote it",
            words(other),
            words(VERSION)
        )),
    }
}

fn refuse(path: &Path, source: rusqlite::Error) -> Error {
    match source.sqlite_error_code() {
        Some(rusqlite::ErrorCode::NotADatabase) => {
            Error::Foreign { path: path.to_owned(), why: "is not a database; name another file".to_owned() }
        }
        _ => Error::Storage { path: path.to_owned(), source },
    }
}

#[cfg(test)]
mod tests {
    use super::open_writer;

    #[test]
    fn every_commit_of_the_writer_is_flushed_to_the_disk() {
        let folder = tempfile::tempdir().unwrap();
        let connection = open_writer(&folder.path().join("history.sqlite")).unwrap();
        let mode: String = connection.pragma_query_value(None, "journal_mode", |row| row.get(0)).unwrap();
        let level: u8 = connection.pragma_query_value(None, "synchronous", |row| row.get(0)).unwrap();
        assert_eq!((mode.as_str(), level), ("wal", 2), "2 is FULL");
    }
}
