//! Errors of reading, by who must act.

use std::io;

use crate::orient::OrientError;

/// Result of reading a scan file.
pub(crate) type Result<T> = std::result::Result<T, ReadError>;

/// Reason why a file gives no lattice. The caller adds the path.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the message of a variant names its fields")]
pub enum ReadError {
    /// The operating system refuses: share, permissions, or the caller cancelled.
    #[error("{doing}: {source}")]
    Io { doing: &'static str, source: io::Error },
    /// The file is shorter than it declares, still being written or cut in transfer: format, found and required.
    #[error("{0} file is incomplete: {1}; wait until it is written, or copy it again")]
    Incomplete(&'static str, String),
    /// A checksum does not match, the file must be copied again: format, place.
    #[error("{0} file is damaged: {1}; copy it again, or export it again")]
    Damaged(&'static str, String),
    /// The content violates the format, the scan must be exported again: format, place and fault.
    #[error("{0} file is not sound: {1}; export it again, as a structured scan")]
    Unsound(&'static str, String),
    /// The format is recognised and contains no readable lattice: its name, and the reason or the format to export
    /// instead.
    #[error("{0}: {1}")]
    Refused(String, &'static str),
    /// The file contains several scans and none was chosen: format, name or size of each scan.
    #[error("{0} file holds {held} scans ({scans}); choose one with the option cloud = 1 to {held}", held = .1.len(), scans = .1.join(", "))]
    Several(&'static str, Vec<String>),
    /// The chosen scan does not exist: format, number of scans, number chosen from 1.
    #[error("{0} file holds {1} scans; there is no cloud {2}")]
    NoSuchCloud(&'static str, usize, usize),
    /// The cells do not form a lattice.
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
                | Self::Incomplete(..)
                | Self::Damaged(..)
                | Self::Orient(OrientError::Changed { .. })
        )
    }
}
