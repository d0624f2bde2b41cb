//! Transition function of the handshake: one `match` over both regions, in order of urgency.
//!
//! Order: end of the host, link, faults, identity of the press, other hosts, heartbeat, missed strokes; then the
//! active stroke with the press online; then its steps that need no link.

use std::time::Duration;

use super::machine::Handshake;
use super::{LinkState, Transition, Work};
use crate::Code;

impl Handshake {
    /// Takes the most urgent transition that is due. Requests of the press need an online link; scan and evaluation go
    /// on without one.
    pub(super) fn advance(&mut self, now: Duration) -> Option<Transition> {
        use Transition::*;
        match (self.link, self.work) {
            (LinkState::Stopped { .. }, _) => None,
            _ if self.stop => Some(self.stop_host()),
            (LinkState::Boot, _) => self.enter_link(LinkState::Offline, LinkStarted),
            (LinkState::Offline, _) if self.connected => Some(self.begin_sync(now, Connected)),
            (LinkState::Sync | LinkState::Online, _) if !self.connected => {
                self.enter_link(LinkState::Offline, LinkLost)
            }
            (LinkState::Fault(_), _) if self.reset && self.connected => {
                Some(self.begin_sync(now, FaultReset))
            }
            (LinkState::Fault(_), _) if self.reset => self.enter_link(LinkState::Offline, FaultReset),
            (LinkState::Sync | LinkState::Online, _) if self.fault.is_some() => Some(self.fail(Faulted)),
            (LinkState::Sync | LinkState::Online, _) if self.wrong_press() => Some(self.leave_wrong_press()),
            (LinkState::Sync, _) if self.other_host.is_some_and(|host| host.alive) => {
                Some(self.fail_as(Code::SecondHost, SecondHostFound))
            }
            (LinkState::Sync, _) if self.synchronised(now) => Some(self.enter_online(now)),
            (LinkState::Online, _) if self.overwritten => Some(self.fail_as(Code::SecondHost, Faulted)),
            (LinkState::Online, _) if self.newly_stale(now) => Some(self.press_stale()),
            (LinkState::Online, work) if work.is_busy() && self.another_stroke() => {
                Some(self.record_missed())
            }

            (LinkState::Online, Work::Idle) if self.blocked() => self.enter_work(Work::Blocked, now, Blocked),
            (LinkState::Online, Work::Blocked) if !self.blocked() => {
                self.enter_work(Work::Idle, now, Unblocked)
            }
            (LinkState::Online, Work::WaitAck | Work::Idle | Work::Blocked) if self.acknowledged() => {
                Some(self.acked(now))
            }
            (LinkState::Online, Work::WaitAck) if self.ack_overdue(now) => Some(self.go_on_without_ack(now)),
            (LinkState::Online, Work::Clear) if self.ack_dropped(now) => {
                self.enter_work(Work::Idle, now, AckWithdrawn)
            }
            (LinkState::Online, Work::Idle | Work::WaitAck) if self.stroke_waits() => {
                Some(self.accept_stroke(now, StrokeAccepted))
            }
            (LinkState::Online, Work::Idle | Work::WaitAck) if self.rescan_wanted() => {
                Some(self.accept_rescan(now, RescanAccepted))
            }
            (LinkState::Online, Work::Publish) if self.written && self.journaled() => {
                Some(self.published(now))
            }
            (LinkState::Online, Work::Accepted) if self.clear_to_start() => Some(self.start_scan(now)),

            (_, Work::Accepted | Work::Scanning) if self.given_up(now).is_some() => Some(self.give_up(now)),
            (_, Work::Scanning) if self.scan_complete() => Some(self.begin_evaluation(now)),
            (_, Work::Evaluating) if self.evaluated(now) => Some(self.conclude(now)),
            (_, Work::Aborted) if self.journaled() => self.enter_work(Work::Publish, now, StrokeNotMeasured),
            (_, Work::Accepted | Work::Aborted | Work::Publish) if self.journal_overdue(now) => {
                self.journal_failed();
                None
            }
            _ => None,
        }
    }

    fn enter_link(&mut self, link: LinkState, transition: Transition) -> Option<Transition> {
        self.link = link;
        Some(transition)
    }

    fn enter_work(&mut self, work: Work, now: Duration, transition: Transition) -> Option<Transition> {
        self.work = work;
        if let Some(active) = &mut self.active {
            active.since = now;
        }
        Some(transition)
    }
}
