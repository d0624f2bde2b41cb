//! Errors of the program, by the person who must act.

use std::path::PathBuf;

/// Error of the program, by who must act.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Error {
    /// File that cannot be read.
    #[error("{path}: {source}")]
    Read { path: PathBuf, source: std::io::Error },
    /// Invalid file.
    #[error("{path}:{line}: {message}")]
    Config { path: PathBuf, line: usize, message: String },
    /// Description of an impossible plate.
    #[error("{path}: {source}")]
    Plate { path: PathBuf, source: platen_sim_plate::PlateError },
    /// File name with an unknown extension.
    #[error("{path}: unknown extension; write .e57, .ptx, .xyz or .xyb")]
    Format { path: PathBuf },
    /// Error of the press.
    #[error(transparent)]
    Press(#[from] platen_sim_press::Error),
    /// Error of the control port.
    #[error("press at {address}: {what}")]
    Control { address: String, what: String },
    /// Scan that cannot be written.
    #[error(transparent)]
    File(#[from] platen_sim_scanner::FileError),
    /// Error of the operating system: signals, output or a file.
    #[error("operating system: {0}")]
    System(#[from] std::io::Error),
}

impl Error {
    /// Returns the exit code: 2 when a file or an option must be corrected, else 1.
    pub(crate) fn exit_code(&self) -> u8 {
        use platen_sim_press::Error as Press;
        match self {
            Self::Read { .. }
            | Self::Config { .. }
            | Self::Plate { .. }
            | Self::Format { .. }
            | Self::Press(Press::Config { .. } | Press::Plate(_)) => 2,
            Self::Press(_) | Self::Control { .. } | Self::File(_) | Self::System(_) => 1,
        }
    }
}
