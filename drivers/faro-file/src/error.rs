//! What can be wrong with a scan file, by who must act.

use std::io;

use platen_scan::orient::OrientError;
use platen_sdk::ErrorKind;

/// Result of reading a scan file.
pub(crate) type Result<T> = std::result::Result<T, Error>;

/// Why a file gives no lattice. In a watched folder the path is added where the error leaves the driver.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Error {
    /// The system would not read the file: the share, or who may read it.
    #[error("{doing}: {source}")]
    Io {
        /// What was tried.
        doing: &'static str,
        /// The system's answer.
        source: io::Error,
    },
    /// The file is shorter than it says: still being written, or cut on the way.
    #[error("{format} file is incomplete: {what}; wait until it is written, or copy it again")]
    Incomplete {
        /// Format.
        format: &'static str,
        /// Found and needed.
        what: String,
    },
    /// A checksum does not fit: copy the file again.
    #[error("{format} file is damaged: {what}; copy it again, or export it again")]
    Damaged {
        /// Format.
        format: &'static str,
        /// Where and what.
        what: String,
    },
    /// The writer's mistake: export otherwise.
    #[error("{format} file is not sound: {what}; export it again, as a structured scan")]
    Unsound {
        /// Format.
        format: &'static str,
        /// Where and what.
        what: String,
    },
    /// A format that is recognised and cannot be read as a lattice.
    #[error("{format}: {instead}")]
    Refused {
        /// What the file is.
        format: String,
        /// Why not, and what to export instead.
        instead: &'static str,
    },
    /// Several scans and no word which.
    #[error("{format} file holds {} scans ({}); choose one with the option cloud = 1 to {}", .scans.len(), .scans.join(", "), .scans.len())]
    Several {
        /// Format.
        format: &'static str,
        /// Name or size of each.
        scans: Vec<String>,
    },
    /// The option names a scan that is not there.
    #[error("{format} file holds {held} scans; there is no cloud {chosen}")]
    NoSuchCloud {
        /// Format.
        format: &'static str,
        /// Number of scans.
        held: usize,
        /// The option, counted from 1.
        chosen: usize,
    },
    /// The scan measured before, under whatever name.
    #[error("the same points as the scan measured before: a copy, not a new scan")]
    Repeated,
    /// More than one scan where one is awaited.
    #[error("{} new scans at once ({}); take all but one away, or let the pattern name the stroke", .names.len(), .names.join(", "))]
    Ambiguous {
        /// File names.
        names: Vec<String>,
    },
    /// The time is over.
    #[error("no scan in time: {why}")]
    TooLate {
        /// What was awaited last.
        why: String,
    },
    /// The cells are no lattice.
    #[error("{0}")]
    Orient(#[from] OrientError),
    /// The host's answer: cancelled, or a frame refused.
    #[error("{0}")]
    Host(#[from] platen_sdk::Error),
}

impl Error {
    /// For `map_err`: the system's answer with what was tried.
    pub(crate) fn io(doing: &'static str) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io { doing, source }
    }

    /// True when the same file may be sound later.
    pub(crate) fn may_pass(&self) -> bool {
        matches!(
            self,
            Self::Io { .. }
                | Self::Incomplete { .. }
                | Self::Damaged { .. }
                | Self::Orient(OrientError::Changed { .. })
        )
    }

    /// Whose turn it is.
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Host(error) => error.kind(),
            Self::Io { source, .. } => match source.kind() {
                io::ErrorKind::NotFound => ErrorKind::NotFound,
                io::ErrorKind::PermissionDenied => ErrorKind::Denied,
                _ => ErrorKind::Io,
            },
            Self::Incomplete { .. } | Self::Repeated => ErrorKind::NoData,
            Self::TooLate { .. } => ErrorKind::Timeout,
            Self::Refused { .. } => ErrorKind::Unsupported,
            Self::Several { .. } | Self::NoSuchCloud { .. } | Self::Ambiguous { .. } => ErrorKind::Config,
            Self::Damaged { .. } | Self::Unsound { .. } | Self::Orient(_) => ErrorKind::BadData,
        }
    }

    fn crossing(self, message: String) -> platen_sdk::Error {
        if let Self::Host(error) = self {
            return error;
        }
        let error = platen_sdk::Error::new(self.kind(), message);
        if self.may_pass() { error.retryable() } else { error }
    }

    /// The error as it crosses the boundary.
    pub(crate) fn into_sdk(self) -> platen_sdk::Error {
        let message = self.to_string();
        self.crossing(message)
    }

    /// The error as it crosses the boundary, with the place where it arose.
    pub(crate) fn at(self, path: &std::path::Path) -> platen_sdk::Error {
        let message = format!("{}: {self}", path.display());
        self.crossing(message)
    }
}
