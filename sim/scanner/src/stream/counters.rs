//! Counters of a bridge, shared by its connections.

use std::sync::atomic::{AtomicU32, Ordering};

use serde::Serialize;

/// Counters of a bridge since its start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct BridgeCounters {
    /// Connections accepted.
    pub connections: u32,
    /// Scans started by the head.
    pub scans: u32,
    /// Start frames received.
    pub starts: u32,
    /// Resume frames received.
    pub resumes: u32,
    /// Scans aborted.
    pub aborts: u32,
    /// Column frames sent.
    pub columns_sent: u32,
    /// Columns of the latest scan.
    pub columns: u32,
    /// Connections cut by a fault.
    pub cuts: u32,
}

/// Atomic form of [`BridgeCounters`].
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
    /// Returns the present values.
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

/// Increments a counter.
pub(super) fn increment(counter: &AtomicU32) {
    counter.fetch_add(1, Ordering::Relaxed);
}
