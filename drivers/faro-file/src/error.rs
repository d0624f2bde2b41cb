//! Errors of the driver, by the person who must act.

use std::io;

use platen_formats::ReadError;
use platen_sdk::ErrorKind;

/// Result of the driver's functions.
pub(crate) type Result<T> = std::result::Result<T, Error>;

/// Reason why no scan was delivered. In a watched folder the path is added when the error leaves the driver.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Error {
    /// The file gives no lattice.
    #[error("{0}")]
    File(#[from] ReadError),
    /// The operating system does not list the watched folder.
    #[error("listing the watched folder: {0}")]
    Folder(io::Error),
    /// Same cells as the previous scan, under any name.
    #[error("the same points as the scan measured before: a copy, not a new scan")]
    Repeated,
    /// Several new scans where one is expected.
    #[error("{} new scans at once ({}); take all but one away, or let the pattern name the stroke", .0.len(), .0.join(", "))]
    Ambiguous(Vec<String>),
    /// The deadline was reached; the text is the latest reason to wait.
    #[error("no scan in time: {0}")]
    TooLate(String),
    /// The host cancelled the job or refused a frame.
    #[error("{0}")]
    Host(#[from] platen_sdk::Error),
}

impl Error {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Host(error) => error.kind(),
            Self::File(ReadError::Io { source, .. }) | Self::Folder(source) => match source.kind() {
                io::ErrorKind::NotFound => ErrorKind::NotFound,
                io::ErrorKind::PermissionDenied => ErrorKind::Denied,
                _ => ErrorKind::Io,
            },
            Self::File(ReadError::Incomplete(..)) | Self::Repeated => ErrorKind::NoData,
            Self::TooLate(_) => ErrorKind::Timeout,
            Self::File(ReadError::Refused(..)) => ErrorKind::Unsupported,
            Self::File(ReadError::Several(..) | ReadError::NoSuchCloud(..)) | Self::Ambiguous(_) => {
                ErrorKind::Config
            }
            Self::File(_) => ErrorKind::BadData,
        }
    }

    fn crossing(self, message: String) -> platen_sdk::Error {
        let transient = match &self {
            Self::File(error) => error.is_transient(),
            Self::Folder(_) => true,
            _ => false,
        };
        match self {
            Self::Host(error) => error,
            error if transient => platen_sdk::Error::new(error.kind(), message).retryable(),
            error => platen_sdk::Error::new(error.kind(), message),
        }
    }

    /// Returns the error in the form of the plugin boundary.
    pub(crate) fn into_sdk(self) -> platen_sdk::Error {
        let message = self.to_string();
        self.crossing(message)
    }

    /// Returns the error in the form of the plugin boundary, with the path where it occurred.
    pub(crate) fn at(self, path: &std::path::Path) -> platen_sdk::Error {
        let message = format!("{}: {self}", path.display());
        self.crossing(message)
    }
}
