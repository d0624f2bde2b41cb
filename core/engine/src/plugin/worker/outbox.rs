//! Messages of a worker to the host: frames, log lines, progress.

use std::os::fd::BorrowedFd;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use super::wire::{Socket, ToHost};

/// Log lines a second; further lines are only counted.
const LINES: u32 = 1000;
/// Longest log line, characters.
const LINE: usize = 2000;

/// Connection of the worker to the host, shared by all threads.
#[derive(Debug)]
pub(in crate::plugin) struct Outbox {
    socket: Arc<Socket>,
    level: i32,
    second: Mutex<Second>,
}

#[derive(Debug)]
struct Second {
    since: Instant,
    lines: u32,
}

/// Outbox of this process, if it is a worker.
static OUTBOX: OnceLock<Arc<Outbox>> = OnceLock::new();

/// Returns the outbox of this process; `None` in the host.
pub(in crate::plugin) fn outbox() -> Option<Arc<Outbox>> {
    OUTBOX.get().cloned()
}

impl Outbox {
    pub(super) fn new(socket: Arc<Socket>, level: i32) -> Arc<Self> {
        Arc::new(Self { socket, level, second: Mutex::new(Second { since: Instant::now(), lines: 0 }) })
    }

    /// Makes it the outbox of the process.
    pub(super) fn publish(self: &Arc<Self>) {
        let _ = OUTBOX.set(Arc::clone(self));
    }

    pub(in crate::plugin) fn send(&self, message: &ToHost) -> std::io::Result<()> {
        const NONE: &[BorrowedFd<'_>] = &[];
        self.socket.send(message, NONE)
    }

    /// Returns whether lines of a level reach the host's log.
    pub(in crate::plugin) fn logs(&self, level: i32) -> bool {
        level <= self.level
    }

    pub(in crate::plugin) fn log(&self, job: u64, level: i32, text: &str) {
        if !self.logs(level) {
            return;
        }
        let dropped = {
            let mut second = self.second.lock().unwrap_or_else(PoisonError::into_inner);
            let mut dropped = 0;
            if second.since.elapsed() > Duration::from_secs(1) {
                dropped = second.lines.saturating_sub(LINES);
                *second = Second { since: Instant::now(), lines: 0 };
            }
            second.lines += 1;
            if second.lines > LINES {
                return;
            }
            dropped
        };
        if dropped > 0 {
            let text = format!("{dropped} lines more than {LINES} a second are left out");
            let _ = self.send(&ToHost::Log { job: 0, level: 2, text });
        }
        let text = text.chars().take(LINE).collect();
        let _ = self.send(&ToHost::Log { job, level, text });
    }
}
