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
    /// The press cannot start or go on.
    #[error(transparent)]
    Press(#[from] platen_sim_press::Error),
    /// The system refuses signals or output.
    #[error("the system refuses: {0}")]
    System(#[from] std::io::Error),
}

impl Error {
    /// 2 when a file or an option is to be corrected, else 1.
    pub(crate) fn exit_code(&self) -> u8 {
        use platen_sim_press::Error as Press;
        match self {
            Self::Read { .. } | Self::Config { .. } | Self::Press(Press::Config { .. } | Press::Plate(_)) => {
                2
            }
            Self::Press(_) | Self::System(_) => 1,
        }
    }
}
