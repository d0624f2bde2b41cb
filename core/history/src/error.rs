//! Errors of recording, querying and exporting.

use std::path::{Path, PathBuf};

use crate::StrokeKey;

/// Errors of recording, querying and exporting.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the message of a variant names its fields")]
pub enum Error {
    /// Another process has the history open for writing.
    #[error("{}: in use by {holder}; one history belongs to one host, stop that one first", path.display())]
    InUse {
        path: PathBuf,
        /// Program, process id and start of the other process, from its lock file.
        holder: String,
    },
    /// The file or its folder cannot be opened.
    #[error("{}: {source}", path.display())]
    Unreachable { path: PathBuf, source: std::io::Error },
    /// SQLite failed: disk full, disk fault, no such table.
    #[error("{}: {source}", path.display())]
    Storage { path: PathBuf, source: rusqlite::Error },
    /// The file is not a history, or has the format of a newer program.
    #[error("{}: {why}", path.display())]
    Foreign { path: PathBuf, why: String },
    /// A step does not follow from the recorded steps: a fault of the caller. Nothing was changed.
    #[error("{key}: {why}")]
    Contradiction { key: StrokeKey, why: String },
    /// No record has this number.
    #[error("{}: no stroke has the run id {run_id}; `platen history list` shows them", path.display())]
    NoSuchRun { path: PathBuf, run_id: u32 },
    /// A row contains a value that this program never writes.
    #[error("{}: run {run_id}: {why}; the file was changed by other means", path.display())]
    Damaged { path: PathBuf, run_id: u32, why: String },
    /// An export could not be written.
    #[error("the export cannot be written: {0}")]
    Export(#[from] std::io::Error),
    /// An export could not be written as Parquet.
    #[error("the export cannot be written: {0}; write CSV instead, and report this")]
    Parquet(#[from] parquet::errors::ParquetError),
}

impl Error {
    /// Returns a converter of SQLite's errors to [`Error::Storage`].
    pub(crate) fn storage(path: &Path) -> impl Fn(rusqlite::Error) -> Self + use<'_> {
        move |source| Self::Storage { path: path.to_owned(), source }
    }
}
