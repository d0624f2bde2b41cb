//! Requests to stop a running host, and the condition for carrying one out: not in the middle of a plate.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Time without a stroke after which a plate counts as finished, for presses that signal no end of part.
const QUIET: Duration = Duration::from_secs(600);

/// Kind of a stop request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StopRequest {
    /// Stop now.
    AtOnce,
    /// Stop when no plate is being worked on.
    WhenIdle,
}

impl StopRequest {
    /// Returns the content of the file of the request.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::AtOnce => "at once\n",
            Self::WhenIdle => "when idle\n",
        }
    }

    /// Takes the request from the output folder, if there is one. An incomplete text counts as [`Self::WhenIdle`].
    pub(super) fn take(folder: &Path) -> Option<Self> {
        let path = stop_request(folder);
        let text = std::fs::read_to_string(&path).ok()?;
        std::fs::remove_file(&path).ok()?;
        Some(if text == Self::AtOnce.text() { Self::AtOnce } else { Self::WhenIdle })
    }
}

/// Returns the file of a stop request by `platen stop`. Permission is given by write access to the output folder.
pub fn stop_request(folder: &Path) -> PathBuf {
    folder.join("stop.request")
}

/// Plate in progress, as far as stopping is concerned.
#[derive(Debug, Clone, Default)]
pub(super) struct PlateInHand(Arc<Mutex<Option<Instant>>>);

impl PlateInHand {
    /// Records a stroke.
    pub(super) fn stroke(&self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
    }

    /// Records the end of the part.
    pub(super) fn ended(&self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// Returns whether no plate is in progress.
    pub(super) fn is_none(&self) -> bool {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).is_none_or(|last| last.elapsed() >= QUIET)
    }
}

/// Returns whether the file of the running program was replaced, as by an upgrade: the next start uses the new one.
pub(super) fn restart_pending() -> bool {
    std::fs::read_link("/proc/self/exe").is_ok_and(|path| path.to_string_lossy().ends_with(" (deleted)"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_is_taken_once_and_a_torn_one_waits_for_the_plate() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(StopRequest::take(folder.path()), None);
        for wanted in [StopRequest::AtOnce, StopRequest::WhenIdle] {
            std::fs::write(stop_request(folder.path()), wanted.text()).unwrap();
            assert_eq!(StopRequest::take(folder.path()), Some(wanted));
            assert_eq!(StopRequest::take(folder.path()), None);
        }
        std::fs::write(stop_request(folder.path()), "at").unwrap();
        assert_eq!(StopRequest::take(folder.path()), Some(StopRequest::WhenIdle));
    }

    #[test]
    fn a_plate_is_in_hand_from_its_stroke_to_its_end() {
        let plate = PlateInHand::default();
        assert!(plate.is_none());
        plate.stroke();
        assert!(!plate.is_none());
        plate.ended();
        assert!(plate.is_none());
    }
}
