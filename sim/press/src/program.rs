//! The controller's program: the press side of the handshake, as the reference Structured Text has it.
//!
//! [`Program::step`] is one cycle of the controller, a pure function of its state, the H block and the time. Beyond
//! the reference it raises a baseline scan (a number of its own, bit 9 beside the trigger) and a rescan (bit 8, the
//! same stroke number, one attempt more); a result must then echo the attempt too.

use std::time::Duration;

use serde::Serialize;

use crate::registers::{HBlock, MAP_VERSION, control, h, status};

/// Times the program waits.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// From trigger to acceptance before the alarm.
    pub accept: Duration,
    /// From trigger to result before the press goes on without one.
    pub result: Duration,
    /// Host heartbeat standing still for this long: host dead.
    pub host: Duration,
    /// Between two counts of the own heartbeat.
    pub heartbeat: Duration,
    /// From taking a result to raising the acknowledge bit.
    pub ack_delay: Duration,
}

/// Why the host is asked for a scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// A bend was made.
    Stroke,
    /// The plate is to be scanned as it lies.
    Baseline,
    /// The last stroke is to be scanned again.
    Rescan,
}

/// A request that waits for its result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Request {
    /// Why.
    pub cause: Cause,
    /// When the trigger rose.
    pub raised: Duration,
    /// When the host's echo was seen.
    pub accepted: Option<Duration>,
    accept_alarm: bool,
}

/// What one cycle brought about.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// The host echoed the stroke number.
    Accepted,
    /// No echo within the accept limit; the request stands.
    AcceptLate,
    /// The result, as it stood in the H block when it was taken.
    ResultAccepted(Request, Box<HBlock>),
    /// No result within the limit: the press goes on without one.
    ResultTimeout(Request),
    /// The host's heartbeat stopped: the press goes on without a result.
    HostDead(Request),
}

/// State of the program from one cycle to the next.
#[derive(Clone, Debug)]
pub struct Program {
    limits: Limits,
    /// Number of the latest stroke, 0 before the first.
    pub stroke_id: u16,
    /// Number of this run of the program, or of this part.
    pub session_id: u16,
    /// Rescans of the latest stroke.
    pub attempt: u16,
    /// The program never acknowledges; results then end with the next trigger.
    pub withholds_ack: bool,
    /// Results marked as simulated are taken; a real press must not, a training cell has no others.
    pub takes_simulated: bool,
    request: Option<Request>,
    ack_at: Option<Duration>,
    heartbeat: u16,
    beat_at: Duration,
    host_beat: Option<u16>,
    host_beat_at: Option<Duration>,
}

impl Program {
    /// A program that starts at `now` with no stroke made.
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

    /// The request that waits for a result.
    #[must_use]
    pub fn request(&self) -> Option<&Request> {
        self.request.as_ref()
    }

    /// Own heartbeat word.
    #[must_use]
    pub fn heartbeat(&self) -> u16 {
        self.heartbeat
    }

    /// Whether the host's heartbeat has moved within its limit.
    #[must_use]
    pub fn host_alive(&self, now: Duration) -> bool {
        self.host_beat_at.is_some_and(|at| now - at < self.limits.host)
    }

    /// Asks the host for a scan; a request that still waits is given up and returned.
    pub fn raise(&mut self, cause: Cause, now: Duration) -> Option<Request> {
        if cause == Cause::Rescan {
            self.attempt += 1;
        } else {
            self.stroke_id = next_stroke_id(self.stroke_id);
            self.attempt = 0;
        }
        self.request.replace(Request { cause, raised: now, accepted: None, accept_alarm: false })
    }

    /// Takes the request back: the trigger falls without a result.
    pub fn withdraw(&mut self) {
        self.request = None;
    }

    /// A new session, as after a part change; a waiting request is given up.
    pub fn begin_session(&mut self, session_id: u16) {
        self.session_id = session_id;
        self.attempt = 0;
        self.request = None;
        self.ack_at = None;
    }

    /// The control bits this program owns: trigger, acknowledge, rescan, baseline.
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

    /// One cycle.
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

    /// The echo of the stroke number; a rescan has the same number, so there the host must be busy with it or done.
    fn accepts(&self, host: &HBlock, request: &Request) -> bool {
        host.word(h::ACK_STROKE_ID) == self.stroke_id
            && host.word(h::SESSION_ECHO) == self.session_id
            && (request.cause != Cause::Rescan
                || host.status(status::BUSY)
                || host.word(h::ATTEMPT_ECHO) == self.attempt)
    }

    /// The rule by which a press may use a result at all.
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

/// The number after `stroke_id`: 65535 is followed by 1, 0 means none.
#[must_use]
pub fn next_stroke_id(stroke_id: u16) -> u16 {
    stroke_id.checked_add(1).unwrap_or(1)
}
