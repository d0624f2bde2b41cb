//! Monitoring of the machine's clock: its synchronisation, the bound of its error, and its jumps.
//!
//! Once a second the realtime clock is compared with the monotonic one. If their difference changes by more than
//! [`LEAST_JUMP`], the clock has jumped. The log then contains a warning and the record an event with both times. Alarm
//! 503 is raised once after an hour without synchronisation. No order and no age inside the host depends on the
//! realtime clock.
//!
//! Limits: the monotonic clock stops while the machine sleeps; this is reported as a jump forward.

mod kernel;

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use jiff::{SignedDuration, Timestamp};
use platen_history::History;
use platen_report::result::ClockRecord;

/// Smallest jump that is recorded; slewing corrects far less in a second.
const LEAST_JUMP: SignedDuration = SignedDuration::from_millis(500);
/// Time without synchronisation until the alarm.
const PATIENCE: Duration = Duration::from_secs(3600);
/// Time between two comparisons.
const PERIOD: Duration = Duration::from_secs(1);

/// State of the clock, shared with the parts of the host that record it.
#[derive(Debug, Clone, Default)]
pub(super) struct Clock(Arc<Mutex<State>>);

#[derive(Debug, Clone, Copy, Default)]
struct State {
    now: Option<ClockRecord>,
    overdue: bool,
}

impl Clock {
    /// Returns the state of synchronisation; `None` where the system does not report it.
    pub(super) fn record(&self) -> Option<ClockRecord> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).now
    }

    /// Returns whether the clock has not been synchronised for [`PATIENCE`].
    pub(super) fn is_overdue(&self) -> bool {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).overdue
    }
}

/// Compares the clocks until the future is dropped; `raise` is called when the alarm is due.
pub(super) async fn keep(clock: Clock, history: Arc<Mutex<History>>, raise: impl Fn()) {
    let mut every = tokio::time::interval(PERIOD);
    every.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    let mut jumps = Jumps::default();
    let mut patience = Patience::default();
    loop {
        every.tick().await;
        let (realtime, monotonic) = (Timestamp::now(), Instant::now());
        if let Some(jump) = jumps.look(realtime, monotonic) {
            tracing::warn!("{jump}");
            let noted = history.lock().unwrap_or_else(PoisonError::into_inner).note(
                "clock",
                None,
                &jump.to_string(),
                realtime,
            );
            if let Err(error) = noted {
                tracing::warn!("the jump of the clock is not recorded: {error}");
            }
        }
        let now = kernel::state();
        let overdue = patience.is_over(now.is_some_and(|now| !now.synchronised), monotonic);
        let before = {
            let mut state = clock.0.lock().unwrap_or_else(PoisonError::into_inner);
            std::mem::replace(&mut *state, State { now, overdue }).overdue
        };
        if overdue && !before {
            raise();
        }
    }
}

/// Jump of the realtime clock.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Jump {
    /// Time that the clock would show without the jump.
    expected: Timestamp,
    found: Timestamp,
}

impl std::fmt::Display for Jump {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let by = self.found.duration_since(self.expected);
        let way = if by.is_negative() { "back" } else { "forward" };
        let seconds = by.as_secs_f64().abs();
        write!(f, "the clock was set {way} by {seconds:.1} s, from {:.3} to {:.3}", self.expected, self.found)
    }
}

/// Comparison of the two clocks.
#[derive(Debug, Default)]
struct Jumps {
    last: Option<(Timestamp, Instant)>,
}

impl Jumps {
    fn look(&mut self, realtime: Timestamp, monotonic: Instant) -> Option<Jump> {
        let (then, at) = self.last.replace((realtime, monotonic))?;
        let expected = then.checked_add(monotonic.saturating_duration_since(at)).ok()?;
        (realtime.duration_since(expected).abs() > LEAST_JUMP).then_some(Jump { expected, found: realtime })
    }
}

/// Time without synchronisation.
#[derive(Debug, Default)]
struct Patience {
    since: Option<Instant>,
}

impl Patience {
    fn is_over(&mut self, unsynchronised: bool, now: Instant) -> bool {
        if !unsynchronised {
            self.since = None;
            return false;
        }
        now.saturating_duration_since(*self.since.get_or_insert(now)) >= PATIENCE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_jump_is_reported_once_with_both_times_and_drift_is_none() {
        let start = Instant::now();
        let noon: Timestamp = "2026-05-04T12:00:00Z".parse().unwrap();
        let mut jumps = Jumps::default();
        let mut look = |second: u64, off_ms: i64| {
            let realtime = noon + SignedDuration::from_millis(1000 * second as i64 + off_ms);
            jumps.look(realtime, start + Duration::from_secs(second)).map(|jump| jump.to_string())
        };
        assert_eq!(look(0, 0), None);
        assert_eq!(look(1, 499), None);
        assert_eq!(look(2, 499 - 86_400_000), {
            let text = "the clock was set back by 86400.0 s, from 2026-05-04T12:00:02.499Z to 2026-05-03T12:00:02.499Z";
            Some(text.to_owned())
        });
        assert_eq!(look(3, 499 - 86_400_000), None);
        assert!(look(4, 0).unwrap().starts_with("the clock was set forward by 86399.5 s"));
        // A late comparison on a machine under load is not a jump.
        assert_eq!(look(60, 0), None);
    }

    #[test]
    fn the_alarm_is_due_after_an_hour_without_synchronisation() {
        let start = Instant::now();
        let at = |minutes: u64| start + Duration::from_secs(60 * minutes);
        let mut patience = Patience::default();
        assert!(!patience.is_over(true, at(0)) && !patience.is_over(true, at(59)));
        assert!(patience.is_over(true, at(60)) && patience.is_over(true, at(61)));
        assert!(!patience.is_over(false, at(62)) && !patience.is_over(true, at(63)));
        assert!(!patience.is_over(true, at(122)) && patience.is_over(true, at(123)));
    }
}
