//! Errors of writing.

use std::path::{Path, PathBuf};

use crate::read::e57::chain;

/// Result of an encoder; the path is added by its caller.
pub(super) type Result<T> = std::result::Result<T, WriteFault>;

/// Reason why there is no file.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the message of a variant names its fields")]
pub enum WriteError {
    /// The extension does not belong to a format.
    #[error("{}: unknown format; let the name end in .e57, .ptx, .xyz or .xyb", .0.display())]
    Format(PathBuf),
    /// A file of that name exists.
    #[error("{}: exists already; give another name or remove it", .0.display())]
    Exists(PathBuf),
    /// Writing failed.
    #[error("{}: {fault}", .path.display())]
    Failed { path: PathBuf, fault: WriteFault },
}

/// Reason why writing failed.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the message of a variant names its fields")]
pub enum WriteFault {
    /// The operating system refuses.
    #[error("cannot be written: {0}; check the folder and the space on its disk")]
    Io(#[from] std::io::Error),
    /// The E57 library refuses.
    #[error("cannot be written: {}; check the folder and the space on its disk", chain(.0))]
    E57(#[from] e57::Error),
    /// A text format has no room for a coordinate.
    #[error("column {column} row {row} is {metres:.0} m away, beyond the format; write an E57")]
    TooFar { column: u32, row: u32, metres: f64 },
}

impl WriteError {
    /// Returns a closure for `map_err` that adds the path.
    pub(super) fn at(path: &Path) -> impl FnOnce(WriteFault) -> Self + '_ {
        |fault| Self::Failed { path: path.to_path_buf(), fault }
    }
}
