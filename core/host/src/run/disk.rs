//! The disk that results are written to.

use std::path::Path;

/// Bytes that are free for results in a folder.
pub(super) fn free(folder: &Path) -> std::io::Result<u64> {
    let space = rustix::fs::statvfs(folder)?;
    Ok(space.f_bavail.saturating_mul(space.f_frsize))
}
