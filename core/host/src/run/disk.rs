//! Free space of the disk with the results.

use std::path::Path;

/// Returns the bytes available in a folder.
pub(super) fn free(folder: &Path) -> std::io::Result<u64> {
    let space = rustix::fs::statvfs(folder)?;
    Ok(space.f_bavail.saturating_mul(space.f_frsize))
}
