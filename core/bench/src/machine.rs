//! Processor time, memory and name of this machine.

use std::time::Duration;

use rustix::time::{ClockId, clock_gettime};
use serde::Serialize;

/// Returns the processor time of this process so far, summed over all threads; other load of the machine has little
/// effect on it.
pub(super) fn cpu_time() -> Duration {
    time_of(ClockId::ProcessCPUTime)
}

/// Returns the processor time of this thread so far.
pub(super) fn thread_time() -> Duration {
    time_of(ClockId::ThreadCPUTime)
}

fn time_of(clock: ClockId) -> Duration {
    let now = clock_gettime(clock);
    let seconds = u64::try_from(now.tv_sec).unwrap_or(0);
    Duration::new(seconds, u32::try_from(now.tv_nsec).unwrap_or(0))
}

/// Returns the peak resident memory of this process so far, in units of 2^20 bytes; `None` where the system does not
/// report it.
pub(super) fn peak_memory_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().trim_end_matches(" kB").parse::<f64>().ok()? / 1024.0)
}

/// Machine on which the figures were measured.
#[derive(Debug, Serialize)]
pub(super) struct Machine {
    /// Model of the processor.
    processor: String,
    /// Logical cores.
    cores: usize,
    /// Load average of the last minute; above 0.5 other programs were running.
    load: Option<f64>,
}

impl Machine {
    pub(super) fn here() -> Self {
        let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let model =
            info.lines().find(|line| line.starts_with("model name")).and_then(|line| line.split(": ").nth(1));
        let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
        Self {
            processor: model.unwrap_or("unknown processor").to_owned(),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            load: load.split(' ').next().and_then(|first| first.parse().ok()),
        }
    }

    pub(super) fn words(&self) -> String {
        let load = self.load.map(|load| format!(", load {load:.1}")).unwrap_or_default();
        format!("{}, {} cores{load}; times: CPU ms of one measurement, medians", self.processor, self.cores)
    }
}
