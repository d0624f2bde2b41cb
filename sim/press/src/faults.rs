//! Faults on request: what a shop's network and a controller do to a host, each behind a switch with a probability.
//!
//! All switches are off by default and draw from one seed, so a run can be repeated. [`LineFaults`] damage answers on
//! their way to the host, [`StrokeFaults`] are a controller's own bad habits.

use serde::{Deserialize, Serialize};

/// Faults of the line; each probability is per request, at most one fault hits one request.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct LineFaults {
    /// The answer comes `late_ms` later; later answers may overtake it.
    pub late: f64,
    /// Shortest and longest delay of a late answer.
    pub late_ms: [u64; 2],
    /// The connection is reset instead of the request being served.
    pub reset: f64,
    /// The connection is reset after the request was served: the host cannot know.
    pub reset_after: f64,
    /// Served, never answered.
    pub no_answer: f64,
    /// Another transaction id in the answer (TCP only).
    pub wrong_transaction: f64,
    /// Another unit id in the answer.
    pub wrong_unit: f64,
    /// Another function code in the answer.
    pub wrong_function: f64,
    /// One register less than was asked, in a frame that is whole.
    pub short: f64,
    /// One register more than was asked, in a frame that is whole.
    pub long: f64,
    /// An exception instead of the service.
    pub exception: f64,
    /// Code of that exception.
    pub exception_code: u8,
    /// Random bytes before the answer.
    pub noise: f64,
    /// One bit of the answer is flipped; on RTU the check sum tells, on TCP nothing does, so it hits the header there.
    pub bit_flip: f64,
    /// Only the first half of the answer.
    pub half: f64,
    /// The answer twice.
    pub twice: f64,
    /// The answer byte by byte.
    pub dribble: f64,
    /// Every request comes back before its answer, as two-wire adapters do (RTU only).
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

/// What happens to one request and its answer.
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

    /// The fault of the next request, drawn in the order of the fields.
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

    /// Sum of all probabilities; above 1 the last switches would never act.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.table().iter().map(|(_, probability)| probability).sum()
    }
}

/// Bad habits of the controller's program; each probability is per stroke.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct StrokeFaults {
    /// The number and its copy differ for `torn_ms` while the trigger stands already.
    pub torn: f64,
    /// How long a block stays torn.
    pub torn_ms: u64,
    /// The trigger falls and rises again for `bounce_ms` before it stands.
    pub bounce: f64,
    /// How long a trigger bounces; it changes every cycle.
    pub bounce_ms: u64,
    /// After the result the trigger rises again with the same number for `repeat_ms`.
    pub repeat_trigger: f64,
    /// How long the repeated trigger stands.
    pub repeat_ms: u64,
    /// A number is left out: the host sees one stroke too few.
    pub skip: f64,
    /// The counter starts again from 0 in a new session.
    pub counter_back: f64,
    /// The result is never acknowledged.
    pub no_ack: f64,
    /// The next stroke comes while the host is busy with this one.
    pub hasty: f64,
    /// How long the trigger of a hasty stroke stands; 0 until it is taken.
    pub hasty_ms: u64,
    /// The controller restarts while the stroke waits for its result.
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

/// The faults drawn for one stroke.
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
    /// The faults of the next stroke; each switch draws once, so one switch does not move another's draws.
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
