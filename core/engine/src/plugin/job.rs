//! Jobs in progress, for the callbacks of the host's table.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::SyncSender;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use platen_sdk::exchange::AlignedBuffer;

use super::{Emitted, PluginError};

/// Cancels a job from another thread.
#[derive(Debug, Clone, Default)]
pub struct CancelToken(Arc<AtomicBool>);

impl CancelToken {
    /// Cancels the job that was started with this token.
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether the job was cancelled.
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Stroke and deadline of a job.
#[derive(Debug, Clone)]
pub struct JobSpec {
    /// Stroke, 0 when none.
    pub stroke: u64,
    /// Time of the press's trigger.
    pub trigger: Instant,
    /// Time allowed from now.
    pub limit: Duration,
    /// Token that cancels it.
    pub cancel: CancelToken,
}

impl JobSpec {
    /// Returns the specification of a job outside a stroke.
    pub fn untriggered(limit: Duration) -> Self {
        Self { stroke: 0, trigger: Instant::now(), limit, cancel: CancelToken::default() }
    }
}

/// Events of a job for its consumer.
#[derive(Debug)]
pub(super) enum Event {
    Frame(Emitted),
    Done(Result<(), PluginError>),
}

/// One job in progress.
#[derive(Debug)]
pub(super) struct Job {
    pub(super) id: u64,
    pub(super) deadline: Instant,
    pub(super) cancelled: AtomicBool,
    pub(super) frames: SyncSender<Event>,
    pub(super) buffers: Mutex<BTreeMap<u64, AlignedBuffer>>,
}

impl Job {
    pub(super) fn is_stopped(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed) || Instant::now() >= self.deadline
    }
}

static JOBS: Mutex<BTreeMap<u64, Arc<Job>>> = Mutex::new(BTreeMap::new());
static NEXT: AtomicU64 = AtomicU64::new(1);

/// Returns a number that was not issued before; also used for buffer tokens.
pub(super) fn next_id() -> u64 {
    NEXT.fetch_add(1, Ordering::Relaxed)
}

/// Returns the job of this number, while it is in progress.
pub(super) fn find(id: u64) -> Option<Arc<Job>> {
    JOBS.lock().unwrap_or_else(PoisonError::into_inner).get(&id).cloned()
}

/// Registers a job until the guard is dropped.
pub(super) fn begin(deadline: Instant, frames: SyncSender<Event>) -> Listed {
    let job = Arc::new(Job {
        id: next_id(),
        deadline,
        cancelled: AtomicBool::new(false),
        frames,
        buffers: Mutex::new(BTreeMap::new()),
    });
    JOBS.lock().unwrap_or_else(PoisonError::into_inner).insert(job.id, Arc::clone(&job));
    Listed(job)
}

/// A registered job. Dropping it removes the job and the buffers that the plugin did not return.
#[derive(Debug)]
pub(super) struct Listed(pub(super) Arc<Job>);

impl Drop for Listed {
    fn drop(&mut self) {
        JOBS.lock().unwrap_or_else(PoisonError::into_inner).remove(&self.0.id);
        let left = std::mem::take(&mut *self.0.buffers.lock().unwrap_or_else(PoisonError::into_inner));
        if !left.is_empty() {
            tracing::warn!(job = self.0.id, buffers = left.len(), "a plugin kept buffers beyond its job");
        }
    }
}

/// Returns nanoseconds of the host's monotonic clock since the first call.
pub(super) fn mono_ns(at: Instant) -> i64 {
    static START: OnceLock<Instant> = OnceLock::new();
    let start = *START.get_or_init(Instant::now);
    match at.checked_duration_since(start) {
        Some(after) => i64::try_from(after.as_nanos()).unwrap_or(i64::MAX),
        None => -i64::try_from(start.duration_since(at).as_nanos()).unwrap_or(i64::MAX),
    }
}

/// Takes back a buffer that will not be emitted.
pub(super) fn free(token: u64) {
    let jobs = JOBS.lock().unwrap_or_else(PoisonError::into_inner);
    for job in jobs.values() {
        job.buffers.lock().unwrap_or_else(PoisonError::into_inner).remove(&token);
    }
}
