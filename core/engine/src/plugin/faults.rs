//! Fault counter of one plugin: the pause before it is started again, and the limit at which it is quarantined.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Pause after the first, second, ... fault without a success between.
const RESTS: [Duration; 4] =
    [Duration::ZERO, Duration::from_secs(1), Duration::from_secs(5), Duration::from_secs(30)];
/// Limit on faults (first value) within a number of jobs (second value).
const IN_JOBS: (usize, u64) = (3, 20);
/// Limit on faults (first value) within a time (second value).
const IN_TIME: (usize, Duration) = (5, Duration::from_secs(600));

/// Recent faults of a plugin.
#[derive(Debug, Default)]
pub(super) struct Faults {
    jobs: u64,
    /// Number of the job, and time of the fault.
    recent: VecDeque<(u64, Instant)>,
    /// Faults without a success between.
    in_a_row: usize,
    /// All faults since the start of the host.
    count: u64,
    why: String,
}

impl Faults {
    pub(super) fn job(&mut self) {
        self.jobs += 1;
    }

    pub(super) fn success(&mut self) {
        self.in_a_row = 0;
    }

    /// Adds a fault; returns whether there are now too many.
    pub(super) fn add(&mut self, why: &str, now: Instant) -> bool {
        self.in_a_row += 1;
        self.count += 1;
        why.clone_into(&mut self.why);
        self.recent.push_back((self.jobs, now));
        while self.recent.len() > IN_TIME.0 {
            self.recent.pop_front();
        }
        let (jobs, time) = (IN_JOBS, IN_TIME);
        let in_jobs = self.recent.iter().filter(|(job, _)| self.jobs - job < jobs.1).count();
        let in_time = self.recent.iter().filter(|(_, at)| now - *at < time.1).count();
        in_jobs >= jobs.0 || in_time >= time.0
    }

    /// Returns the remaining pause.
    pub(super) fn rest(&self, now: Instant) -> Duration {
        let Some((_, last)) = self.recent.back().filter(|_| self.in_a_row > 0) else { return Duration::ZERO };
        (*last + RESTS[(self.in_a_row - 1).min(RESTS.len() - 1)]).saturating_duration_since(now)
    }

    pub(super) fn count(&self) -> u64 {
        self.count
    }

    pub(super) fn why(&self) -> &str {
        &self.why
    }

    /// Clears the faults: another build of the plugin has been installed.
    pub(super) fn forget(&mut self) {
        *self = Self { jobs: self.jobs, count: self.count, ..Self::default() };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_faults_in_twenty_jobs_or_five_in_ten_minutes_are_too_many() {
        let start = Instant::now();
        let mut dense = Faults::default();
        let after = |jobs: u32, faults: &mut Faults| (0..jobs).for_each(|_| faults.job());
        assert!(!dense.add("a", start));
        after(10, &mut dense);
        assert!(!dense.add("b", start));
        after(9, &mut dense);
        assert!(dense.add("c", start));
        assert_eq!((dense.count(), dense.why()), (3, "c"));

        let mut sparse = Faults::default();
        let minutes = |n: u64| start + Duration::from_secs(60 * n);
        for n in 0..8 {
            after(20, &mut sparse);
            sparse.success();
            assert!(!sparse.add("d", minutes(3 * n)), "{n}");
        }
        after(20, &mut sparse);
        assert!(!sparse.add("e", minutes(23)));
        after(20, &mut sparse);
        assert!(sparse.add("f", minutes(24)), "five from minute 15 on");
    }

    #[test]
    fn rests_grow_until_a_success() {
        let start = Instant::now();
        let mut faults = Faults::default();
        assert_eq!(faults.rest(start), Duration::ZERO);
        for rest in [0, 1, 5, 30, 30] {
            faults.add("a", start);
            assert_eq!(faults.rest(start), Duration::from_secs(rest));
        }
        faults.success();
        assert_eq!(faults.rest(start), Duration::ZERO);
    }
}
