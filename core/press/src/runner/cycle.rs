//! Cycle of the press side: poll, step of the handshake, reconciliation of the registers, execution of effects.
//!
//! The pauses between connections grow exponentially with jitter.

use std::hash::{BuildHasher, Hasher, RandomState};
use std::time::Duration;

use platen_plant::press::{Press, Role};
use tokio::time::{Instant, sleep, sleep_until};

use super::journal::{Done, Recorder};
use super::{Answer, Metrics, Order, PressSide, Status};
use crate::advice_block::AdviceWriter;
use crate::handshake::{Effect, Event, Handshake, LinkState, Transition, Work};
use crate::reconcile::Reconciler;
use crate::{Client, Code, Consequence, Link, LinkError, PressImage, Torn, Verdict, consequence, saturates};

/// Period of the read-back of the host's own block, on a fast link and on a serial line.
const READ_BACK: [Duration; 2] = [Duration::from_millis(500), Duration::from_secs(1)];
/// Longest time between two checks of the handshake's timers.
const TICK: Duration = Duration::from_millis(100);
/// Torn reads in a row before the alarm.
const TORN_LIMIT: u32 = 50;
/// Period of the status.
pub(super) const STATUS: Duration = Duration::from_millis(200);
/// Time for a press in the client role to read the safe registers.
const FAREWELL: Duration = Duration::from_millis(500);
/// Attempts to write the safe registers at the end.
const LAST_WRITES: u32 = 3;

/// Serves one press.
pub(super) struct Runner<L> {
    pub(super) press: Press,
    pub(super) handshake: Handshake,
    pub(super) registers: Reconciler,
    pub(super) advice: AdviceWriter,
    pub(super) client: Client<L>,
    pub(super) metrics: Metrics,
    pub(super) journal: Recorder,
    pub(super) side: PressSide,
    pub(super) clock: Clock,
    pub(super) faults: Faults,
    pub(super) last_press: Option<PressImage>,
    /// Words of the last read of the whole block.
    pub(super) last_words: Vec<u16>,
}

/// Due times.
pub(super) struct Clock {
    started: Instant,
    next_connect: Instant,
    /// Back-off after the next attempt to connect; zero after a connection that worked.
    backoff: Duration,
    connected: Instant,
    /// Start of the present loss of synchronisation.
    lost: Option<Instant>,
    delivered: Instant,
    next_poll: Instant,
    next_read_back: Instant,
    read_back_every: Duration,
    polled: Instant,
    triggered: Instant,
    busy_untold: bool,
    /// Time since which a result has waited for the press.
    result_since: Option<Instant>,
    next_status: Instant,
}

impl Clock {
    pub(super) fn start(press: &Press) -> Self {
        let now = Instant::now();
        Self {
            started: now,
            next_connect: now,
            backoff: Duration::ZERO,
            connected: now,
            lost: Some(now),
            delivered: now,
            next_poll: now,
            next_read_back: now,
            read_back_every: READ_BACK[usize::from(press.link.is_serial())],
            polled: now,
            triggered: now,
            busy_untold: false,
            result_since: None,
            next_status: now,
        }
    }
}

/// Exceptions and torn reads in a row.
#[derive(Default)]
pub(super) struct Faults {
    exceptions: u32,
    torn: u32,
    unit_lost: bool,
    unreachable_told: bool,
}

impl<L: Link> Runner<L> {
    pub(super) async fn run(mut self) {
        self.step(Event::Tick);
        while !self.stopped() {
            if let Err(error) = self.exchange().await {
                let was_online = self.handshake.state().link == LinkState::Online;
                self.fail(&error);
                if was_online && matches!(self.handshake.state().link, LinkState::Fault(_)) {
                    self.withdraw_ready().await;
                }
            }
            self.publish_status();
            let until = self.next_due();
            self.wait(until).await;
            self.step(Event::Tick);
        }
        self.write_safe_registers().await;
        if self.press.role == Role::Server {
            sleep(FAREWELL).await;
        }
        self.publish_status();
        self.client.disconnect();
        self.journal.finish().await;
    }

    fn stopped(&self) -> bool {
        matches!(self.handshake.state().link, LinkState::Stopped { .. })
    }

    /// Executes all that is due: connection, poll, read-back of the own block, write.
    async fn exchange(&mut self) -> Result<(), LinkError> {
        let now = Instant::now();
        if !self.client.connected() || self.faults.unit_lost {
            if now < self.clock.next_connect {
                return Ok(());
            }
            self.connect().await?;
        }
        if now >= self.clock.next_poll {
            self.clock.next_poll = now + self.press.link.poll;
            self.poll().await?;
        }
        let syncing = self.handshake.state().link == LinkState::Sync;
        if self.client.connected() && (syncing || Instant::now() >= self.clock.next_read_back) {
            self.read_back().await?;
        }
        self.write().await
    }

    async fn connect(&mut self) -> Result<(), LinkError> {
        if !self.client.connected() {
            self.client.connect().await?;
        }
        self.registers.forget();
        self.advice.forget();
        self.faults = Faults { unreachable_told: self.faults.unreachable_told, ..Faults::default() };
        self.clock.connected = Instant::now();
        self.clock.next_poll = self.clock.connected;
        self.step(Event::Connected);
        Ok(())
    }

    /// Reads the press: only its fast part while a slow line is idle, else the whole block.
    async fn poll(&mut self) -> Result<(), LinkError> {
        let block = self.press.map.read;
        let online = self.handshake.state().link == LinkState::Online;
        let fast =
            if self.press.link.is_serial() && online { self.press.map.fast_count() } else { block.count };
        let seen = Instant::now();
        let mut image = self.read_press(fast).await?;
        if let Ok(part) = &image
            && fast < block.count
            && (part.trigger || part.rescan)
        {
            image = self.read_press(block.count).await?;
        }
        match image {
            Ok(image) => {
                self.faults.torn = 0;
                self.last_press = Some(image.clone());
                self.clock.polled = seen;
                self.step(Event::Press(Box::new(image)));
            }
            Err(torn) => self.torn(torn),
        }
        Ok(())
    }

    async fn read_press(&mut self, count: u16) -> Result<Result<PressImage, Torn>, LinkError> {
        let words = self.client.read(&self.press.map.read, count).await?;
        self.faults.exceptions = 0;
        if count == self.press.map.read.count {
            self.last_words.clone_from(&words);
        }
        Ok(PressImage::decode(&self.press.map, self.press.press_id, &words))
    }

    fn torn(&mut self, torn: Torn) {
        self.metrics.torn_reads += 1;
        self.faults.torn += 1;
        self.clock.next_poll = Instant::now();
        if self.faults.torn == TORN_LIMIT {
            let detail = format!("stroke_id {} and stroke_id_tail {} differ", torn.head, torn.tail);
            self.alarm(Code::TornBlock, Some(detail));
        }
        if self.faults.torn >= TORN_LIMIT {
            self.clock.next_poll += self.press.link.poll;
        }
    }

    /// Reads the host's own block back, to detect a second host and a block that the press has lost.
    async fn read_back(&mut self) -> Result<(), LinkError> {
        let block = self.press.map.write;
        let words = self.client.read(&block, block.count).await?;
        self.clock.next_read_back = Instant::now() + self.clock.read_back_every;
        let seen = self.registers.read_back(words, self.handshake.image().owner);
        self.metrics.rewrites = self.registers.rewrites;
        self.step(Event::Host { owner: seen.owner, heartbeat: seen.heartbeat, mine: seen.mine });
        Ok(())
    }

    async fn write(&mut self) -> Result<(), LinkError> {
        if !self.client.connected() || !self.handshake.may_write() {
            return Ok(());
        }
        let image = self.handshake.image().clone();
        if !self.registers.is_due(&image) && self.handshake.state().work != Work::Publish {
            return self.advice.write(&mut self.client).await;
        }
        if self.registers.write(&mut self.client, &image, false).await? {
            if image.busy && std::mem::take(&mut self.clock.busy_untold) {
                self.metrics.trigger_to_busy.add(self.clock.triggered.elapsed());
            }
            self.step(Event::Written);
        }
        self.advice.write(&mut self.client).await
    }

    /// Writes the safe registers after a stop: no ready, busy or valid remains.
    async fn write_safe_registers(&mut self) {
        let image = self.handshake.image().clone();
        for _ in 0..LAST_WRITES {
            if !self.handshake.may_write() || !self.client.connected() {
                return;
            }
            self.advice.withdraw();
            let advice = self.advice.write(&mut self.client).await;
            match advice.and(self.registers.write(&mut self.client, &image, true).await) {
                Ok(_) => return,
                Err(error) => tracing::warn!(%error, "writing the safe registers failed"),
            }
        }
    }

    /// Withdraws ready and writes the reason after a fault, register by register: a controller that refuses another
    /// address or value may accept these.
    async fn withdraw_ready(&mut self) {
        let image = self.handshake.image().clone();
        if let Err(error) = self.registers.withdraw(&mut self.client, &image).await {
            tracing::warn!(%error, "ready could not be withdrawn; it stands until error_reset");
        }
    }

    /// Maps an error of the link to an event of the handshake.
    fn fail(&mut self, error: &LinkError) {
        tracing::debug!(%error, "link");
        match error {
            LinkError::Exception { code, .. } => self.refused(*code, error),
            LinkError::Refused { .. } => self.fault(Code::WriteRefused, error),
            LinkError::Connect { .. } | LinkError::ConnectTimeout { .. } => {
                if !std::mem::replace(&mut self.faults.unreachable_told, true) {
                    self.alarm(Code::PressUnreachable, Some(error.to_string()));
                }
                self.back_off();
            }
            LinkError::Timeout { .. } | LinkError::Broken { .. } | LinkError::Mismatch { .. } => {
                self.alarm(Code::LinkBroken, Some(error.to_string()));
                self.lose_link();
            }
        }
    }

    fn refused(&mut self, exception: u8, error: &LinkError) {
        match consequence(exception) {
            Consequence::Fault(code) => self.fault(code, error),
            Consequence::UnitLost => {
                self.faults.unit_lost = true;
                self.alarm(Code::GatewayFailure, Some(error.to_string()));
                self.lose_link();
            }
            Consequence::Retry { limit, pause, fault } => {
                self.faults.exceptions += 1;
                self.clock.next_poll = Instant::now() + pause;
                if self.faults.exceptions > limit {
                    self.fault(fault, error);
                }
            }
        }
    }

    fn fault(&mut self, code: Code, error: &LinkError) {
        if !matches!(self.handshake.state().link, LinkState::Fault(_)) {
            tracing::error!(%error, "fault");
        }
        self.advice.withdraw();
        self.step(Event::Fault(code));
    }

    fn lose_link(&mut self) {
        self.clock.lost.get_or_insert_with(Instant::now);
        self.last_press = None;
        self.step(Event::Disconnected);
        self.back_off();
    }

    /// Returns the pause before the next connection: exponential back-off from zero after a connection that worked,
    /// with a jitter of a quarter, so that two hosts that lost the same press do not reconnect at the same time.
    fn back_off(&mut self) {
        let (least, most) = (self.press.link.backoff_min, self.press.link.backoff_max);
        let chance = RandomState::new().build_hasher().finish() as f64 / u64::MAX as f64;
        let wait = self.clock.backoff.mul_f64(0.75 + 0.5 * chance);
        self.clock.next_connect = (Instant::now() + wait).max(self.clock.connected + least);
        self.clock.backoff = (self.clock.backoff * 2).clamp(least, most);
    }

    fn next_due(&self) -> Instant {
        let tick = Instant::now() + TICK;
        if !self.client.connected() || self.faults.unit_lost {
            return tick.min(self.clock.next_connect);
        }
        tick.min(self.clock.next_poll)
    }

    /// Waits for the next event: an answer of the host, a completion of the journal, or a timer. Changes of the
    /// registers are written at once.
    async fn wait(&mut self, until: Instant) {
        tokio::select! {
            biased;
            answer = self.side.answers.recv() => self.answer(answer.unwrap_or(Answer::Stop)),
            Some(done) = self.journal.done.recv() => self.journaled(done),
            () = sleep_until(until) => {}
        }
    }

    fn answer(&mut self, answer: Answer) {
        let event = match answer {
            Answer::Acquired(key) => Event::Acquired(key),
            Answer::Result(key, mut measurement) => {
                if measurement.warning.is_none() && saturates(&self.press.map, &measurement.figures) {
                    measurement.warning = Some(Code::Saturated);
                }
                Event::Measured(key, measurement)
            }
            Answer::Failed(key, code) => Event::Failed(key, code),
            Answer::Scanner { ready, estimate } => Event::Scanner { ready, estimate },
            Answer::Advice(stroke, advice) => {
                self.advice.offer(stroke, *advice);
                return;
            }
            Answer::Reset => Event::Reset,
            Answer::Stop => Event::Stop,
        };
        self.step(event);
    }

    fn journaled(&mut self, done: Done) {
        if let Some(error) = &done.error {
            self.metrics.journal_failed += 1;
            tracing::error!(error, stroke = %done.key, "the journal cannot be written");
        }
        self.metrics.journal.add(done.took);
        self.step(Event::Journaled { key: done.key, stage: done.stage, ok: done.error.is_none() });
    }

    fn step(&mut self, event: Event) {
        let now = self.clock.started.elapsed();
        for effect in self.handshake.step(event, now) {
            self.carry_out(effect);
        }
        let waits = self.handshake.state().work == Work::Publish;
        self.clock.result_since = waits.then(|| self.clock.result_since.unwrap_or_else(Instant::now));
    }

    fn carry_out(&mut self, effect: Effect) {
        match effect {
            Effect::Journal(record) => {
                if let Err(record) = self.journal.record(record) {
                    let (key, stage) = (record.key(), record.stage());
                    let error = Some("the journal panicked".into());
                    self.journaled(Done { key, stage, error, took: Duration::ZERO });
                }
            }
            Effect::Command(command) => self.order(Order::Command(command)),
            Effect::Alarm(code) => self.alarm(code, None),
            Effect::Reconnect => {
                self.clock.lost.get_or_insert_with(Instant::now);
                self.client.disconnect();
                self.last_press = None;
                self.back_off();
            }
            Effect::Transition(transition) => self.took(transition),
        }
    }

    /// Sends an order to the host. If the host has dropped its end of the channel, that alone stops the handshake.
    fn order(&self, order: Order) {
        let _ = self.side.orders.send(order);
    }

    fn alarm(&mut self, code: Code, detail: Option<String>) {
        self.order(Order::Alarm { code, stroke: self.handshake.stroke(), detail });
    }

    fn took(&mut self, transition: Transition) {
        let state = self.handshake.state();
        tracing::debug!(?transition, %state, stroke = ?self.handshake.stroke(), "handshake");
        match transition {
            Transition::StrokeResumed | Transition::InterruptedStrokeRecovered | Transition::Synchronised => {
                self.arrived()
            }
            Transition::WaitingStrokeAccepted | Transition::StrokeAccepted | Transition::RescanAccepted => {
                self.arrived();
                self.metrics.strokes += 1;
                self.advice.withdraw();
                self.clock.triggered = self.clock.polled;
                self.clock.busy_untold = true;
            }
            Transition::ResultPublished => self.delivered(),
            Transition::ResultAcknowledged => self.metrics.result_to_ack.add(self.clock.delivered.elapsed()),
            Transition::AckTimedOut => self.metrics.ack_timeouts += 1,
            _ => {}
        }
    }

    /// Marks the press as synchronised: the next loss is a new one.
    fn arrived(&mut self) {
        self.clock.backoff = Duration::ZERO;
        self.faults.unreachable_told = false;
        if let Some(lost) = self.clock.lost.take() {
            self.metrics.link_down += lost.elapsed();
        }
    }

    /// Logs one line for a stroke.
    fn delivered(&mut self) {
        let Some(result) = &self.handshake.image().result else { return };
        self.advice.publish(result.key);
        let stroke_to_result = self.clock.triggered.elapsed();
        self.clock.delivered = Instant::now();
        self.metrics.stroke_to_result.add(stroke_to_result);
        match result.measurement.verdict() {
            Verdict::NotMeasured => self.metrics.not_measured += 1,
            Verdict::Pass | Verdict::Fail | Verdict::CannotTell => self.metrics.measured += 1,
        }
        tracing::info!(
            stroke = %result.key, run_id = result.run_id, seq = result.seq, verdict = ?result.measurement.verdict(),
            trigger_to_busy_ms = self.metrics.trigger_to_busy.last().map(|d| d.as_micros() as f64 / 1000.0),
            stroke_to_result_ms = stroke_to_result.as_millis(),
            waited_ms = self.clock.result_since.map(|since| since.elapsed().as_millis()),
            journal_failed = self.metrics.journal_failed,
            missed = self.handshake.missed_total(), connections = self.client.counts().connects,
            "result in the registers"
        );
    }

    /// Publishes the status at every change of state, else a few times a second.
    fn publish_status(&mut self) {
        let now = Instant::now();
        if now < self.clock.next_status && self.side.status.borrow().state == self.handshake.state() {
            return;
        }
        self.clock.next_status = now + STATUS;
        self.metrics.missed = self.handshake.missed_total();
        self.metrics.result_waits = self.clock.result_since.map(|since| now - since);
        let status = Status {
            state: self.handshake.state(),
            link_error: self.handshake.link_error(),
            press: self.last_press.clone(),
            words: self.last_words.clone(),
            host: self.handshake.image().clone(),
            counts: self.client.counts().clone(),
            metrics: self.metrics.clone(),
        };
        self.side.status.send_replace(status);
    }
}
