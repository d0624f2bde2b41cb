//! The surfaces of earlier strokes, beside their results: what this stroke is compared with.

use std::path::Path;

use platen_shape::Surface;

use crate::files::SURFACE;
use crate::plugin::surface_from_bytes;

/// The surface beside a result document; `None` with a log line when it is not there any more.
pub(super) fn beside(document: &Path) -> Option<Surface> {
    let path = document.with_file_name(SURFACE);
    let read = std::fs::read(&path).map_err(|e| e.to_string()).and_then(|bytes| surface_from_bytes(&bytes));
    read.map_err(|why| tracing::warn!("{}: {why}; this stroke is compared without it", path.display())).ok()
}
