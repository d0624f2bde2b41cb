//! Property tests of the handshake alone: random event sequences in virtual time.
//!
//! After every event the harness checks the invariants of the README: no scan twice or without a record, no result
//! without a record, no write before the press is known.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use platen_model::Measure;
use platen_model::{Acknowledgement, Code, Figures, Measurement, Recalled, Record, StrokeKey, Verdict};
use platen_plant::press::{Input, Link, NoAck, OnMissed, OnStorageFull, Press};
use platen_press::{
    Command, Config, Effect, Event, Handshake, HostImage, LinkState, PressImage, Transition, Work, Wrong,
};
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::RngSeed;

/// Handshake with simulated journal and scanner, and their outstanding answers.
struct Harness {
    machine: Handshake,
    now: Duration,
    records: VecDeque<Record>,
    scanning: Option<StrokeKey>,
    judging: Option<StrokeKey>,
    accepted: BTreeMap<StrokeKey, bool>,
    finished: BTreeSet<(StrokeKey, u16)>,
    scanned: BTreeSet<StrokeKey>,
    synchronised: bool,
    session: u16,
    degrade: bool,
    taken: BTreeSet<Transition>,
    recalled: Recalled,
    alarms: Vec<Code>,
}

impl Harness {
    fn new(config: Config) -> Self {
        Self::after(config, Recalled::empty(7))
    }

    fn after(config: Config, recalled: Recalled) -> Self {
        let degrade = config.policy.on_storage_full == OnStorageFull::Degrade;
        Self {
            machine: Handshake::new(config, recalled.clone()),
            now: Duration::ZERO,
            records: VecDeque::new(),
            scanning: None,
            judging: None,
            accepted: BTreeMap::new(),
            finished: BTreeSet::new(),
            scanned: recalled.last.iter().map(|entry| entry.key).collect(),
            synchronised: false,
            session: 1,
            degrade,
            taken: BTreeSet::new(),
            recalled,
            alarms: Vec::new(),
        }
    }

    /// Restarts the host on the same journal. Scans without a written record are not recalled.
    fn restarted(self, config: Config) -> Self {
        let stored = |key: &StrokeKey| self.accepted.get(key) == Some(&true);
        let scanned = self.scanned.iter().copied().filter(stored).collect();
        Self { scanned, session: self.session, ..Self::after(config, self.recalled) }
    }

    fn step(&mut self, event: Event) {
        let before = self.machine.image().clone();
        let effects = self.machine.step(event, self.now);
        for effect in effects {
            self.take(effect);
        }
        self.check(&before);
    }

    fn take(&mut self, effect: Effect) {
        match effect {
            Effect::Journal(record) => self.records.push_back(record),
            Effect::Command(Command::Scan { key, .. }) => {
                let stored = self.accepted.get(&key) == Some(&true);
                assert!(stored || self.degrade, "scan of {key} without a record");
                assert!(self.scanned.insert(key), "{key} is scanned twice");
                self.scanning = Some(key);
            }
            Effect::Command(Command::Evaluate(key)) => self.judging = Some(key),
            Effect::Command(Command::Cancel(_)) => (self.scanning, self.judging) = (None, None),
            Effect::Transition(transition) => {
                use Transition::*;
                match transition {
                    Connected | PressRejected | SecondHostFound | LinkLost | Faulted | FaultReset => {
                        self.synchronised = false
                    }
                    StrokeResumed | WaitingStrokeAccepted | InterruptedStrokeRecovered | Synchronised => {
                        self.synchronised = true
                    }
                    _ => {}
                }
                self.taken.insert(transition);
            }
            Effect::Alarm(code) => self.alarms.push(code),
            Effect::Command(Command::PartEnd) | Effect::Reconnect => {}
        }
    }

    fn check(&self, before: &HostImage) {
        let image = self.machine.image();
        let link = self.machine.state().link;
        assert!(!(image.busy && image.ready), "busy and ready");
        assert!(!(image.busy && image.valid), "busy and valid");
        assert!(!image.valid || image.result.is_some(), "valid without a result");
        if let (true, LinkState::Online, Some(code)) =
            (image.valid, link, image.result.as_ref().and_then(|result| result.measurement.reason()))
        {
            assert_eq!(
                image.error,
                Some(code),
                "another error under the number of a stroke that was not measured"
            );
        }
        assert!(!image.ready || self.synchronised, "ready before the press is known");
        let silent = matches!(link, LinkState::Boot | LinkState::Offline | LinkState::Sync);
        assert!(!silent || !self.machine.may_write(), "a write before the press is known");
        if let Some(result) = &image.result {
            let known = self.finished.contains(&(result.key, result.seq));
            let recalled =
                self.recalled.last.as_ref().and_then(|last| last.publication.as_ref()) == Some(result);
            let overdue = self.now >= Duration::from_secs(10);
            assert!(known || recalled || overdue, "{} is published without a record", result.key);
        }
        if image.ack_stroke_id != before.ack_stroke_id && image.busy {
            let promised = self.accepted.keys().any(|key| key.stroke == image.ack_stroke_id);
            assert!(promised || self.now >= Duration::from_secs(10), "an echo before the record");
        }
        if matches!(link, LinkState::Stopped { .. }) {
            assert!(
                !image.ready && !image.busy && !image.valid && image.error.is_none(),
                "not safe at the end"
            );
        }
    }

    /// Answers the oldest outstanding record.
    fn journal(&mut self, ok: bool) {
        let Some(record) = self.records.pop_front() else { return };
        if ok {
            self.recalled.replay(&record);
        }
        match &record {
            Record::Accepted { key, .. } => drop(self.accepted.insert(*key, ok)),
            Record::Finished(result) => drop(self.finished.insert((result.key, result.seq))),
            Record::Scanned { .. } | Record::Acked { .. } => {}
        }
        self.step(Event::Journaled { key: record.key(), stage: record.stage(), ok });
    }

    fn acquire(&mut self) {
        if let Some(key) = self.scanning.take() {
            self.step(Event::Acquired(key));
        }
    }

    fn judge(&mut self) {
        if let Some(key) = self.judging.take() {
            self.step(Event::Measured(key, Box::new(measurement())));
        }
    }

    fn pass(&mut self, ms: u64) {
        self.now += Duration::from_millis(ms);
    }

    /// Runs one cycle of a correct press without a new stroke.
    fn calm_cycle(&mut self, beat: u16) {
        self.pass(100);
        self.step(Event::Connected);
        let ack = self.machine.image().valid;
        let press = PressImage { heartbeat: Some(beat), ack, ..calm() };
        self.step(Event::Press(Box::new(press)));
        self.step(Event::Host { owner: Some(7), heartbeat: Some(beat), mine: true });
        while !self.records.is_empty() {
            self.journal(true);
        }
        self.acquire();
        self.judge();
        if self.machine.may_write() {
            self.step(Event::Written);
        }
    }
}

fn measurement() -> Measurement {
    Measurement {
        judgement: Verdict::Pass.into(),
        figures: Figures { values: [(Measure::GapMax, 0.001)].into(), stations: Vec::new() },
        scanned_at: None,
        warning: None,
    }
}

fn calm() -> PressImage {
    PressImage {
        heartbeat: Some(0),
        enable: true,
        clear_to_scan: true,
        stroke_id: 1,
        session_id: 1,
        ..PressImage::default()
    }
}

fn config() -> Config {
    Config::new(&Press::pph1("P", 3, Link::tcp("x", 502, 1)))
}

/// One action of the random sequence.
#[derive(Debug, Clone)]
enum Act {
    Press(Box<PressImage>),
    /// New session: restart of the press or another part.
    Session,
    Host {
        owner: u16,
        heartbeat: u16,
        mine: bool,
    },
    Connected,
    Disconnected,
    Written,
    Journal(bool),
    Acquire,
    Judge,
    Failed(Code),
    Stale(StrokeKey),
    Scanner(bool),
    Fault(Code),
    Reset,
    Pass(u64),
}

fn press() -> impl Strategy<Value = PressImage> {
    let bit = |chance: f64| prop::bool::weighted(chance);
    let bits = (bit(0.9), bit(0.5), bit(0.3), bit(0.05), bit(0.1), bit(0.9), bit(0.1), bit(0.15));
    let ids = (0u16..6, 0u16..3, 0u16..4);
    (bits, ids).prop_map(
        |((enable, trigger, ack, abort, error_reset, clear_to_scan, part_end, rescan), ids)| {
            let (stroke_id, attempt, beat) = ids;
            PressImage {
                heartbeat: Some(beat),
                enable,
                trigger,
                ack,
                abort,
                error_reset,
                clear_to_scan,
                part_end,
                rescan,
                // On both sides of the wrap of the counter.
                stroke_id: [0, 65_534, 65_535, 1, 2, 40][usize::from(stroke_id)],
                session_id: 0,
                attempt,
                data: Default::default(),
                wrong: None,
            }
        },
    )
}

/// Press registers, sometimes those of a controller that is starting.
fn press_or_ruin() -> impl Strategy<Value = PressImage> {
    (press(), prop::bool::weighted(0.03)).prop_map(|(image, ruin)| {
        let wrong = ruin.then_some(Wrong { input: Input::MapVersion, found: 0, expected: 1 });
        PressImage { wrong, ..image }
    })
}

fn act() -> impl Strategy<Value = Act> {
    prop_oneof![
        8 => press_or_ruin().prop_map(|image| Act::Press(Box::new(image))),
        2 => Just(Act::Host { owner: 7, heartbeat: 1, mine: true }),
        1 => (0u16..9, 0u16..3).prop_map(|(owner, heartbeat)| Act::Host { owner, heartbeat, mine: owner == 7 }),
        2 => Just(Act::Connected),
        1 => Just(Act::Disconnected),
        1 => Just(Act::Session),
        4 => Just(Act::Written),
        4 => prop::bool::weighted(0.9).prop_map(Act::Journal),
        3 => Just(Act::Acquire),
        3 => Just(Act::Judge),
        1 => Just(Act::Failed(Code::ScanFailed)),
        1 => (0u16..3).prop_map(|stroke| Act::Stale(StrokeKey { press: 3, session: 1, stroke, attempt: 0 })),
        1 => prop::bool::weighted(0.8).prop_map(Act::Scanner),
        1 => prop_oneof![Just(Code::IllegalAddress), Just(Code::DeviceFailure)].prop_map(Act::Fault),
        1 => Just(Act::Reset),
        3 => prop_oneof![1u64..50, Just(600), Just(2100), Just(6000), Just(200_000)].prop_map(Act::Pass),
    ]
}

fn configs() -> impl Strategy<Value = Config> {
    let missed = prop_oneof![Just(OnMissed::Warn), Just(OnMissed::Error), Just(OnMissed::Block)];
    let full = prop_oneof![Just(OnStorageFull::Degrade), Just(OnStorageFull::Stop)];
    let ack = prop_oneof![Just(NoAck::NextStroke), Just(NoAck::Hold)];
    (missed, full, ack, any::<bool>(), any::<bool>()).prop_map(|(missed, full, ack, counts, attempts)| {
        let mut config = config();
        config.policy.on_missed_stroke = missed;
        config.policy.on_storage_full = full;
        config.policy.no_ack = ack;
        if !counts {
            config.counter = None;
            config.debounce_reads = 2;
        }
        config.counts_attempts = attempts;
        config
    })
}

fn perform(harness: &mut Harness, act: Act) {
    match act {
        Act::Press(image) => {
            let session_id = harness.session;
            harness.step(Event::Press(Box::new(PressImage { session_id, ..*image })));
        }
        Act::Session => harness.session += 1,
        Act::Host { owner, heartbeat, mine } => {
            harness.step(Event::Host { owner: Some(owner), heartbeat: Some(heartbeat), mine });
        }
        Act::Connected => harness.step(Event::Connected),
        Act::Disconnected => harness.step(Event::Disconnected),
        Act::Written if harness.machine.may_write() => harness.step(Event::Written),
        Act::Written => {}
        Act::Journal(ok) => harness.journal(ok),
        Act::Acquire => harness.acquire(),
        Act::Judge => harness.judge(),
        Act::Failed(code) => {
            if let Some(key) = harness.scanning.take().or(harness.judging.take()) {
                harness.step(Event::Failed(key, code));
            }
        }
        Act::Stale(key) => harness.step(Event::Measured(key, Box::new(measurement()))),
        Act::Scanner(ok) => {
            let ready = if ok { Ok(()) } else { Err(Code::ScannerNotReady) };
            harness.step(Event::Scanner { ready, estimate: Some(Duration::from_secs(20)) });
        }
        Act::Fault(code) => harness.step(Event::Fault(code)),
        Act::Reset => harness.step(Event::Reset),
        Act::Pass(ms) => {
            harness.pass(ms);
            harness.step(Event::Tick);
        }
    }
}

/// Asserts that a correct press brings the handshake back to idle from any state.
fn comes_to_rest(harness: &mut Harness) {
    harness.step(Event::Scanner { ready: Ok(()), estimate: None });
    let mut beat = 100;
    for _ in 0..3000 {
        beat += 1;
        if beat % 500 == 0 {
            harness.step(Event::Reset);
        }
        harness.calm_cycle(beat);
        let state = harness.machine.state();
        if beat > 110 && state.link == LinkState::Online && state.work == Work::Idle {
            return;
        }
    }
    panic!("no way out of {:?}", harness.machine.state());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, rng_seed: RngSeed::Fixed(0x5EED), ..ProptestConfig::default() })]

    /// Invariants hold in any order of events, and idle is reachable from every state.
    #[test]
    fn any_order_of_events(config in configs(), acts in prop::collection::vec(act(), 0..120)) {
        let mut harness = Harness::new(config);
        harness.step(Event::Scanner { ready: Ok(()), estimate: Some(Duration::from_secs(20)) });
        harness.step(Event::Connected);
        for act in acts {
            perform(&mut harness, act);
        }
        comes_to_rest(&mut harness);
        harness.step(Event::Stop);
        assert!(matches!(harness.machine.state().link, LinkState::Stopped { writable: true }));
    }

    /// The same with a restart of the host in between: only the journal survives.
    #[test]
    fn any_order_of_events_with_a_restart(
        config in configs(),
        before in prop::collection::vec(act(), 0..80),
        after in prop::collection::vec(act(), 0..40),
    ) {
        let mut harness = Harness::new(config.clone());
        harness.step(Event::Scanner { ready: Ok(()), estimate: None });
        harness.step(Event::Connected);
        for act in before {
            perform(&mut harness, act);
        }
        let mut harness = harness.restarted(config);
        harness.step(Event::Scanner { ready: Ok(()), estimate: None });
        harness.step(Event::Connected);
        for act in after {
            perform(&mut harness, act);
        }
        comes_to_rest(&mut harness);
    }
}

/// Coverage of the random sequences: every transition is taken.
#[test]
fn every_transition_is_taken() {
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    let mut taken = BTreeSet::new();
    for _ in 0..2000 {
        let run = (configs(), prop::collection::vec(act(), 40..120), prop::collection::vec(act(), 0..40));
        let (config, before, after) = run.new_tree(&mut runner).expect("no filter").current();
        let mut harness = Harness::new(config.clone());
        harness.step(Event::Scanner { ready: Ok(()), estimate: None });
        harness.step(Event::Connected);
        before.into_iter().for_each(|act| perform(&mut harness, act));
        taken.append(&mut harness.taken);
        let mut harness = harness.restarted(config);
        harness.step(Event::Scanner { ready: Ok(()), estimate: None });
        harness.step(Event::Connected);
        after.into_iter().for_each(|act| perform(&mut harness, act));
        harness.step(Event::Stop);
        taken.append(&mut harness.taken);
    }
    let never: Vec<_> =
        Transition::ALL.into_iter().filter(|transition| !taken.contains(transition)).collect();
    assert!(never.is_empty(), "never taken: {never:?}");
}

/// Link lost while a result waits for its acknowledgement. The press acknowledges it and makes the next stroke; the
/// acknowledgement is still up after the reconnection and belongs to the former result.
#[test]
fn an_acknowledge_of_the_stroke_before_is_not_the_next_ones() {
    let mut harness = Harness::new(config());
    harness.step(Event::Scanner { ready: Ok(()), estimate: None });
    harness.calm_cycle(1);
    let press =
        |stroke_id, trigger, ack| Event::Press(Box::new(PressImage { stroke_id, trigger, ack, ..calm() }));
    let finish = |harness: &mut Harness| {
        for _ in 0..2 {
            while !harness.records.is_empty() {
                harness.journal(true);
            }
            harness.acquire();
            harness.judge();
        }
        harness.step(Event::Written);
    };
    harness.step(press(2, true, false));
    finish(&mut harness);
    assert!(harness.machine.image().valid);
    harness.step(Event::Disconnected);
    harness.step(Event::Connected);
    harness.step(press(3, true, true));
    harness.step(Event::Host { owner: Some(7), heartbeat: Some(1), mine: true });
    finish(&mut harness);
    assert_eq!((harness.machine.image().ack_stroke_id, harness.machine.image().valid), (3, true));
    harness.step(press(3, false, true));
    assert!(harness.machine.image().valid, "the acknowledge of stroke 2 withdrew the result of stroke 3");
    harness.step(press(3, false, false));
    harness.step(press(3, false, true));
    assert!(!harness.machine.image().valid, "its own acknowledge");
}

/// The trigger rises while a stroke is being measured and is still up when its result is valid. The result keeps its
/// time for the acknowledgement, and the record contains whether it was acknowledged.
#[test]
fn a_trigger_that_rose_early_waits_for_the_result_before() {
    for acknowledges in [true, false] {
        let mut harness = Harness::new(config());
        harness.step(Event::Scanner { ready: Ok(()), estimate: None });
        harness.calm_cycle(1);
        let mut beat = 1;
        let mut press = |stroke_id, ack| {
            beat += 1;
            let image = PressImage { stroke_id, trigger: true, ack, heartbeat: Some(beat), ..calm() };
            Event::Press(Box::new(image))
        };
        harness.step(press(2, false));
        harness.journal(true);
        harness.step(press(3, false));
        assert!(harness.alarms.contains(&Code::MissedStroke));
        harness.acquire();
        harness.judge();
        while !harness.records.is_empty() {
            harness.journal(true);
        }
        harness.step(Event::Written);
        let is_valid = |harness: &Harness| {
            let image = harness.machine.image();
            (image.valid, image.ack_stroke_id) == (true, 2)
        };
        harness.step(press(3, false));
        harness.pass(config().timeouts.ack.as_millis() as u64 - 1);
        harness.step(press(3, false));
        assert!(is_valid(&harness), "the early trigger has overtaken the result");
        if acknowledges {
            harness.step(press(3, true));
            harness.step(press(3, false));
        } else {
            harness.pass(1);
            harness.step(press(3, false));
        }
        let how = harness.records.iter().find_map(|record| match record {
            Record::Acked { how, .. } => Some(*how),
            _ => None,
        });
        let expected = if acknowledges { Acknowledgement::Explicit } else { Acknowledgement::Never };
        assert_eq!(how, Some(expected));
        assert_eq!(harness.machine.stroke().map(|key| key.stroke), Some(3), "then it is accepted");
    }
}

/// Restart of the host with a scanner that is not ready: `error_code` beside the interrupted stroke is its own reason;
/// the scanner's code follows after the acknowledgement, with ready low.
#[test]
fn an_interrupted_stroke_keeps_its_reason_while_the_scanner_is_not_ready() {
    let mut harness = Harness::new(config());
    harness.step(Event::Scanner { ready: Ok(()), estimate: None });
    harness.calm_cycle(1);
    let press = |trigger, ack| Event::Press(Box::new(PressImage { stroke_id: 2, trigger, ack, ..calm() }));
    harness.step(press(true, false));
    harness.journal(true);
    assert!(harness.machine.image().busy);
    let mut harness = harness.restarted(config());
    harness.step(Event::Connected);
    harness.step(press(true, false));
    harness.step(Event::Host { owner: Some(7), heartbeat: Some(1), mine: true });
    while !harness.records.is_empty() {
        harness.journal(true);
    }
    harness.step(Event::Written);
    let image = harness.machine.image();
    assert_eq!((image.valid, image.ready, image.error), (true, false, Some(Code::Interrupted)));
    for ack in [true, false] {
        harness.step(press(false, ack));
    }
    let image = harness.machine.image();
    assert_eq!((image.valid, image.ready, image.error), (false, false, Some(Code::ScannerNotReady)));
    harness.step(Event::Scanner { ready: Ok(()), estimate: None });
    assert!(harness.machine.image().ready);
}
