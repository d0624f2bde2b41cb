//! Forwarding of the plugin's `tracing` events to the host.
//!
//! A library has its own `tracing` globals and cannot use the host's subscriber.

use std::cell::Cell;
use std::ffi::CString;
use std::fmt::Write as _;

use platen_abi as abi;
use tracing::field::{Field, Visit};
use tracing::span;

thread_local! {
    static JOB: Cell<u64> = const { Cell::new(0) };
}

/// Runs `work` with `job_id` as the job of this thread's log lines.
pub(crate) fn in_job<T>(job_id: u64, work: impl FnOnce() -> T) -> T {
    let before = JOB.replace(job_id);
    let result = work();
    JOB.set(before);
    result
}

struct ToHost(&'static abi::Host);

// SAFETY: every function of the host's table may be called from any thread.
unsafe impl Send for ToHost {}
// SAFETY: as above.
unsafe impl Sync for ToHost {}

/// Installs the host as the subscriber of this library's `tracing` events.
pub(crate) fn install(host: &'static abi::Host) {
    // A second `init` in the same process finds the first subscriber installed, which serves equally.
    let _ = tracing::subscriber::set_global_default(ToHost(host));
}

fn level(level: &tracing::Level) -> abi::Level {
    match *level {
        tracing::Level::ERROR => 1,
        tracing::Level::WARN => 2,
        tracing::Level::INFO => 3,
        tracing::Level::DEBUG => 4,
        tracing::Level::TRACE => 5,
    }
}

#[derive(Default)]
struct Line(String);

impl Visit for Line {
    fn record_debug(&mut self, field: &Field, value: &dyn std::fmt::Debug) {
        let gap = if self.0.is_empty() { "" } else { " " };
        // Writing to a String cannot fail.
        let _ = if field.name() == "message" {
            write!(self.0, "{gap}{value:?}")
        } else {
            write!(self.0, "{gap}{}={value:?}", field.name())
        };
    }
}

impl tracing::Subscriber for ToHost {
    fn enabled(&self, metadata: &tracing::Metadata<'_>) -> bool {
        // SAFETY: the host's table lives until `deinit`.
        !metadata.is_span() && unsafe { (self.0.log_enabled)(self.0, level(metadata.level())) } != 0
    }

    fn event(&self, event: &tracing::Event<'_>) {
        let mut line = Line::default();
        event.record(&mut line);
        let text = CString::new(line.0.replace('\0', " ")).unwrap_or_default();
        // SAFETY: the string lives for the call.
        unsafe { (self.0.log)(self.0, JOB.get(), level(event.metadata().level()), text.as_ptr()) };
    }

    fn new_span(&self, _: &span::Attributes<'_>) -> span::Id {
        span::Id::from_u64(1)
    }
    fn record(&self, _: &span::Id, _: &span::Record<'_>) {}
    fn record_follows_from(&self, _: &span::Id, _: &span::Id) {}
    fn enter(&self, _: &span::Id) {}
    fn exit(&self, _: &span::Id) {}
}
