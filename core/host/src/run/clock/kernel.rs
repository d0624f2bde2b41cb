//! Synchronisation state of the system clock, read from the kernel with `adjtimex(2)`; reading requires no privilege.

#![allow(unsafe_code, reason = "a system call without a safe binding")]

use platen_report::result::ClockRecord;

/// Returns the state of synchronisation; `None` where the system call is refused.
pub(super) fn state() -> Option<ClockRecord> {
    // SAFETY: timex consists of integers, for which zero is a valid value; with modes = 0 the call only reads.
    let (state, timex) = unsafe {
        let mut timex: libc::timex = std::mem::zeroed();
        (libc::adjtimex(&raw mut timex), timex)
    };
    let synchronised = state != libc::TIME_ERROR && timex.status & libc::STA_UNSYNC == 0;
    // The kernel counts microseconds.
    let error_bound_ms = synchronised.then_some(timex.maxerror as f64 / 1000.0);
    (state >= 0).then_some(ClockRecord { synchronised, error_bound_ms })
}

#[cfg(test)]
mod tests {
    use super::state;

    #[test]
    fn a_bound_is_there_exactly_while_synchronised() {
        if let Some(clock) = state() {
            assert_eq!(clock.error_bound_ms.is_some(), clock.synchronised);
            assert!(
                clock.error_bound_ms.is_none_or(|bound| (0.0..16_000_000.0).contains(&bound)),
                "{clock:?}"
            );
        }
    }
}
