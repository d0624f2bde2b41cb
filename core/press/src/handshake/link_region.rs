//! Actions of the link region: synchronisation with the press, faults and end.
//!
//! In order: begin synchronisation, reject a wrong press or a second host, go online with a resumed, waiting or no
//! stroke; heartbeat supervision; end.

use std::time::Duration;

use platen_plant::press::Input;

use super::machine::{ActiveStroke, Handshake};
use super::messages::{Command, Effect};
use super::{LinkState, Transition, Work};
use crate::{Acknowledgement, Code, Measurement, Record, Stage, StrokeKey};

/// Time after which another host with an unchanged heartbeat counts as ended.
const OWNER_WATCH: Duration = Duration::from_secs(2);

impl Handshake {
    pub(super) fn stop_host(&mut self) -> Transition {
        if matches!(self.work, Work::Accepted | Work::Scanning | Work::Evaluating)
            && let Some(active) = &self.active
        {
            self.effects.push(Effect::Command(Command::Cancel(active.key)));
        }
        self.link = LinkState::Stopped { writable: self.may_write() && self.connected };
        Transition::Stopped
    }

    pub(super) fn begin_sync(&mut self, now: Duration, transition: Transition) -> Transition {
        self.link = LinkState::Sync;
        self.fault = None;
        self.press = None;
        self.held_reads = 0;
        self.heartbeat_at = now;
        self.stale = false;
        self.host_seen = false;
        self.other_host = None;
        self.overwritten = false;
        transition
    }

    pub(super) fn fail(&mut self, transition: Transition) -> Transition {
        let code = self.fault.take().unwrap_or(Code::DeviceFailure);
        self.fail_as(code, transition)
    }

    pub(super) fn fail_as(&mut self, code: Code, transition: Transition) -> Transition {
        self.link = LinkState::Fault(code);
        self.alarm(code);
        transition
    }

    pub(super) fn wrong_press(&self) -> bool {
        self.press.as_ref().is_some_and(|press| press.wrong.is_some())
    }

    /// Goes offline without a write and connects again later: the controller may be starting.
    pub(super) fn leave_wrong_press(&mut self) -> Transition {
        let wrong = self.press.take().and_then(|press| press.wrong);
        let code = if wrong.is_some_and(|wrong| wrong.input == Input::PressId) {
            Code::PressId
        } else {
            Code::MapVersion
        };
        if self.link_error != Some(code) {
            self.link_error = Some(code);
            self.alarm(code);
        }
        self.connected = false;
        self.link = LinkState::Offline;
        self.effects.push(Effect::Reconnect);
        Transition::PressRejected
    }

    pub(super) fn synchronised(&self, now: Duration) -> bool {
        let alone = self.other_host.is_none_or(|host| now.saturating_sub(host.since) >= OWNER_WATCH);
        self.press.is_some() && self.host_seen && alone
    }

    /// Goes online after both blocks were read: resumes the recalled or active stroke, accepts a waiting one, or
    /// becomes idle.
    pub(super) fn enter_online(&mut self, now: Duration) -> Transition {
        self.link = LinkState::Online;
        self.link_error = None;
        self.overwritten = false;
        if let Some((stage, active)) = self.take_recalled(now) {
            self.resume(stage, active, now)
        } else if self.work.is_busy() || self.work == Work::WaitAck {
            self.carry_on(now)
        } else {
            self.become_idle(now)
        }
    }

    /// Resumes the last stroke of the journal after a restart.
    pub(super) fn resume(&mut self, stage: Stage, active: ActiveStroke, now: Duration) -> Transition {
        let waits = self.press_is_at(active.key);
        match stage {
            Stage::Finished if waits => {
                self.ack_was_low = true;
                self.active = Some(ActiveStroke { journaled: Some(true), ..active });
                self.work = Work::Publish;
                Transition::StrokeResumed
            }
            Stage::Scanned if waits => {
                self.effects.push(Effect::Command(Command::Evaluate(active.key)));
                self.active = Some(ActiveStroke { acquired_at: Some(now), ..active });
                self.work = Work::Evaluating;
                Transition::InterruptedStrokeRecovered
            }
            Stage::Accepted if waits => {
                self.active = Some(active);
                self.finish(Measurement::not_measured(Code::Interrupted), Work::Aborted, now);
                Transition::InterruptedStrokeRecovered
            }
            _ => {
                let key = active.key;
                self.active = Some(active);
                if stage < Stage::Finished {
                    self.finish(Measurement::not_measured(Code::Interrupted), Work::Aborted, now);
                }
                self.close(key, Acknowledgement::Never);
                self.active = None;
                self.become_idle(now)
            }
        }
    }

    /// Continues the active stroke after a lost link.
    pub(super) fn carry_on(&mut self, now: Duration) -> Transition {
        let Some(key) = self.stroke() else { return self.become_idle(now) };
        let concluded = matches!(self.work, Work::Publish | Work::WaitAck) && self.journaled();
        if concluded && !self.press_is_at(key) {
            let how =
                if self.work == Work::WaitAck { Acknowledgement::NextStroke } else { Acknowledgement::Never };
            self.close(key, how);
            return self.become_idle(now);
        }
        if self.work == Work::WaitAck {
            self.work = Work::Publish;
        }
        Transition::StrokeResumed
    }

    /// Becomes idle and sets the baseline of the stroke counter. Strokes missed in the same session are counted with
    /// the next stroke.
    pub(super) fn become_idle(&mut self, now: Duration) -> Transition {
        self.work = Work::Idle;
        if let Some(press) = self.press.as_ref().filter(|press| !press.trigger) {
            let same_session = self.counted.filter(|(session, _)| *session == press.session_id);
            self.counted = same_session.or(Some((press.session_id, press.stroke_id)));
        }
        if self.blocked() {
            self.work = Work::Blocked;
        } else if self.stroke_waits() {
            return self.accept_stroke(now, Transition::WaitingStrokeAccepted);
        }
        Transition::Synchronised
    }

    /// Journals the acknowledgement of a stroke.
    pub(super) fn close(&mut self, key: StrokeKey, how: Acknowledgement) {
        self.effects.push(Effect::Journal(Record::Acked { key, how }));
        self.unacked = None;
    }

    pub(super) fn press_is_at(&self, key: StrokeKey) -> bool {
        self.press
            .as_ref()
            .is_some_and(|press| (press.session_id, press.stroke_id) == (key.session, key.stroke))
    }

    pub(super) fn newly_stale(&self, now: Duration) -> bool {
        let beats = self.press.as_ref().is_some_and(|press| press.heartbeat.is_some());
        beats && !self.stale && now.saturating_sub(self.heartbeat_at) >= self.config.timeouts.heartbeat_in
    }

    pub(super) fn press_stale(&mut self) -> Transition {
        self.stale = true;
        self.alarm(Code::PressStale);
        Transition::HeartbeatLost
    }
}
