//! Faults that can be injected: faults of the line ([`LineFaults`]) and faults of the PLC program ([`StrokeFaults`]).
//!
//! All probabilities are 0 by default. Faults are drawn from one seed, so that a run can be repeated.

use serde::{Deserialize, Serialize};

/// Probabilities of line faults per request; at most one fault affects a request.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct LineFaults {
    /// The answer is delayed by `late_ms`; later answers may overtake it.
    pub late: f64,
    /// Shortest and longest delay of a late answer.
    pub late_ms: [u64; 2],
    /// The connection is reset before the request is served.
    pub reset: f64,
    /// The connection is reset after the request was served, which the host cannot detect.
    pub reset_after: f64,
    /// The request is served but not answered.
    pub no_answer: f64,
    /// The answer has another transaction id (TCP only).
    pub wrong_transaction: f64,
    /// The answer has another unit id.
    pub wrong_unit: f64,
    /// The answer has another function code.
    pub wrong_function: f64,
    /// The answer has one register less than requested, in a valid frame.
    pub short: f64,
    /// The answer has one register more than requested, in a valid frame.
    pub long: f64,
    /// The request is answered by an exception and not served.
    pub exception: f64,
    /// Code of that exception.
    pub exception_code: u8,
    /// Random bytes precede the answer.
    pub noise: f64,
    /// One bit of the answer is flipped; with TCP framing, which has no checksum, only in the first six header bytes.
    pub bit_flip: f64,
    /// Only the first half of the answer is sent.
    pub half: f64,
    /// The answer is sent twice.
    pub twice: f64,
    /// The answer is sent byte by byte.
    pub dribble: f64,
    /// Every request is echoed before its answer, as by two-wire adapters (RTU only).
    pub echo: bool,
}

impl Default for LineFaults {
    fn default() -> Self {
        Self {
            late: 0.0,
            late_ms: [200, 900],
            reset: 0.0,
            reset_after: 0.0,
            no_answer: 0.0,
            wrong_transaction: 0.0,
            wrong_unit: 0.0,
            wrong_function: 0.0,
            short: 0.0,
            long: 0.0,
            exception: 0.0,
            exception_code: 6,
            noise: 0.0,
            bit_flip: 0.0,
            half: 0.0,
            twice: 0.0,
            dribble: 0.0,
            echo: false,
        }
    }
}

/// Fault of one request and its answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum LineFault {
    /// See [`LineFaults::late`].
    Late,
    /// See [`LineFaults::reset`].
    Reset,
    /// See [`LineFaults::reset_after`].
    ResetAfter,
    /// See [`LineFaults::no_answer`].
    NoAnswer,
    /// See [`LineFaults::wrong_transaction`].
    WrongTransaction,
    /// See [`LineFaults::wrong_unit`].
    WrongUnit,
    /// See [`LineFaults::wrong_function`].
    WrongFunction,
    /// See [`LineFaults::short`].
    Short,
    /// See [`LineFaults::long`].
    Long,
    /// See [`LineFaults::exception`].
    Exception,
    /// See [`LineFaults::noise`].
    Noise,
    /// See [`LineFaults::bit_flip`].
    BitFlip,
    /// See [`LineFaults::half`].
    Half,
    /// See [`LineFaults::twice`].
    Twice,
    /// See [`LineFaults::dribble`].
    Dribble,
}

impl LineFaults {
    fn table(&self) -> [(LineFault, f64); 15] {
        [
            (LineFault::Late, self.late),
            (LineFault::Reset, self.reset),
            (LineFault::ResetAfter, self.reset_after),
            (LineFault::NoAnswer, self.no_answer),
            (LineFault::WrongTransaction, self.wrong_transaction),
            (LineFault::WrongUnit, self.wrong_unit),
            (LineFault::WrongFunction, self.wrong_function),
            (LineFault::Short, self.short),
            (LineFault::Long, self.long),
            (LineFault::Exception, self.exception),
            (LineFault::Noise, self.noise),
            (LineFault::BitFlip, self.bit_flip),
            (LineFault::Half, self.half),
            (LineFault::Twice, self.twice),
            (LineFault::Dribble, self.dribble),
        ]
    }

    /// Draws the fault of the next request, in the order of the fields.
    pub fn draw(&self, random: &mut fastrand::Rng) -> Option<LineFault> {
        let mut at = random.f64();
        for (fault, probability) in self.table() {
            if at < probability {
                return Some(fault);
            }
            at -= probability;
        }
        None
    }

    /// Returns the sum of all probabilities, which must not exceed 1.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.table().iter().map(|(_, probability)| probability).sum()
    }
}

/// Probabilities of faults of the PLC program, per stroke.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct StrokeFaults {
    /// The stroke number and its copy differ for `torn_ms` after the trigger is set.
    pub torn: f64,
    /// Duration of the inconsistent block.
    pub torn_ms: u64,
    /// The trigger toggles for `bounce_ms` before it is stable.
    pub bounce: f64,
    /// Duration of the bouncing; the trigger toggles every cycle.
    pub bounce_ms: u64,
    /// After the result the trigger is set again with the same number for `repeat_ms`.
    pub repeat_trigger: f64,
    /// Duration of the repeated trigger.
    pub repeat_ms: u64,
    /// A stroke number is skipped: the host misses one stroke.
    pub skip: f64,
    /// The stroke counter restarts from 0 in a new session.
    pub counter_back: f64,
    /// The result is never acknowledged.
    pub no_ack: f64,
    /// The next stroke is made while the host is busy with this one.
    pub hasty: f64,
    /// Duration of the trigger of a hasty stroke; 0: until it is accepted.
    pub hasty_ms: u64,
    /// The controller restarts while a stroke waits for its result.
    pub reboot: f64,
}

impl Default for StrokeFaults {
    fn default() -> Self {
        Self {
            torn: 0.0,
            torn_ms: 60,
            bounce: 0.0,
            bounce_ms: 40,
            repeat_trigger: 0.0,
            repeat_ms: 200,
            skip: 0.0,
            counter_back: 0.0,
            no_ack: 0.0,
            hasty: 0.0,
            hasty_ms: 0,
            reboot: 0.0,
        }
    }
}

/// Faults drawn for one stroke.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StrokePlan {
    /// See [`StrokeFaults::torn`].
    pub torn: bool,
    /// See [`StrokeFaults::bounce`].
    pub bounce: bool,
    /// See [`StrokeFaults::repeat_trigger`].
    pub repeat_trigger: bool,
    /// See [`StrokeFaults::skip`].
    pub skip: bool,
    /// See [`StrokeFaults::counter_back`].
    pub counter_back: bool,
    /// See [`StrokeFaults::no_ack`].
    pub no_ack: bool,
    /// See [`StrokeFaults::hasty`].
    pub hasty: bool,
    /// See [`StrokeFaults::reboot`].
    pub reboot: bool,
}

impl StrokeFaults {
    /// Draws the faults of the next stroke; each fault draws once, so that changing one probability does not affect the
    /// others.
    pub fn draw(&self, random: &mut fastrand::Rng) -> StrokePlan {
        let mut hit = |probability: f64| random.f64() < probability;
        StrokePlan {
            torn: hit(self.torn),
            bounce: hit(self.bounce),
            repeat_trigger: hit(self.repeat_trigger),
            skip: hit(self.skip),
            counter_back: hit(self.counter_back),
            no_ack: hit(self.no_ack),
            hasty: hit(self.hasty),
            reboot: hit(self.reboot),
        }
    }
}
