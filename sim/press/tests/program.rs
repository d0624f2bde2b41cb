//! Tests of the press side of the handshake in virtual time, without clock and socket.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::time::Duration;

use platen_sim_press::config::Timings;
use platen_sim_press::faults::StrokeFaults;
use platen_sim_press::press::Press;
use platen_sim_press::program::{Event, Limits, Program};
use platen_sim_press::registers::{HBlock, Table, control, h, p, status};
use platen_sim_press::{Cause, Config};

const fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

const LIMITS: Limits =
    Limits { accept: ms(500), result: ms(5_000), host: ms(2_000), heartbeat: ms(250), ack_delay: ms(0) };

/// Returns a program that waits for stroke 1 of session 9, and the H block of a live host that has accepted it.
fn waiting() -> (Program, HBlock) {
    let mut program = Program::new(LIMITS, 9, ms(0));
    let mut host = HBlock([0; 64]);
    program.step(&host, ms(0));
    host.0[h::HEARTBEAT] = 1;
    host.0[h::MAP_VERSION] = 1;
    program.step(&host, ms(5));
    assert_eq!(program.raise(Cause::Stroke, ms(10)), None);
    assert_eq!(program.control(ms(10)), control::TRIGGER);
    host.0[h::SESSION_ECHO] = 9;
    host.0[h::ACK_STROKE_ID] = 1;
    assert_eq!(program.step(&host, ms(15)), [Event::Accepted]);
    assert_eq!(program.control(ms(15)), 0, "the trigger falls with the echo");
    (program, host)
}

fn publish(host: &mut HBlock) {
    host.0[h::RESULT_STROKE_ID] = 1;
    host.0[h::RESULT_SEQ] = 4;
    host.0[h::RESULT_SEQ_TAIL] = 4;
    host.0[h::STATUS] = status::RESULT_VALID | status::PASS;
}

#[test]
fn a_result_is_taken_once_and_acknowledged_until_valid_falls() {
    let (mut program, mut host) = waiting();
    publish(&mut host);
    let events = program.step(&host, ms(20));
    assert!(
        matches!(&events[..], [Event::ResultAccepted(request, words)] if request.cause == Cause::Stroke && **words == host)
    );
    for now in [25, 30] {
        assert_eq!(program.step(&host, ms(now)), []);
        assert_eq!(program.control(ms(now)), control::ACK);
    }
    host.0[h::STATUS] = 0;
    program.step(&host, ms(35));
    assert_eq!(program.control(ms(35)), 0);
}

#[test]
fn a_result_that_breaks_one_rule_is_not_taken() {
    type Break = fn(&mut HBlock);
    let rules: [(&str, Break); 8] = [
        ("valid", |host| host.0[h::STATUS] &= !status::RESULT_VALID),
        ("stroke", |host| host.0[h::RESULT_STROKE_ID] = 2),
        ("session", |host| host.0[h::SESSION_ECHO] = 8),
        ("attempt", |host| host.0[h::ATTEMPT_ECHO] = 1),
        ("head", |host| host.0[h::RESULT_SEQ] = 5),
        ("tail", |host| host.0[h::RESULT_SEQ_TAIL] = 5),
        ("simulated", |host| host.0[h::STATUS] |= status::SIMULATED),
        ("map", |host| host.0[h::MAP_VERSION] = 2),
    ];
    for (rule, break_it) in rules {
        let (mut program, mut host) = waiting();
        publish(&mut host);
        break_it(&mut host);
        assert_eq!(program.step(&host, ms(20)), [], "{rule}");
        assert!(program.request().is_some(), "{rule}");
    }
}

#[test]
fn the_press_goes_on_without_a_host_that_is_silent_or_dead() {
    let (mut program, mut host) = waiting();
    for beat in 2..12 {
        host.0[h::HEARTBEAT] = beat;
        let events = program.step(&host, ms(500 * u64::from(beat)));
        let late = beat == 11;
        assert_eq!(matches!(events[..], [Event::ResultTimeout(_)]), late, "{beat}: {events:?}");
    }
    assert!(program.request().is_none());

    let (mut program, host) = waiting();
    assert_eq!(program.step(&host, ms(2_004)), []);
    assert!(matches!(program.step(&host, ms(2_010))[..], [Event::HostDead(_)]));
}

#[test]
fn a_late_echo_raises_one_alarm_and_the_trigger_stands() {
    let mut program = Program::new(LIMITS, 9, ms(0));
    let host = HBlock([0; 64]);
    program.raise(Cause::Stroke, ms(0));
    let events: Vec<Event> = (1..=100).flat_map(|cycle| program.step(&host, ms(5 * cycle + 10))).collect();
    assert_eq!(events, [Event::AcceptLate]);
    assert_eq!(program.control(ms(520)), control::TRIGGER);
}

#[test]
fn a_rescan_is_accepted_by_a_host_that_is_busy_or_done_with_it() {
    let (mut program, mut host) = waiting();
    publish(&mut host);
    program.step(&host, ms(20));
    program.raise(Cause::Rescan, ms(30));
    assert_eq!(program.control(ms(30)) & !control::ACK, control::RESCAN);
    assert_eq!(program.step(&host, ms(35)), [], "the echo and the result are those of the first attempt");
    host.0[h::STATUS] = status::BUSY;
    assert_eq!(program.step(&host, ms(40)), [Event::Accepted]);
    publish(&mut host);
    assert_eq!(program.step(&host, ms(45)), []);
    host.0[h::ATTEMPT_ECHO] = 1;
    assert!(matches!(program.step(&host, ms(50))[..], [Event::ResultAccepted(..)]));
}

/// Press and its registers, with a live host that echoes but never publishes.
struct Bench {
    press: Press,
    table: Table,
    now: u64,
}

impl Bench {
    fn new(stroke_faults: StrokeFaults) -> Self {
        let timings = Timings { down_ms: 10, up_ms: 10, restart_ms: 50, ..Timings::default() };
        let config =
            Config { baseline: false, wait_ready: false, timings, stroke_faults, ..Config::default() };
        Self { press: Press::new(&config).unwrap(), table: Table::new(0, 100, None), now: 0 }
    }

    fn run(&mut self, duration: u64, host: impl Fn(&[u16; 32], &mut [u16; 64])) {
        let end = self.now + duration;
        while self.now < end {
            self.now += 5;
            let mut words = self.table.h_block().0;
            words[h::MAP_VERSION] = 1;
            words[h::HEARTBEAT] = (self.now / 100) as u16;
            host(&self.table.p_block(), &mut words);
            assert!(self.table.write(100, &words));
            self.press.step(&mut self.table, ms(self.now)).unwrap();
        }
    }
}

fn echo(p: &[u16; 32], words: &mut [u16; 64]) {
    if p[p::CONTROL] & control::TRIGGER != 0 && words[h::STATUS] & status::BUSY == 0 {
        words[h::ACK_STROKE_ID] = p[p::STROKE_ID];
        words[h::SESSION_ECHO] = p[p::SESSION_ID];
        words[h::STATUS] = status::BUSY;
    }
}

#[test]
fn a_hasty_stroke_comes_while_the_host_is_busy_and_leaves() {
    let mut bench = Bench::new(StrokeFaults { hasty: 1.0, hasty_ms: 40, ..StrokeFaults::default() });
    bench.run(60, echo);
    assert_eq!((bench.press.counters.strokes, bench.press.counters.superseded), (2, 1));
    assert_eq!(bench.press.program().stroke_id, 2);
    assert_eq!(bench.table.p_block()[p::CONTROL] & control::TRIGGER, control::TRIGGER);
    bench.run(40, echo);
    assert_eq!(bench.press.counters.lost_while_busy, 1);
    assert_eq!(bench.table.p_block()[p::CONTROL] & control::TRIGGER, 0);
}

#[test]
fn a_reboot_comes_while_the_host_is_busy() {
    let mut bench = Bench::new(StrokeFaults { reboot: 1.0, ..StrokeFaults::default() });
    let session = {
        bench.run(5, echo);
        bench.table.p_block()[p::SESSION_ID]
    };
    bench.run(40, echo);
    assert_eq!(bench.press.counters.restarts, 1);
    assert_eq!(bench.table.p_block(), [0; 32]);
    assert!(!bench.table.contains_map());
    assert_eq!(bench.press.plate_state().strokes, 1, "the plate stays as it was bent");
    bench.run(60, |_, words| *words = [0; 64]);
    let after = bench.table.p_block();
    assert_eq!(after[p::MAP_VERSION], 1);
    assert_ne!(after[p::SESSION_ID], session);
}

#[test]
fn the_same_seed_misbehaves_the_same() {
    let run = || {
        let mut bench = Bench::new(StrokeFaults { skip: 0.3, counter_back: 0.3, ..StrokeFaults::default() });
        let mut numbers = Vec::new();
        for _ in 0..400 {
            bench.run(5, |p, words| {
                echo(p, words);
                if words[h::STATUS] & status::BUSY != 0 {
                    words[h::RESULT_STROKE_ID] = words[h::ACK_STROKE_ID];
                    words[h::STATUS] = status::RESULT_VALID | status::FAIL;
                }
            });
            let p = bench.table.p_block();
            numbers.push((p[p::SESSION_ID], p[p::STROKE_ID]));
        }
        numbers
    };
    let first = run();
    assert_eq!(first, run());
    assert!(first.last().unwrap().1 > 0);
    assert!(first.iter().any(|(session, _)| *session != first[0].0), "a counter went back");
}
