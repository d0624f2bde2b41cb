//! Jobs in progress, as the callbacks of the host's table see them.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::SyncSender;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use platen_sdk::exchange::AlignedBuffer;

use super::PluginError;

/// Cancels a job from another thread.
#[derive(Debug, Clone, Default)]
pub struct CancelToken(Arc<AtomicBool>);

impl CancelToken {
    /// Cancels the job that was started with this token.
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// True once cancelled.
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// What a job belongs to and how long it may take.
#[derive(Debug, Clone)]
pub struct JobSpec {
    /// Stroke, 0 when none.
    pub stroke: u64,
    /// When the press triggered.
    pub trigger: Instant,
    /// Time allowed from now.
    pub limit: Duration,
    /// Cancels it.
    pub cancel: CancelToken,
}

impl JobSpec {
    /// Work that belongs to no stroke.
    pub fn untriggered(limit: Duration) -> Self {
        Self { stroke: 0, trigger: Instant::now(), limit, cancel: CancelToken::default() }
    }
}

/// A frame on its way from a plugin.
#[derive(Debug)]
pub(super) struct EmittedFrame {
    pub(super) format: String,
    pub(super) flags: u32,
    pub(super) buffer: AlignedBuffer,
}

/// What happens in a job, as its consumer hears of it.
#[derive(Debug)]
pub(super) enum Event {
    Frame(EmittedFrame),
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

/// A number that was not given out before; also used for buffer tokens.
pub(super) fn next_id() -> u64 {
    NEXT.fetch_add(1, Ordering::Relaxed)
}

/// The job of this number, while it is in progress.
pub(super) fn find(id: u64) -> Option<Arc<Job>> {
    JOBS.lock().unwrap_or_else(PoisonError::into_inner).get(&id).cloned()
}

/// Puts a job on the list until the guard is dropped.
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

/// A job on the list. Dropping it takes the job off, with the buffers that were not given back.
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

/// Nanoseconds of the host's monotonic clock, from the first call on.
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
