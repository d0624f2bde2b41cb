//! A job as it is asked for.

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
