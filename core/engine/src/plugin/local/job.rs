//! Registry of the jobs in progress in this process, for the callbacks of the host's table.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use super::super::clock;
use super::super::worker::{Extent, Outbox, Pool};

/// One job in progress.
#[derive(Debug)]
pub(in crate::plugin) struct Job {
    pub(in crate::plugin) id: u64,
    deadline_ns: i64,
    cancelled: AtomicBool,
    pub(super) pool: Arc<Pool>,
    pub(super) outbox: Arc<Outbox>,
    /// Buffers that the plugin holds, by token.
    buffers: Mutex<BTreeMap<u64, Extent>>,
}

impl Job {
    pub(in crate::plugin) fn is_stopped(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed) || clock::now_ns() >= self.deadline_ns
    }

    pub(in crate::plugin) fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Allocates a buffer; returns it with its token.
    pub(super) fn allocate(&self, bytes: usize) -> Option<(Extent, u64)> {
        let extent = self.pool.allocate(bytes, || self.is_stopped())?;
        let token = NEXT.fetch_add(1, Ordering::Relaxed);
        self.buffers.lock().unwrap_or_else(PoisonError::into_inner).insert(token, extent);
        Some((extent, token))
    }

    /// Takes a buffer from the plugin.
    pub(super) fn take(&self, token: u64) -> Option<Extent> {
        self.buffers.lock().unwrap_or_else(PoisonError::into_inner).remove(&token)
    }
}

static JOBS: Mutex<BTreeMap<u64, Arc<Job>>> = Mutex::new(BTreeMap::new());
/// Tokens of buffers.
static NEXT: AtomicU64 = AtomicU64::new(1);

/// Returns the job of this number, while it is in progress.
pub(in crate::plugin) fn find(id: u64) -> Option<Arc<Job>> {
    JOBS.lock().unwrap_or_else(PoisonError::into_inner).get(&id).cloned()
}

/// Registers a job until the guard is dropped.
pub(in crate::plugin) fn begin(id: u64, deadline_ns: i64, pool: Arc<Pool>, outbox: Arc<Outbox>) -> Listed {
    let job = Job {
        id,
        deadline_ns,
        cancelled: AtomicBool::new(false),
        pool,
        outbox,
        buffers: Mutex::new(BTreeMap::new()),
    };
    let job = Arc::new(job);
    JOBS.lock().unwrap_or_else(PoisonError::into_inner).insert(id, Arc::clone(&job));
    Listed(job)
}

/// A registered job. Dropping it removes the job and the buffers that the plugin did not return.
#[derive(Debug)]
pub(in crate::plugin) struct Listed(Arc<Job>);

impl Drop for Listed {
    fn drop(&mut self) {
        let Job { id, pool, outbox, buffers, .. } = &*self.0;
        JOBS.lock().unwrap_or_else(PoisonError::into_inner).remove(id);
        let left = std::mem::take(&mut *buffers.lock().unwrap_or_else(PoisonError::into_inner));
        if !left.is_empty() {
            outbox.log(*id, 2, &format!("{} buffers were neither emitted nor freed", left.len()));
        }
        left.into_values().for_each(|extent| pool.free(extent));
    }
}

/// Takes back a buffer that will not be emitted.
pub(super) fn free(token: u64) {
    let jobs = JOBS.lock().unwrap_or_else(PoisonError::into_inner);
    for job in jobs.values() {
        if let Some(extent) = job.take(token) {
            job.pool.free(extent);
        }
    }
}
