//! Errors of the driver, by the person who must act.

use platen_sdk::ErrorKind;
use std::path::PathBuf;

/// Error of the driver.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Error {
    /// Invalid or contradictory options.
    #[error("{0}")]
    Options(String),
    /// Simulated press not reachable.
    #[error("simulated press at {address}: {source}")]
    Cell { address: String, source: std::io::Error },
    /// Invalid answer of the press.
    #[error("simulated press at {address} answered `{line}`: {source}")]
    Answer { address: String, line: String, source: serde_json::Error },
    /// Plate moving: no state available now.
    #[error("simulated press at {address}: {reason}")]
    Busy { address: String, reason: String },
    /// Description file that cannot be read.
    #[error("{path}: {source}")]
    File { path: PathBuf, source: std::io::Error },
    /// Ground truth that cannot be written.
    #[error("{path}: cannot be written: {source}")]
    Truth { path: PathBuf, source: std::io::Error },
    /// Invalid description file.
    #[error("{path}: {message}")]
    Description { path: PathBuf, message: String },
    /// Description of an impossible plate.
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
