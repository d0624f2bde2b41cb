//! Specification of a job: stroke, deadline, cancellation and progress.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Cancels a job from another thread.
#[derive(Debug, Clone, Default)]
pub struct CancelToken(Arc<AtomicBool>);

impl CancelToken {
    /// Cancels the job that was started with this token.
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Returns whether the job was cancelled.
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Receiver of a job's progress reports: the share done, 0 to 1, and the name of its phase.
#[derive(Clone, Default)]
pub struct ProgressSink(Option<Arc<Receive>>);

type Receive = dyn Fn(f64, &str) + Send + Sync;

impl ProgressSink {
    /// Creates a receiver; it is called from the thread that waits for the job.
    pub fn new(receive: impl Fn(f64, &str) + Send + Sync + 'static) -> Self {
        Self(Some(Arc::new(receive)))
    }

    /// Passes on a progress report of a plugin; a share that is not finite is dropped.
    pub(super) fn report(&self, share: f64, phase: &str) {
        if let Some(receive) = self.0.as_ref().filter(|_| share.is_finite()) {
            receive(share.clamp(0.0, 1.0), phase);
        }
    }
}

impl fmt::Debug for ProgressSink {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("ProgressSink").field(&self.0.is_some()).finish()
    }
}

/// Stroke and deadline of a job.
#[derive(Debug, Clone)]
pub struct JobSpec {
    /// Stroke number, 0 for none.
    pub stroke: u64,
    /// Time of the press's trigger.
    pub trigger: Instant,
    /// Time allowed from now.
    pub limit: Duration,
    /// Token that cancels it.
    pub cancel: CancelToken,
    /// Receives its progress.
    pub progress: ProgressSink,
}

impl JobSpec {
    /// Returns the specification of a job outside a stroke.
    pub fn untriggered(limit: Duration) -> Self {
        let (cancel, progress) = (CancelToken::default(), ProgressSink::default());
        Self { stroke: 0, trigger: Instant::now(), limit, cancel, progress }
    }
}
