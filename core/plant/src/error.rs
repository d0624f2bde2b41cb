//! Errors of reading a file.

use std::path::PathBuf;

use crate::{Fault, Faults};

/// Error of reading a file.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the message of a variant names its fields")]
pub enum Error {
    /// The file cannot be opened or read.
    #[error("{}: {source}", path.display())]
    Unreadable { path: PathBuf, source: std::io::Error },
    /// The file has faults.
    #[error(transparent)]
    Faulty(#[from] Faults),
}

impl Error {
    /// Returns the faults; an unreadable file is one fault at line 0.
    pub fn into_faults(self) -> Vec<Fault> {
        match self {
            Self::Faulty(faults) => faults.into_iter().collect(),
            Self::Unreadable { path, source } => vec![Fault {
                file: path.display().to_string(),
                line: 0,
                column: 0,
                key: String::new(),
                message: source.to_string(),
            }],
        }
    }
}
