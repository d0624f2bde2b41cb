//! Backup of a record while its host runs, and its restoration.
//!
//! The copy is one read transaction (`VACUUM INTO`). SQLite's incremental backup restarts with each commit of the
//! writer and would never end while a busy press is served. A copy of the database file without its write-ahead log
//! loses strokes.

use std::path::Path;

use rusqlite::{Connection, OpenFlags};

use crate::{Archive, Error, schema};

impl Archive {
    /// Writes a checked copy of the database to a path that does not exist yet.
    ///
    /// # Errors
    /// [`Error::Storage`] on a full disk, [`Error::Foreign`] when the database is damaged.
    pub fn copy_to(&self, copy: &Path) -> Result<(), Error> {
        schema::copy_checked(self.connection(), self.path(), copy)
    }

    /// Returns the first damage that SQLite finds in the whole database.
    ///
    /// # Errors
    /// [`Error::Storage`].
    pub fn damage(&self) -> Result<Option<String>, Error> {
        schema::damage(self.connection()).map_err(Error::storage(self.path()))
    }
}

/// Makes a restored database a separate record: documents lie where `document` returns, and each press gets another
/// owner number. Run ids after the backup are used again with other content. With the old owner number, a program that
/// identifies strokes by both would take them for known ones. The sequence numbers of results advance by a quarter of
/// their range. Returns the old and the new owner numbers.
///
/// # Errors
/// [`Error::Foreign`], [`Error::Storage`].
pub fn adopt(path: &Path, document: impl Fn(u32) -> String) -> Result<Vec<[u16; 2]>, Error> {
    let storage = Error::storage(path);
    // Opened for reading first: a file that is not a history is refused before anything is written.
    let archive = Archive::open(path)?;
    let runs: Vec<u32> = {
        let mut query = archive
            .connection()
            .prepare("SELECT run_id FROM stroke WHERE document IS NOT NULL")
            .map_err(&storage)?;
        let rows = query.query_map([], |row| row.get(0)).map_err(&storage)?;
        rows.collect::<Result<_, _>>().map_err(&storage)?
    };
    drop(archive);
    let mut connection =
        Connection::open_with_flags(path, OpenFlags::SQLITE_OPEN_READ_WRITE).map_err(&storage)?;
    let transaction = connection.transaction().map_err(&storage)?;
    for run_id in runs {
        transaction
            .execute("UPDATE stroke SET document = ?2 WHERE run_id = ?1", (run_id, document(run_id)))
            .map_err(&storage)?;
    }
    let owners = |connection: &Connection| -> rusqlite::Result<Vec<u16>> {
        let mut query = connection.prepare("SELECT owner FROM journal ORDER BY press")?;
        query.query_map([], |row| row.get(0))?.collect()
    };
    let old = owners(&transaction).map_err(&storage)?;
    // The owner number certainly changes: the old one is advanced by 1 to 65534 of 65535 positions. The press may have
    // seen results after the backup, and would take their sequence numbers for known ones.
    let draw = "UPDATE journal SET owner = (owner - 1 + 1 + abs(random() % 65534)) % 65535 + 1, \
                result_seq = (result_seq + 16384) % 65536";
    transaction.execute(draw, []).map_err(&storage)?;
    let new = owners(&transaction).map_err(&storage)?;
    transaction.commit().map_err(&storage)?;
    Ok(old.into_iter().zip(new).map(|(old, new)| [old, new]).collect())
}
