//! Simulated press: ram, plate, program and injected faults, advanced by one controller cycle at a time.
//!
//! [`Press::step`] reads the H block from the registers, runs the program, moves the ram and writes the P block. It is
//! a function of the press, the registers and the time, so that tests run it without a clock or a socket.

use std::time::Duration;

use platen_sim_plate::{PlateState, Reply, Stroke};

use crate::config::Config;
use crate::counters::{AcceptedResult, Counters, WriteMonitor, whole_ms};
use crate::driven_ram::OrderedStroke;
use crate::faults::StrokePlan;
use crate::forming_model::{FormingModel, Next};
use crate::program::{Cause, Event, Limits, Program, Request};
use crate::registers::{HBlock, P_LEN, Table, ascii_words, control, h, p, status};
use crate::{Error, Result};

/// Duration of the part_end bit before the next part.
const PART_END: Duration = Duration::from_millis(600);

/// Phase of the press cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    /// Controller restarting: registers are 0 until then.
    Void { until: Duration },
    /// Ram up; no action before then.
    Rest { until: Duration },
    /// Ram moving down for this stroke.
    Down { until: Duration, stroke: Stroke },
    /// Ram moving up.
    Up { until: Duration },
    /// Request waiting for its result.
    Wait,
    /// Part leaving the press.
    PartEnd { until: Duration },
    /// All parts done.
    Done,
}

/// Press with one plate.
#[derive(Clone, Debug)]
pub struct Press {
    config: Config,
    program: Program,
    forming: FormingModel,
    phase: Phase,
    plan: StrokePlan,
    random: fastrand::Rng,
    part_id: u32,
    baseline_due: bool,
    /// End of a repeated trigger.
    repeat_until: Option<Duration>,
    /// End of a hasty stroke's trigger.
    hasty_until: Option<Duration>,
    bounced: bool,
    last_tail: u16,
    /// Registers are frozen until then.
    pub(crate) halted_until: Option<Duration>,
    /// Control bits forced to 1.
    pub(crate) forced: u16,
    /// Control bits forced to 0.
    pub(crate) masked: u16,
    pub(crate) automatic: bool,
    /// Counters of the press.
    pub counters: Counters,
    /// Monitor of all writes.
    pub write_monitor: WriteMonitor,
}

impl Press {
    /// Creates a press that starts at time 0.
    ///
    /// # Errors
    /// [`Error::Config`] and [`Error::Plate`] for an invalid configuration.
    pub fn new(config: &Config) -> Result<Self> {
        config.check()?;
        let mut random = fastrand::Rng::with_seed(config.seed);
        let session_id = random.u16(1..);
        let mut press = Self {
            program: new_program(config, session_id, Duration::ZERO),
            forming: FormingModel::new(&config.plate, config.strategy, config.part_id)?,
            phase: Phase::Rest { until: Duration::from_millis(config.timings.start_ms) },
            plan: StrokePlan::default(),
            random,
            part_id: config.part_id,
            baseline_due: config.baseline,
            repeat_until: None,
            hasty_until: None,
            bounced: false,
            last_tail: config.stroke_id,
            halted_until: None,
            forced: 0,
            masked: 0,
            automatic: config.automatic,
            counters: Counters { parts: 1, ..Counters::default() },
            write_monitor: WriteMonitor::default(),
            config: config.clone(),
        };
        press.program.stroke_id = config.stroke_id;
        Ok(press)
    }

    /// Returns the plate for the scanner, or the reason why it cannot be scanned.
    #[must_use]
    pub fn plate(&self) -> Reply {
        match self.phase {
            Phase::Down { .. } | Phase::Up { .. } => {
                Reply::Error(String::from("the plate is moving; wait until the ram is up"))
            }
            Phase::PartEnd { .. } | Phase::Done => Reply::Plate(None),
            _ => Reply::Plate(Some(self.forming.state().clone().into())),
        }
    }

    /// Returns the state of the plate, also while it moves.
    #[must_use]
    pub fn plate_state(&self) -> &PlateState {
        self.forming.state()
    }

    /// Returns the program.
    #[must_use]
    pub fn program(&self) -> &Program {
        &self.program
    }

    /// Executes one cycle at the time `now` since the start of the press.
    ///
    /// # Errors
    /// [`Error::Plate`] when a stroke cannot be made.
    pub fn step(&mut self, table: &mut Table, now: Duration) -> Result<()> {
        self.counters.now_ms = whole_ms(now);
        if self.halted_until.is_some_and(|until| now < until) {
            return Ok(());
        }
        self.halted_until = None;
        if let Phase::Void { until } = self.phase {
            table.clear();
            if now < until {
                return Ok(());
            }
            let session_id = self.random.u16(1..);
            self.program = new_program(&self.config, session_id, now);
            self.phase = Phase::Rest { until: now };
        }
        let host = table.h_block();
        for event in self.program.step(&host, now) {
            self.record(event, now);
        }
        self.apply_stroke_faults(table, &host, now)?;
        if matches!(self.phase, Phase::Void { .. }) {
            return Ok(());
        }
        self.advance(&host, now)?;
        table.set_p_block(&self.p_block(now));
        Ok(())
    }

    /// Makes a stroke at once, whatever the state of the host.
    ///
    /// # Errors
    /// [`Error::Refused`] after the last part, [`Error::Plate`] when the stroke cannot be made.
    pub fn stroke(&mut self, now: Duration) -> Result<()> {
        match (self.phase, self.forming.next(u16::MAX)) {
            (Phase::Done | Phase::PartEnd { .. } | Phase::Void { .. }, _) => {
                Err(Error::Refused("the press is empty"))
            }
            (_, Next::Bend(stroke)) => {
                self.forming.bend(&stroke)?;
                self.raise(Cause::Stroke, now);
                Ok(())
            }
            _ => Err(Error::Refused("the programme of the plate has no further stroke")),
        }
    }

    /// Requests a baseline scan or a rescan.
    ///
    /// # Errors
    /// [`Error::Refused`] while a request is pending, or when there is no stroke to scan again.
    pub fn request(&mut self, cause: Cause, now: Duration) -> Result<()> {
        if self.program.request().is_some() {
            return Err(Error::Refused("a request is pending already"));
        }
        if cause == Cause::Rescan && self.program.stroke_id == 0 {
            return Err(Error::Refused("no stroke has been made"));
        }
        self.raise(cause, now);
        Ok(())
    }

    /// Accepts the operator's order for the next stroke.
    ///
    /// # Errors
    /// [`Error::Refused`] while a stroke is being made or measured.
    pub fn order(&mut self, order: &OrderedStroke) -> Result<()> {
        match self.phase {
            Phase::Rest { .. } if self.program.request().is_none() => {
                self.forming.order(order);
                Ok(())
            }
            _ => Err(Error::Refused("the press is not at rest")),
        }
    }

    /// Ends the part; the next one follows if any.
    pub fn end_part(&mut self, now: Duration) {
        self.program.withdraw();
        self.phase = Phase::PartEnd { until: now + PART_END };
    }

    /// Restarts the controller: registers 0, then a new session; the plate is unchanged.
    pub fn restart(&mut self, table: &mut Table, now: Duration) {
        table.clear();
        self.counters.restarts += 1;
        self.repeat_until = None;
        self.hasty_until = None;
        self.phase = Phase::Void { until: now + Duration::from_millis(self.config.timings.restart_ms) };
    }

    /// Starts a new session with the stroke counter at `stroke_id`.
    pub fn new_session(&mut self, stroke_id: u16) {
        self.program.begin_session(self.random.u16(1..));
        self.program.stroke_id = stroke_id;
    }

    /// Sets the stroke counter within the present session.
    pub fn set_counter(&mut self, stroke_id: u16) {
        self.program.stroke_id = stroke_id;
    }

    /// Changes plant number or map version.
    pub(crate) fn set_identity(&mut self, press_id: Option<u16>, map_version: Option<u16>) {
        self.config.press_id = press_id.unwrap_or(self.config.press_id);
        self.config.map_version = map_version.unwrap_or(self.config.map_version);
    }

    /// Replaces the faults of the program from the next stroke on.
    pub fn set_stroke_faults(&mut self, faults: crate::faults::StrokeFaults) {
        self.config.stroke_faults = faults;
    }

    fn raise(&mut self, cause: Cause, now: Duration) {
        if cause == Cause::Stroke {
            self.plan = self.config.stroke_faults.draw(&mut self.random);
            if self.plan.counter_back {
                self.new_session(0);
            }
            if self.plan.skip {
                self.program.stroke_id = crate::program::next_stroke_id(self.program.stroke_id);
                self.counters.skipped += 1;
            }
        } else {
            self.plan = StrokePlan::default();
        }
        self.program.withholds_ack = self.plan.no_ack;
        self.repeat_until = None;
        self.hasty_until = None;
        if self.program.raise(cause, now).is_some() {
            self.counters.superseded += 1;
        }
        match cause {
            Cause::Stroke => self.counters.strokes += 1,
            Cause::Baseline => self.counters.baselines += 1,
            Cause::Rescan => self.counters.rescans += 1,
        }
        self.phase = Phase::Wait;
    }

    fn record(&mut self, event: Event, now: Duration) {
        match event {
            Event::Accepted => {}
            Event::AcceptLate => self.counters.accepted_late += 1,
            Event::ResultTimeout(request) => {
                self.counters.result_timeouts += 1;
                if request.cause == Cause::Baseline {
                    self.baseline_due = false;
                }
            }
            Event::HostDead(_) => self.counters.host_deaths += 1,
            Event::ResultAccepted(request, host) => {
                self.counters.check_result(&host, self.config.recipe_id);
                let taken = self.accepted_result(&request, &host, now);
                self.counters.taken.push(taken);
                self.forming.record_result(&host);
                if request.cause == Cause::Baseline {
                    self.baseline_due = false;
                }
                if self.plan.repeat_trigger {
                    self.repeat_until =
                        Some(now + Duration::from_millis(self.config.stroke_faults.repeat_ms));
                }
            }
        }
    }

    fn accepted_result(&self, request: &Request, host: &HBlock, now: Duration) -> AcceptedResult {
        AcceptedResult {
            cause: request.cause,
            stroke_id: self.program.stroke_id,
            session_id: self.program.session_id,
            attempt: self.program.attempt,
            part_id: self.part_id,
            bends: self.forming.state().strokes,
            accepted_ms: request.accepted.map_or(0, |at| whole_ms(at - request.raised)),
            result_ms: whole_ms(now - request.raised),
            verdict: host.verdict(),
            words: host.0.to_vec(),
        }
    }

    /// Applies the faults that act while a request is pending.
    fn apply_stroke_faults(&mut self, table: &mut Table, host: &HBlock, now: Duration) -> Result<()> {
        self.repeat_until = self.repeat_until.filter(|&until| now < until);
        let request = self.program.request().copied();
        let accepted = request.is_some_and(|request| request.accepted.is_some());
        if let Some(stroke) =
            table.advised_after().filter(|stroke| accepted && *stroke != self.program.stroke_id)
        {
            self.counters.wrong(format!(
                "the advice after stroke {stroke} stands while {} is measured",
                self.program.stroke_id
            ));
        }
        if self.hasty_until.is_some_and(|until| now >= until) {
            self.hasty_until = None;
            if request.is_some() && !accepted {
                self.program.withdraw();
                self.counters.lost_while_busy += 1;
            }
        }
        if self.plan.torn && host.word(h::ACK_STROKE_ID) == torn(self.program.stroke_id) {
            let number = torn(self.program.stroke_id);
            self.counters
                .wrong(format!("stroke {}: the torn number {number} was accepted", self.program.stroke_id));
            self.plan.torn = false;
        }
        if accepted && host.status(status::BUSY) {
            if std::mem::take(&mut self.plan.hasty) {
                let hold = Duration::from_millis(self.config.stroke_faults.hasty_ms);
                self.stroke(now)?;
                self.plan = StrokePlan::default();
                self.hasty_until = (!hold.is_zero()).then(|| now + hold);
            } else if std::mem::take(&mut self.plan.reboot) {
                self.restart(table, now);
            }
        }
        Ok(())
    }

    /// Moves the ram and changes the phase.
    fn advance(&mut self, host: &HBlock, now: Duration) -> Result<()> {
        let ms = Duration::from_millis;
        match self.phase {
            Phase::Rest { until } if now >= until && self.automatic => self.begin(host, now)?,
            Phase::Down { until, stroke } if now >= until => {
                self.forming.bend(&stroke)?;
                self.phase = Phase::Up { until: now + ms(self.config.timings.up_ms) };
            }
            Phase::Up { until } if now >= until => self.raise(Cause::Stroke, now),
            Phase::Wait if self.program.request().is_none() && self.repeat_until.is_none() => {
                self.phase = Phase::Rest { until: now + ms(self.config.timings.between_ms) };
            }
            Phase::PartEnd { until } if now >= until => self.next_part(now)?,
            _ => {}
        }
        Ok(())
    }

    /// Starts the next action on this plate once the host is ready.
    fn begin(&mut self, host: &HBlock, now: Duration) -> Result<()> {
        let ready = self.program.host_alive(now) && host.status(status::READY);
        if self.config.wait_ready && !ready {
            return Ok(());
        }
        if self.baseline_due {
            self.raise(Cause::Baseline, now);
            return Ok(());
        }
        let next = if self.forming.state().strokes < self.config.strokes {
            self.forming.next(self.program.attempt)
        } else {
            Next::End
        };
        match next {
            Next::Bend(stroke) => {
                let until = now + Duration::from_millis(self.config.timings.down_ms);
                self.phase = Phase::Down { until, stroke };
            }
            Next::Wait => {}
            Next::Rescan => self.raise(Cause::Rescan, now),
            Next::End => self.end_part(now),
        }
        Ok(())
    }

    fn next_part(&mut self, now: Duration) -> Result<()> {
        if self.counters.parts >= u64::from(self.config.parts) {
            self.counters.done = true;
            self.phase = Phase::Done;
            return Ok(());
        }
        self.counters.parts += 1;
        self.part_id += 1;
        self.forming = FormingModel::new(&self.config.plate, self.config.strategy, self.part_id)?;
        self.baseline_due = self.config.baseline;
        let stroke_id = self.program.stroke_id;
        self.new_session(stroke_id);
        self.phase = Phase::Rest { until: now };
        Ok(())
    }

    /// Returns the P block of this cycle.
    fn p_block(&mut self, now: Duration) -> [u16; P_LEN] {
        let moving = matches!(self.phase, Phase::Down { .. } | Phase::Up { .. });
        let leaving = matches!(self.phase, Phase::PartEnd { .. } | Phase::Done);
        let mut bits = control::ENABLE | self.program.control(now);
        bits |= if moving { 0 } else { control::CLEAR_TO_SCAN };
        bits |= if leaving { control::PART_END } else { 0 };
        bits |= if self.repeat_until.is_some() { control::TRIGGER } else { 0 };
        let stroke_id = self.program.stroke_id;
        let [mut head, mut tail] = [stroke_id, stroke_id];
        if let Some(Request { raised, accepted: None, .. }) = self.program.request() {
            let since = now.saturating_sub(*raised);
            let faults = &self.config.stroke_faults;
            if self.plan.bounce && since < Duration::from_millis(faults.bounce_ms) {
                self.bounced = !self.bounced;
                bits &= if self.bounced { !control::TRIGGER } else { !0 };
            }
            if self.plan.torn && since < Duration::from_millis(faults.torn_ms) {
                [head, tail] = [torn(stroke_id), self.last_tail];
            }
        }
        self.last_tail = tail;
        let [part_high, part_low] = [(self.part_id >> 16) as u16, self.part_id as u16];
        let mut block = [0; P_LEN];
        block[p::MAP_VERSION] = self.config.map_version;
        block[p::HEARTBEAT] = self.program.heartbeat();
        block[p::CONTROL] = (bits | self.forced) & !self.masked;
        block[p::STROKE_ID] = head;
        block[p::SESSION_ID] = self.program.session_id;
        block[p::RECIPE_ID] = self.config.recipe_id;
        block[p::PRESS_STATE] = match self.phase {
            Phase::Down { .. } => 3,
            Phase::Up { .. } => 5,
            _ => 2,
        };
        block[p::PRESS_ID] = self.config.press_id;
        block[p::PART_ID] = part_high;
        block[p::PART_ID + 1] = part_low;
        block[p::PART_NAME..p::PART_NAME + 8].copy_from_slice(&ascii_words(&self.config.part_name));
        block[p::BEND_INDEX] = u16::try_from(self.forming.state().strokes).unwrap_or(u16::MAX);
        block[p::THICKNESS] = (self.config.plate.blank.thickness_mm * 100.0).round() as u16;
        if let Some((die_id, depth_mm)) = self.forming.reported() {
            block[p::RAM_DEPTH] = ((depth_mm * 100.0).round() as i16).cast_unsigned();
            block[p::DIE_ID] = die_id;
        }
        block[p::ATTEMPT] = self.program.attempt;
        block[p::STROKE_ID_TAIL] = tail;
        block
    }
}

/// Returns a stroke number whose high byte has not been updated yet.
fn torn(stroke_id: u16) -> u16 {
    stroke_id ^ 0x0100
}

fn new_program(config: &Config, session_id: u16, now: Duration) -> Program {
    let ms = Duration::from_millis;
    let times = &config.timings;
    let limits = Limits {
        accept: ms(times.accept_ms),
        result: ms(times.result_ms),
        host: ms(times.host_ms),
        heartbeat: ms(times.heartbeat_ms),
        ack_delay: ms(times.ack_ms),
    };
    let mut program = Program::new(limits, session_id, now);
    program.takes_simulated = config.take_simulated;
    program
}
