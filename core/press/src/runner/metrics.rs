//! Metrics of the strokes since the start: counters and durations.

use std::time::Duration;

/// Ring buffer of the latest durations of one kind, for percentiles.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Durations {
    latest: std::collections::VecDeque<Duration>,
    /// Number since the start.
    pub count: u64,
}

impl Durations {
    /// Number kept.
    pub const KEPT: usize = 1000;

    /// Adds a duration.
    pub fn add(&mut self, duration: Duration) {
        if self.latest.len() == Self::KEPT {
            self.latest.pop_front();
        }
        self.latest.push_back(duration);
        self.count += 1;
    }

    /// Returns the latest duration.
    pub fn last(&self) -> Option<Duration> {
        self.latest.back().copied()
    }

    /// Returns the percentile of the latest durations by nearest rank; `None` without any.
    pub fn percentile(&self, percent: f64) -> Option<Duration> {
        let mut sorted: Vec<_> = self.latest.iter().copied().collect();
        sorted.sort_unstable();
        let rank = (percent / 100.0 * sorted.len() as f64).ceil() as usize;
        sorted.get(rank.clamp(1, sorted.len().max(1)) - 1).copied()
    }
}

/// Counters of the strokes since the start.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Metrics {
    /// Strokes accepted, every attempt.
    pub strokes: u64,
    /// Results published with a measurement.
    pub measured: u64,
    /// Results published without a measurement.
    pub not_measured: u64,
    /// Strokes missed.
    pub missed: u64,
    /// Results that the press did not acknowledge in time.
    pub ack_timeouts: u64,
    /// Torn reads of the press's block.
    pub torn_reads: u64,
    /// Read-backs in which the press had changed the host's own block.
    pub rewrites: u64,
    /// From the poll that saw the trigger to the echo of busy.
    pub trigger_to_busy: Durations,
    /// From the acceptance to the echo of the result.
    pub stroke_to_result: Durations,
    /// From the echo of the result to the poll that saw the press's acknowledge.
    pub result_to_ack: Durations,
    /// From queueing a record of the journal until it would survive a power cut.
    pub journal: Durations,
    /// Records that the journal could not store.
    pub journal_failed: u64,
    /// Time that the present result has waited for the press; `None` when none waits.
    pub result_waits: Option<Duration>,
    /// Time out of synchronisation with the press, without the present loss.
    pub link_down: Duration,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_nearest_ranks_of_the_latest() {
        let mut durations = Durations::default();
        assert_eq!(durations.percentile(50.0), None);
        for ms in (1..=1100).rev() {
            durations.add(Duration::from_millis(ms));
        }
        assert_eq!(durations.count, 1100);
        assert_eq!(durations.percentile(0.0), Some(Duration::from_millis(1)));
        assert_eq!(durations.percentile(50.0), Some(Duration::from_millis(500)));
        assert_eq!(durations.percentile(99.0), Some(Duration::from_millis(990)));
        assert_eq!(durations.percentile(100.0), Some(Duration::from_millis(1000)));
    }
}
