//! Why something could not be remembered or found.

use std::path::{Path, PathBuf};

use crate::StrokeKey;

/// Why something could not be remembered or found.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Another process writes this history.
    #[error("{}: in use by {holder}; one history belongs to one host, stop that one first", path.display())]
    InUse {
        /// The database.
        path: PathBuf,
        /// Program, process id and start of the other process, as it says itself.
        holder: String,
    },
    /// The file or its folder cannot be opened.
    #[error("{}: {source}", path.display())]
    Unreachable {
        /// The database or its lock.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// SQLite failed: disk full, disk fault, no such table.
    #[error("{}: {source}", path.display())]
    Storage {
        /// The database.
        path: PathBuf,
        /// What SQLite says.
        source: rusqlite::Error,
    },
    /// The file is no history, or one that a newer program wrote.
    #[error("{}: {why}", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What it is instead.
        why: String,
    },
    /// A step does not follow from what is on record: a fault of the caller, refused before it can do harm.
    #[error("{key}: {why}")]
    Contradiction {
        /// The stroke.
        key: StrokeKey,
        /// What does not fit.
        why: String,
    },
    /// Nothing is on record under this number.
    #[error("{}: no stroke has the run id {run_id}; `platen history list` shows them", path.display())]
    NoSuchRun {
        /// The database.
        path: PathBuf,
        /// The number asked for.
        run_id: u32,
    },
    /// A row holds what this program never writes.
    #[error("{}: run {run_id}: {why}; the file was changed by other means", path.display())]
    Damaged {
        /// The database.
        path: PathBuf,
        /// The row.
        run_id: u32,
        /// What is wrong with it.
        why: String,
    },
    /// An export could not be written.
    #[error("the export cannot be written: {0}")]
    Export(#[from] std::io::Error),
    /// An export could not be written as Parquet.
    #[error("the export cannot be written: {0}; write CSV instead, and report this")]
    Parquet(#[from] parquet::errors::ParquetError),
}

impl Error {
    /// Turns SQLite's error into ours.
    pub(crate) fn storage(path: &Path) -> impl Fn(rusqlite::Error) -> Self + use<'_> {
        move |source| Self::Storage { path: path.to_owned(), source }
    }

    /// Whether the disk is full: results still go to the press, marked as not recorded.
    pub fn is_disk_full(&self) -> bool {
        let full = Some(rusqlite::ErrorCode::DiskFull);
        matches!(self, Self::Storage { source, .. } if source.sqlite_error_code() == full)
    }
}
