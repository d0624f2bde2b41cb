//! Why a file could not be taken.

use std::path::PathBuf;

use crate::Faults;

/// Why a file could not be taken.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The file cannot be opened or read.
    #[error("{}: {source}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file says something that cannot be.
    #[error(transparent)]
    Faulty(#[from] Faults),
}
