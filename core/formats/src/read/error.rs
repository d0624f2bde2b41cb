//! Errors of reading, by who must act.

use std::io;

use crate::orient::OrientError;

/// Result of reading a scan file.
pub(crate) type Result<T> = std::result::Result<T, ReadError>;

/// Reason why a file gives no lattice. The caller adds the path.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The operating system refuses: share, permissions, or the caller cancelled.
    #[error("{doing}: {source}")]
    Io {
        /// Operation tried.
        doing: &'static str,
        /// Reason of the operating system.
        source: io::Error,
    },
    /// The file is shorter than it declares: still being written, or cut in transfer.
    #[error("{format} file is incomplete: {what}; wait until it is written, or copy it again")]
    Incomplete {
        /// Format.
        format: &'static str,
        /// Amount found and amount required.
        what: String,
    },
    /// A checksum does not match: the file must be copied again.
    #[error("{format} file is damaged: {what}; copy it again, or export it again")]
    Damaged {
        /// Format.
        format: &'static str,
        /// Place and checksum.
        what: String,
    },
    /// The content violates the format: the scan must be exported again.
    #[error("{format} file is not sound: {what}; export it again, as a structured scan")]
    Unsound {
        /// Format.
        format: &'static str,
        /// Place and fault.
        what: String,
    },
    /// The format is recognised and holds no readable lattice.
    #[error("{format}: {instead}")]
    Refused {
        /// Format found.
        format: String,
        /// Reason, or the format to export instead.
        instead: &'static str,
    },
    /// The file holds several scans and none was chosen.
    #[error("{format} file holds {} scans ({}); choose one with the option cloud = 1 to {}", .scans.len(), .scans.join(", "), .scans.len())]
    Several {
        /// Format.
        format: &'static str,
        /// Name or size of each scan.
        scans: Vec<String>,
    },
    /// The chosen scan does not exist.
    #[error("{format} file holds {held} scans; there is no cloud {chosen}")]
    NoSuchCloud {
        /// Format.
        format: &'static str,
        /// Number of scans.
        held: usize,
        /// Number chosen, from 1.
        chosen: usize,
    },
    /// The cells are no lattice.
    #[error("{0}")]
    Orient(#[from] OrientError),
}

impl ReadError {
    /// Returns a closure for `map_err` that adds the operation tried.
    pub(crate) fn io(doing: &'static str) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io { doing, source }
    }

    /// Returns whether the same file may be readable later, without a new export.
    pub fn is_transient(&self) -> bool {
        matches!(
            self,
            Self::Io { .. }
                | Self::Incomplete { .. }
                | Self::Damaged { .. }
                | Self::Orient(OrientError::Changed { .. })
        )
    }
}
