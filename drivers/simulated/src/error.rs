//! What can keep a simulated plate from being scanned.

use platen_sdk::ErrorKind;
use std::path::PathBuf;

/// An error by who must act.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Error {
    /// Options that contradict each other.
    #[error("{0}")]
    Options(String),
    /// The simulated press is not there.
    #[error("simulated press at {address}: {source}")]
    Cell { address: String, source: std::io::Error },
    /// It does not speak as agreed.
    #[error("simulated press at {address} answered `{line}`: {source}")]
    Answer { address: String, line: String, source: serde_json::Error },
    /// It has no plate to show now.
    #[error("simulated press at {address}: {reason}")]
    Busy { address: String, reason: String },
    /// The description file cannot be read.
    #[error("{path}: {source}")]
    File { path: PathBuf, source: std::io::Error },
    /// The truth cannot be written.
    #[error("{path}: cannot be written: {source}")]
    Truth { path: PathBuf, source: std::io::Error },
    /// The description file is wrong.
    #[error("{path}: {message}")]
    Description { path: PathBuf, message: String },
    /// The plate cannot be built.
    #[error(transparent)]
    Plate(#[from] platen_sim_plate::PlateError),
}

impl From<Error> for platen_sdk::Error {
    fn from(error: Error) -> Self {
        let message = error.to_string();
        match error {
            Error::Options(_) => Self::new(ErrorKind::Config, message),
            Error::Cell { .. } => Self::new(ErrorKind::Disconnected, message)
                .hint("start `platen-sim cell`, or set the option cell to the address it prints as `plate`")
                .retryable(),
            Error::Answer { .. } => Self::new(ErrorKind::BadData, message).hint(
                "set the option cell to the address that `platen-sim` prints as `plate`, not as `modbus`",
            ),
            Error::Busy { .. } => {
                Self::new(ErrorKind::Busy, message).hint("scan again when the plate is at rest").retryable()
            }
            Error::File { .. } => Self::new(ErrorKind::NotFound, message).hint("set the option plate_file"),
            Error::Truth { .. } => Self::new(ErrorKind::NotFound, message)
                .hint("set the option truth_file to a file in a folder that exists"),
            Error::Description { .. } | Error::Plate(_) => {
                Self::new(ErrorKind::Config, message).hint("correct the description of the plate")
            }
        }
    }
}
