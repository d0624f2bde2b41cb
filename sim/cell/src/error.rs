//! Why the program ends without having done what was asked.

use std::path::PathBuf;

/// An error by who must act.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Error {
    /// The file is not there.
    #[error("{path}: {source}")]
    Read { path: PathBuf, source: std::io::Error },
    /// The file is wrong.
    #[error("{path}:{line}: {message}")]
    Config { path: PathBuf, line: usize, message: String },
    /// The plate that it describes is impossible.
    #[error("{path}: {source}")]
    Plate { path: PathBuf, source: platen_sim_plate::PlateError },
    /// The file's name does not say which format is meant.
    #[error("{path}: unknown ending; write .e57, .ptx, .xyz or .xyb")]
    Format { path: PathBuf },
    /// The press cannot start or go on.
    #[error(transparent)]
    Press(#[from] platen_sim_press::Error),
    /// The press does not say what lies in it.
    #[error("press at {address}: {what}")]
    Control { address: String, what: String },
    /// A scan cannot be written.
    #[error(transparent)]
    File(#[from] platen_sim_scanner::FileError),
    /// The system refuses signals, output or a file.
    #[error("the system refuses: {0}")]
    System(#[from] std::io::Error),
}

impl Error {
    /// 2 when a file or an option is to be corrected, else 1.
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
