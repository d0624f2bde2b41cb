//! Clock of jobs: `CLOCK_MONOTONIC`, equal in all processes of a computer.

use std::time::{Duration, Instant};

use rustix::time::{ClockId, clock_gettime};

/// Returns the present time in nanoseconds.
pub(super) fn now_ns() -> i64 {
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec.saturating_mul(1_000_000_000).saturating_add(now.tv_nsec)
}

/// Returns an instant in nanoseconds.
pub(super) fn ns_at(at: Instant) -> i64 {
    let ns = |time: Duration| i64::try_from(time.as_nanos()).unwrap_or(i64::MAX);
    let now = Instant::now();
    now_ns()
        .saturating_add(ns(at.saturating_duration_since(now)))
        .saturating_sub(ns(now.saturating_duration_since(at)))
}
