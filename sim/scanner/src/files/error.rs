//! Why a file was not written.

use std::path::PathBuf;

/// An error with the file's name.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The system refuses.
    #[error("{path}: cannot be written: {source}")]
    Io {
        /// File.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The E57 library refuses.
    #[error("{path}: cannot be written: {source}")]
    E57 {
        /// File.
        path: PathBuf,
        /// What the library says.
        source: ::e57::Error,
    },
}
