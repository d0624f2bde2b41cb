//! The plate's surface with its covariance, beside the result: what the next stroke is compared with.
//!
//! The file holds what a comparison plugin gets, a `platen.surface/1` buffer of `platen.h`.

use std::path::Path;

use platen_shape::Surface;

use crate::plugin::{surface_bytes, surface_from_bytes};

/// Name of the file in a result's folder.
pub(super) const NAME: &str = "surface.platen";

pub(super) fn write(folder: &Path, surface: &Surface) -> std::io::Result<()> {
    std::fs::write(folder.join(NAME), surface_bytes(surface))
}

/// The surface beside a result document; `None` with a log line when it is not there any more.
pub(super) fn beside(document: &Path) -> Option<Surface> {
    let path = document.with_file_name(NAME);
    let read = std::fs::read(&path).map_err(|e| e.to_string()).and_then(|bytes| surface_from_bytes(&bytes));
    read.map_err(|why| tracing::warn!("{}: {why}; this stroke is compared without it", path.display())).ok()
}
