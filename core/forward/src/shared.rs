//! State shared by the tasks of the sinks.

use std::sync::{Mutex, PoisonError};

use crate::cursor::SharedCursors;
use crate::status::{ForwardStatus, SinkStatus};

/// Cursors, and the status of each sink.
#[derive(Debug)]
pub(crate) struct Shared {
    pub(crate) cursors: SharedCursors,
    pub(crate) sinks: Mutex<Vec<SinkStatus>>,
}

impl Shared {
    pub(crate) fn status(&self) -> ForwardStatus {
        let sinks = self.sinks.lock().unwrap_or_else(PoisonError::into_inner).clone();
        ForwardStatus { at: jiff::Timestamp::now(), pid: std::process::id(), sinks }
    }
}
