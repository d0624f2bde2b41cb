//! State of the handshake and the step.
//!
//! An event is an observation: [`Handshake::step`] stores it, takes the transitions that are due and returns the
//! effects in the order in which they must be carried out. Deadlines are compared with the time of the step, so the
//! caller steps with [`Event::Tick`] while nothing else happens.

use std::collections::BTreeMap;
use std::time::Duration;

use platen_plant::press::{Counter, Input, Mode, Policy, Press, Timeouts};

use super::messages::{Command, Effect, Event};
use super::trigger_edges::EdgeCounter;
use super::{LinkState, State, Work};
use crate::{
    Code, Entry, HostImage, Measurement, PressImage, Publication, Recalled, Stage, StrokeData, StrokeKey,
};

/// Limit of a scan without a limit in the plant file and without an estimate of the scanner.
const SCAN_LIMIT: Duration = Duration::from_secs(180);
/// Limit of a scan as a multiple of the scanner's estimate.
const SCAN_MARGIN: f64 = 1.5;

/// Parameters of the handshake from the plant file.
#[derive(Debug, Clone)]
pub struct Config {
    /// Plant number of the press.
    pub press: u16,
    /// Results are marked as simulated.
    pub simulated: bool,
    /// Time limits.
    pub timeouts: Timeouts,
    /// Policies for missed strokes, restarts, storage and acknowledgement.
    pub policy: Policy,
    /// Stroke counter; `None` for a press without stroke numbers.
    pub counter: Option<Counter>,
    /// Whether the press numbers its requests for a rescan.
    pub counts_attempts: bool,
    /// Equal reads before a trigger is valid.
    pub debounce_reads: u8,
}

impl Config {
    /// Returns the parameters in the plant file.
    pub fn new(press: &Press) -> Self {
        Self {
            press: press.press_id,
            simulated: press.mode == Mode::Simulate,
            timeouts: press.timeouts.clone(),
            policy: press.policy,
            counter: press.map.counts_strokes().then_some(press.map.counter),
            counts_attempts: press.map.input(Input::Attempt).is_some(),
            debounce_reads: press.map.input(Input::Trigger).map_or(1, |field| field.debounce_reads),
        }
    }
}

#[derive(Debug, Clone)]
pub(super) struct ActiveStroke {
    pub(super) key: StrokeKey,
    pub(super) run_id: u32,
    pub(super) data: StrokeData,
    /// Time of entry into the present work state.
    pub(super) since: Duration,
    pub(super) accepted_at: Duration,
    pub(super) scan_started_at: Option<Duration>,
    pub(super) acquired_at: Option<Duration>,
    /// Outcome of the record that the present state waits for; `Some(true)` when it is on the disk.
    pub(super) journaled: Option<bool>,
    /// Acquisition complete, no transition taken yet.
    pub(super) acquired: bool,
    /// Result or reason why there is none, no transition taken yet.
    pub(super) outcome: Option<Measurement>,
    pub(super) publication: Option<Publication>,
}

impl ActiveStroke {
    pub(super) fn new(key: StrokeKey, run_id: u32, data: StrokeData, now: Duration) -> Self {
        Self {
            key,
            run_id,
            data,
            since: now,
            accepted_at: now,
            scan_started_at: None,
            acquired_at: None,
            journaled: None,
            acquired: false,
            outcome: None,
            publication: None,
        }
    }

    fn from_entry(entry: &Entry) -> Self {
        let publication = entry.publication.clone();
        let active = Self::new(entry.key, entry.run_id, entry.data.clone(), Duration::ZERO);
        Self { publication, ..active }
    }
}

/// Registers of another host, read before the first write.
#[derive(Debug, Clone, Copy)]
pub(super) struct OtherHost {
    pub(super) heartbeat: Option<u16>,
    pub(super) since: Duration,
    pub(super) alive: bool,
}

/// Handshake with one press.
#[derive(Debug, Clone)]
pub struct Handshake {
    pub(super) config: Config,
    pub(super) link: LinkState,
    pub(super) work: Work,
    pub(super) active: Option<ActiveStroke>,

    /// Last accepted stroke, and the number of its rescan request.
    pub(super) last: Option<StrokeKey>,
    pub(super) asked: u16,
    /// Session and stroke number up to which strokes are accounted for.
    pub(super) counted: Option<(u16, u16)>,
    /// Highest attempt per stroke of the session of `last`.
    pub(super) attempts: BTreeMap<u16, u16>,
    pub(super) result_seq: u16,
    pub(super) run_id: u32,
    pub(super) owner: u16,
    /// Last stroke of the journal, until the first synchronisation.
    pub(super) recalled: Option<Entry>,

    // Observations.
    pub(super) connected: bool,
    pub(super) press: Option<PressImage>,
    pub(super) held_reads: u8,
    pub(super) heartbeat_at: Duration,
    pub(super) stale: bool,
    pub(super) host_seen: bool,
    pub(super) other_host: Option<OtherHost>,
    pub(super) overwritten: bool,
    pub(super) written: bool,
    pub(super) scanner: Result<(), Code>,
    pub(super) scan_estimate: Option<Duration>,
    pub(super) storage_ok: bool,
    pub(super) fault: Option<Code>,
    pub(super) reset: bool,
    pub(super) stop: bool,
    pub(super) rescan_rose: bool,
    pub(super) trigger_edges: Option<EdgeCounter>,

    // Latches, cleared by a reset.
    pub(super) missed_count: u16,
    pub(super) missed_total: u64,
    pub(super) missed: bool,
    pub(super) warning: Option<Code>,

    pub(super) link_error: Option<Code>,
    /// Stroke of the valid result that is not acknowledged.
    pub(super) unacked: Option<StrokeKey>,
    /// Whether the acknowledgement was read low after the previous one.
    pub(super) ack_was_low: bool,
    pub(super) image: HostImage,

    pub(super) effects: Vec<Effect>,
}

impl Handshake {
    /// Makes a handshake that continues after the last record of the journal.
    pub fn new(config: Config, recalled: Recalled) -> Self {
        let trigger_edges =
            config.counter.is_none().then(|| EdgeCounter::new(config.debounce_reads, &recalled));
        let last = recalled.last.as_ref().map(|entry| entry.key);
        Self {
            link: LinkState::Boot,
            work: Work::Idle,
            active: None,
            last,
            asked: last.map_or(0, |key| key.attempt),
            counted: last.map(|key| (key.session, key.stroke)),
            attempts: recalled.attempts,
            result_seq: recalled.result_seq,
            run_id: recalled.run_id,
            owner: recalled.owner,
            recalled: recalled.last.filter(|entry| entry.stage < Stage::Acked),
            connected: false,
            press: None,
            held_reads: 0,
            heartbeat_at: Duration::ZERO,
            stale: false,
            host_seen: false,
            other_host: None,
            overwritten: false,
            written: false,
            scanner: Err(Code::ScannerNotReady),
            scan_estimate: None,
            storage_ok: true,
            fault: None,
            reset: false,
            stop: false,
            rescan_rose: false,
            trigger_edges,
            missed_count: 0,
            missed_total: 0,
            missed: false,
            warning: None,
            link_error: None,
            unacked: None,
            ack_was_low: false,
            image: HostImage {
                owner: recalled.owner,
                result_seq: recalled.result_seq,
                ..HostImage::default()
            },
            effects: Vec::new(),
            config,
        }
    }

    /// Stores an event, takes every transition that is due and returns the effects. `now` is monotonic.
    pub fn step(&mut self, event: Event, now: Duration) -> Vec<Effect> {
        self.note(event, now);
        while let Some(transition) = self.advance(now) {
            self.effects.push(Effect::Transition(transition));
        }
        self.reset = false;
        self.rescan_rose = false;
        self.written = false;
        self.refresh_image();
        std::mem::take(&mut self.effects)
    }

    /// Returns the wanted registers of the host.
    pub fn image(&self) -> &HostImage {
        &self.image
    }

    /// Returns both regions of the state.
    pub fn state(&self) -> State {
        State { link: self.link, work: self.work }
    }

    /// Returns whether the registers of the host may be written: only after the press was identified and no other host
    /// was found.
    pub fn may_write(&self) -> bool {
        match self.link {
            LinkState::Online | LinkState::Stopped { writable: true } => true,
            LinkState::Fault(code) => matches!(code, Code::DeviceFailure | Code::DeviceBusy),
            LinkState::Boot
            | LinkState::Offline
            | LinkState::Sync
            | LinkState::Stopped { writable: false } => false,
        }
    }

    /// Returns the error of the link for status and log; it may be missing in the registers.
    pub fn link_error(&self) -> Option<Code> {
        match self.link {
            LinkState::Fault(code) => Some(code),
            _ => self.link_error,
        }
    }

    /// Returns the active stroke.
    pub fn stroke(&self) -> Option<StrokeKey> {
        self.active.as_ref().map(|active| active.key)
    }

    /// Returns the number of strokes missed since the start, independent of resets.
    pub fn missed_total(&self) -> u64 {
        self.missed_total
    }

    pub(super) fn scan_limit(&self) -> Duration {
        let estimate = self.scan_estimate.map(|estimate| estimate.mul_f64(SCAN_MARGIN));
        self.config.timeouts.scan.or(estimate).unwrap_or(SCAN_LIMIT)
    }

    fn note(&mut self, event: Event, now: Duration) {
        match event {
            Event::Connected => self.connected = true,
            Event::Disconnected => {
                self.connected = false;
                self.press = None;
            }
            Event::Press(image) => self.note_press(*image, now),
            Event::Host { owner, heartbeat, mine } => self.note_host(owner, heartbeat, mine, now),
            Event::Written => self.written = true,
            Event::Journaled { key, stage, ok } => self.note_journaled(key, stage, ok),
            Event::Scanner { ready, estimate } => {
                self.scanner = ready;
                self.scan_estimate = estimate;
            }
            Event::Acquired(key) => {
                if let Some(active) = self.active_mut(key) {
                    active.acquired = true;
                }
            }
            Event::Measured(key, measurement) => {
                if let Some(active) = self.active_mut(key) {
                    active.outcome.get_or_insert(*measurement);
                }
            }
            Event::Failed(key, code) => {
                if let Some(active) = self.active_mut(key) {
                    active.outcome.get_or_insert(Measurement::not_measured(code));
                }
            }
            Event::Fault(code) => self.fault = Some(code),
            Event::Reset => self.clear_latches(),
            Event::Stop => self.stop = true,
            Event::Tick => {}
        }
    }

    /// Returns the active stroke if it has this key; an answer about another stroke is late and ignored.
    fn active_mut(&mut self, key: StrokeKey) -> Option<&mut ActiveStroke> {
        self.active.as_mut().filter(|active| active.key == key)
    }

    fn note_journaled(&mut self, key: StrokeKey, stage: Stage, ok: bool) {
        if ok {
            self.storage_ok = true;
        } else {
            self.storage_failed();
        }
        let awaited = match self.work {
            Work::Accepted => Some(Stage::Accepted),
            Work::Aborted | Work::Publish => Some(Stage::Finished),
            _ => None,
        };
        if let Some(active) = self.active_mut(key).filter(|_| awaited == Some(stage)) {
            active.journaled = Some(ok);
        }
    }

    fn note_press(&mut self, mut image: PressImage, now: Duration) {
        if let Some(edges) = &mut self.trigger_edges {
            edges.number(&mut image);
        }
        let before = self.press.as_ref();
        let rose = |bit: fn(&PressImage) -> bool| bit(&image) && before.is_some_and(|before| !bit(before));
        let (reset, part_end, rescan) =
            (rose(|it| it.error_reset), rose(|it| it.part_end), rose(|it| it.rescan));
        let same = |before: &PressImage| {
            before.trigger && (before.session_id, before.stroke_id) == (image.session_id, image.stroke_id)
        };
        self.held_reads = match before {
            _ if !image.trigger => 0,
            Some(before) if same(before) => self.held_reads.saturating_add(1),
            _ => 1,
        };
        if before.is_none_or(|before| before.heartbeat != image.heartbeat) {
            self.heartbeat_at = now;
            self.stale = false;
        }
        self.ack_was_low |= !image.ack;
        self.press = Some(image);
        self.rescan_rose = rescan;
        if reset {
            self.clear_latches();
        }
        if part_end {
            self.effects.push(Effect::Command(Command::PartEnd));
        }
    }

    fn note_host(&mut self, owner: Option<u16>, heartbeat: Option<u16>, mine: bool, now: Duration) {
        self.host_seen = true;
        self.overwritten = !mine;
        let theirs = owner.is_some_and(|owner| owner != 0 && owner != self.owner);
        self.other_host = theirs.then(|| match self.other_host {
            Some(other_host) => {
                OtherHost { alive: other_host.alive || heartbeat != other_host.heartbeat, ..other_host }
            }
            None => OtherHost { heartbeat, since: now, alive: false },
        });
    }

    pub(super) fn storage_failed(&mut self) {
        if self.storage_ok {
            self.storage_ok = false;
            self.alarm(Code::StorageFailed);
        }
    }

    fn clear_latches(&mut self) {
        self.reset = true;
        self.missed = false;
        self.missed_count = 0;
        self.warning = None;
        self.storage_ok = true;
    }

    pub(super) fn alarm(&mut self, code: Code) {
        self.effects.push(Effect::Alarm(code));
    }

    /// Latches a warning.
    pub(super) fn warn(&mut self, code: Code) {
        self.warning = Some(code);
        self.alarm(code);
    }

    pub(super) fn take_recalled(&mut self, now: Duration) -> Option<(Stage, ActiveStroke)> {
        let entry = self.recalled.take()?;
        let active = ActiveStroke { since: now, accepted_at: now, ..ActiveStroke::from_entry(&entry) };
        Some((entry.stage, active))
    }
}
