//! What a bridge has done, counted by all its connections.

use std::sync::atomic::{AtomicU32, Ordering};

use serde::Serialize;

/// What a bridge has done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct BridgeCounters {
    /// Connections taken.
    pub connections: u32,
    /// Scans that the head began.
    pub scans: u32,
    /// Start frames.
    pub starts: u32,
    /// Resume frames.
    pub resumes: u32,
    /// Scans that were aborted.
    pub aborts: u32,
    /// Column frames sent.
    pub columns_sent: u32,
    /// Columns of the scan that was begun last.
    pub columns: u32,
    /// Connections that a fault has cut.
    pub cuts: u32,
}

/// Counters of [`BridgeCounters`].
#[derive(Debug, Default)]
pub(super) struct AtomicCounters {
    pub(super) connections: AtomicU32,
    pub(super) scans: AtomicU32,
    pub(super) starts: AtomicU32,
    pub(super) resumes: AtomicU32,
    pub(super) aborts: AtomicU32,
    pub(super) columns_sent: AtomicU32,
    pub(super) columns: AtomicU32,
    pub(super) cuts: AtomicU32,
}

impl AtomicCounters {
    /// As they stand now.
    pub(super) fn read(&self) -> BridgeCounters {
        let read = |counter: &AtomicU32| counter.load(Ordering::Relaxed);
        BridgeCounters {
            connections: read(&self.connections),
            scans: read(&self.scans),
            starts: read(&self.starts),
            resumes: read(&self.resumes),
            aborts: read(&self.aborts),
            columns_sent: read(&self.columns_sent),
            columns: read(&self.columns),
            cuts: read(&self.cuts),
        }
    }
}

/// AtomicCounters one up.
pub(super) fn increment(counter: &AtomicU32) {
    counter.fetch_add(1, Ordering::Relaxed);
}
