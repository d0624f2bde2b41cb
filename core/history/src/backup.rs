//! Backup of a record while its host runs, and its restoration.
//!
//! The copy is one read transaction (`VACUUM INTO`): SQLite's backup in steps starts again with each commit of the writer and would never
//! end beside a busy press. A copy of the database file without its write-ahead log loses strokes.

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

/// Makes a restored database a record of its own: documents lie where `document` says, and each press gets another owner number. Run ids
/// after the backup come again with other content; with the old number, whoever takes up strokes by it would take them for known ones. Sequence numbers of results move on by a quarter turn.
/// Returns the old and the new numbers.
///
/// # Errors
/// [`Error::Foreign`], [`Error::Storage`].
pub fn adopt(path: &Path, document: impl Fn(u32) -> String) -> Result<Vec<[u16; 2]>, Error> {
    let storage = Error::storage(path);
    // Opened as a reader first: a file that is none of ours is refused before anything is written.
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
    // Another number for certain: the old one moved on by 1 to 65534 places of 65535.
    // The press may have seen results after the backup: theirs are the sequence numbers that it would take for known.
    let draw = "UPDATE journal SET owner = (owner - 1 + 1 + abs(random() % 65534)) % 65535 + 1, \
                result_seq = (result_seq + 16384) % 65536";
    transaction.execute(draw, []).map_err(&storage)?;
    let new = owners(&transaction).map_err(&storage)?;
    transaction.commit().map_err(&storage)?;
    Ok(old.into_iter().zip(new).map(|(old, new)| [old, new]).collect())
}
