//! PLC program: the press side of the handshake, after the reference implementation in Structured Text.
//!
//! [`Program::step`] is one cycle of the controller, a pure function of its state, the H block and the time. Beyond
//! the reference it requests a baseline scan (own stroke number, bit 9 beside the trigger) and a rescan (bit 8, the
//! same stroke number, next attempt); a result must then echo the attempt too.

use std::time::Duration;

use serde::Serialize;

use crate::registers::{HBlock, MAP_VERSION, control, h, status};

/// Time limits of the program.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// From trigger to acceptance before the alarm.
    pub accept: Duration,
    /// From trigger to result before the press continues without one.
    pub result: Duration,
    /// Unchanged host heartbeat after which the host counts as dead.
    pub host: Duration,
    /// Interval of the press's heartbeat.
    pub heartbeat: Duration,
    /// From accepting a result to setting the acknowledge bit.
    pub ack_delay: Duration,
}

/// Cause of a scan request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// Stroke made.
    Stroke,
    /// Baseline scan without a bend.
    Baseline,
    /// Repeated scan of the last stroke.
    Rescan,
}

/// Pending request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Request {
    /// Cause.
    pub cause: Cause,
    /// Time at which the trigger was set.
    pub raised: Duration,
    /// Time of the host's echo.
    pub accepted: Option<Duration>,
    accept_alarm: bool,
}

/// Event of one cycle.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// Stroke number echoed by the host.
    Accepted,
    /// No echo within the accept limit; the request stays pending.
    AcceptLate,
    /// Result accepted, with the H block at that time.
    ResultAccepted(Request, Box<HBlock>),
    /// No result within the limit: the press continues without one.
    ResultTimeout(Request),
    /// Host heartbeat stopped: the press continues without a result.
    HostDead(Request),
}

/// State of the program.
#[derive(Clone, Debug)]
pub struct Program {
    limits: Limits,
    /// Number of the latest stroke, 0 before the first.
    pub stroke_id: u16,
    /// Number of this run of the program, or of this part.
    pub session_id: u16,
    /// Number of rescans of the latest stroke.
    pub attempt: u16,
    /// Fault: the program never acknowledges; results then end with the next trigger.
    pub withholds_ack: bool,
    /// Accepts results marked as simulated. A real press must not; a training cell has no others.
    pub takes_simulated: bool,
    request: Option<Request>,
    ack_at: Option<Duration>,
    heartbeat: u16,
    beat_at: Duration,
    host_beat: Option<u16>,
    host_beat_at: Option<Duration>,
}

impl Program {
    /// Creates a program that starts at `now` with no stroke made.
    #[must_use]
    pub fn new(limits: Limits, session_id: u16, now: Duration) -> Self {
        Self {
            limits,
            stroke_id: 0,
            session_id,
            attempt: 0,
            withholds_ack: false,
            takes_simulated: false,
            request: None,
            ack_at: None,
            heartbeat: 0,
            beat_at: now,
            host_beat: None,
            host_beat_at: None,
        }
    }

    /// Returns the pending request.
    #[must_use]
    pub fn request(&self) -> Option<&Request> {
        self.request.as_ref()
    }

    /// Returns the press's heartbeat word.
    #[must_use]
    pub fn heartbeat(&self) -> u16 {
        self.heartbeat
    }

    /// Returns whether the host's heartbeat has changed within its limit.
    #[must_use]
    pub fn host_alive(&self, now: Duration) -> bool {
        self.host_beat_at.is_some_and(|at| now - at < self.limits.host)
    }

    /// Requests a scan; a pending request is superseded and returned.
    pub fn raise(&mut self, cause: Cause, now: Duration) -> Option<Request> {
        if cause == Cause::Rescan {
            self.attempt += 1;
        } else {
            self.stroke_id = next_stroke_id(self.stroke_id);
            self.attempt = 0;
        }
        self.request.replace(Request { cause, raised: now, accepted: None, accept_alarm: false })
    }

    /// Withdraws the request: the trigger is cleared without a result.
    pub fn withdraw(&mut self) {
        self.request = None;
    }

    /// Starts a new session, as after a part change; a pending request is dropped.
    pub fn begin_session(&mut self, session_id: u16) {
        self.session_id = session_id;
        self.attempt = 0;
        self.request = None;
        self.ack_at = None;
    }

    /// Returns the control bits of the program: trigger, acknowledge, rescan, baseline.
    #[must_use]
    pub fn control(&self, now: Duration) -> u16 {
        let asks = match self.request {
            Some(Request { cause, accepted: None, .. }) => match cause {
                Cause::Stroke => control::TRIGGER,
                Cause::Baseline => control::TRIGGER | control::BASELINE,
                Cause::Rescan => control::RESCAN,
            },
            _ => 0,
        };
        let acks = self.ack_at.is_some_and(|at| now >= at);
        asks | if acks { control::ACK } else { 0 }
    }

    /// Executes one cycle.
    pub fn step(&mut self, host: &HBlock, now: Duration) -> Vec<Event> {
        self.beat(host, now);
        let mut events = Vec::new();
        if let Some(mut request) = self.request {
            if request.accepted.is_none() && self.accepts(host, &request) {
                request.accepted = Some(now);
                events.push(Event::Accepted);
            } else if request.accepted.is_none()
                && !request.accept_alarm
                && now - request.raised >= self.limits.accept
            {
                request.accept_alarm = true;
                events.push(Event::AcceptLate);
            }
            self.request = Some(request);
            if request.accepted.is_some() && self.holds(host, now) {
                self.request = None;
                if !self.withholds_ack {
                    self.ack_at = Some(now + self.limits.ack_delay);
                }
                events.push(Event::ResultAccepted(request, Box::new(*host)));
            } else if now - request.raised >= self.limits.result {
                self.request = None;
                events.push(Event::ResultTimeout(request));
            } else if !self.host_alive(now) && now - request.raised >= self.limits.host {
                self.request = None;
                events.push(Event::HostDead(request));
            }
        }
        if self.ack_at.is_some_and(|at| now > at) && !host.status(status::RESULT_VALID) {
            self.ack_at = None;
        }
        events
    }

    fn beat(&mut self, host: &HBlock, now: Duration) {
        if now - self.beat_at >= self.limits.heartbeat {
            self.heartbeat = self.heartbeat.wrapping_add(1);
            self.beat_at = now;
        }
        let beat = host.word(h::HEARTBEAT);
        if self.host_beat.is_some_and(|before| before != beat) {
            self.host_beat_at = Some(now);
        }
        self.host_beat = Some(beat);
    }

    /// Returns whether the host has echoed the stroke number; a rescan has the same number, so the host must also be
    /// busy with it or done.
    fn accepts(&self, host: &HBlock, request: &Request) -> bool {
        host.word(h::ACK_STROKE_ID) == self.stroke_id
            && host.word(h::SESSION_ECHO) == self.session_id
            && (request.cause != Cause::Rescan
                || host.status(status::BUSY)
                || host.word(h::ATTEMPT_ECHO) == self.attempt)
    }

    /// Returns whether the result in the H block satisfies all conditions for its use.
    fn holds(&self, host: &HBlock, now: Duration) -> bool {
        host.word(h::MAP_VERSION) == MAP_VERSION
            && host.status(status::RESULT_VALID)
            && host.word(h::SESSION_ECHO) == self.session_id
            && host.word(h::RESULT_STROKE_ID) == self.stroke_id
            && host.word(h::ATTEMPT_ECHO) == self.attempt
            && host.whole()
            && (self.takes_simulated || !host.status(status::SIMULATED))
            && self.host_alive(now)
    }
}

/// Returns the number after `stroke_id`: 65535 is followed by 1, 0 means none.
#[must_use]
pub fn next_stroke_id(stroke_id: u16) -> u16 {
    stroke_id.checked_add(1).unwrap_or(1)
}
