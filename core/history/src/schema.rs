//! Opening of the database: created when new, refused when it is anything else.

use std::path::Path;
use std::time::Duration;

use rusqlite::{Connection, OpenFlags};

use crate::Error;

/// Marks a SQLite file as a history of platen: "pltn".
const APPLICATION_ID: i32 = 0x706c_746e;
/// Version of the tables in `schema.sql`.
const VERSION: i32 = 1;
/// Longest wait for a reader's checkpoint; in write-ahead mode the writer itself never waits.
const BUSY: Duration = Duration::from_secs(5);

/// Opens the database for writing and creates it when it is new. The caller holds the lock.
pub(crate) fn open_writer(path: &Path) -> Result<Connection, Error> {
    let storage = Error::storage(path);
    let mut connection = Connection::open(path).map_err(&storage)?;
    connection.busy_timeout(BUSY).map_err(&storage)?;
    if is_empty(&connection, path)? {
        create(&mut connection).map_err(&storage)?;
    }
    check(&connection, path)?;
    connection
        .execute_batch("PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL; PRAGMA foreign_keys = ON;")
        .map_err(&storage)?;
    Ok(connection)
}

/// Opens the database for reading, beside a writer or not.
pub(crate) fn open_reader(path: &Path) -> Result<Connection, Error> {
    std::fs::metadata(path).map_err(|source| Error::Unreachable { path: path.to_owned(), source })?;
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let connection = Connection::open_with_flags(path, flags).map_err(Error::storage(path))?;
    connection.busy_timeout(BUSY).map_err(Error::storage(path))?;
    check(&connection, path)?;
    Ok(connection)
}

/// Creates all tables and both marks in one transaction: a process that dies here leaves an empty file, which the next one
/// fills.
fn create(connection: &mut Connection) -> rusqlite::Result<()> {
    let transaction = connection.transaction()?;
    transaction.execute_batch(include_str!("schema.sql"))?;
    transaction.pragma_update(None, "application_id", APPLICATION_ID)?;
    transaction.pragma_update(None, "user_version", VERSION)?;
    transaction.commit()
}

fn is_empty(connection: &Connection, path: &Path) -> Result<bool, Error> {
    let tables = "SELECT count(*) = 0 FROM sqlite_schema";
    connection.query_row(tables, [], |row| row.get(0)).map_err(|source| refuse(path, source))
}

fn check(connection: &Connection, path: &Path) -> Result<(), Error> {
    let pragma = |name: &str| -> Result<i32, Error> {
        connection.pragma_query_value(None, name, |row| row.get(0)).map_err(|source| refuse(path, source))
    };
    let foreign = |why: String| Err(Error::Foreign { path: path.to_owned(), why });
    if pragma("application_id")? != APPLICATION_ID {
        return foreign("is a database, but not a history of platen; name another file".to_owned());
    }
    match pragma("user_version")? {
        VERSION => Ok(()),
        other => foreign(format!(
            "has format {other}, this program reads format {VERSION}; use the program that wrote it"
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
