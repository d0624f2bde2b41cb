//! Errors of writing scan files.

use std::path::PathBuf;

/// Error of writing a file, with its path.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// Error of the operating system.
    #[error("{path}: cannot be written: {source}")]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// Error of the E57 library.
    #[error("{path}: cannot be written: {source}")]
    E57 {
        /// Path of the file.
        path: PathBuf,
        /// Error of the library.
        source: ::e57::Error,
    },
}
