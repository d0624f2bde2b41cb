//! Tests of strokes over real sockets; the press counts and the tests assert on its counters.

use std::time::Duration;

use crate::rig::{Host, LIMIT, Memory, assert_clean, beside_each_other, quick, run, tcp};
use platen_model::Code;
use platen_press::LinkState;
use platen_sim_press::faults::StrokeFaults;
use platen_sim_press::registers::status;
use platen_sim_press::{Cause, Command, Config, SimPress};

const fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn fifty_strokes_back_to_back() {
    let (press, host, counters) = run(Config { strokes: 50, baseline: true, ..quick() }, ms(5)).await;
    assert_clean(&counters);
    assert_eq!((counters.strokes, counters.baselines, counters.taken.len()), (50, 1, 51));
    assert_eq!(counters.taken[0].cause, Cause::Baseline);
    assert_eq!(counters.plates_served, 51, "scans");
    assert_eq!((counters.missed_reported, counters.owners.as_slice()), (0, &[7][..]));
    assert_eq!(*host.heard.part_ends.lock().unwrap(), 1);
    host.stop().await;
    assert_eq!(press.h_block().word(2), 0, "status after the stop");
    assert_eq!(press.counters().writes_outside, 0);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_press_restarts_in_the_middle() {
    let faults = StrokeFaults { reboot: 0.25, ..StrokeFaults::default() };
    let (_press, host, counters) =
        run(Config { strokes: 24, stroke_faults: faults, ..quick() }, ms(20)).await;
    assert_clean(&counters);
    assert!(counters.restarts >= 3, "the seed restarts the press {} times", counters.restarts);
    assert_eq!(
        counters.taken.len() as u64,
        counters.strokes - counters.restarts,
        "but for those it forgot itself"
    );
    assert_eq!(counters.plates_served, counters.strokes);
    assert_eq!(counters.missed_reported, 0);
    host.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_stroke_while_busy_is_missed_and_not_queued() {
    let faults = StrokeFaults { hasty: 1.0, hasty_ms: 100, ..StrokeFaults::default() };
    let config = Config { strokes: 12, stroke_faults: faults, ..quick() };
    let (_press, host, counters) = run(config, ms(400)).await;
    assert_clean(&counters);
    assert!(counters.lost_while_busy >= 3, "{counters:?}");
    assert_eq!(u64::from(counters.missed_reported), counters.lost_while_busy);
    assert_eq!(counters.plates_served, counters.strokes - counters.lost_while_busy, "none was scanned later");
    assert!(host.heard.alarmed(Code::MissedStroke));
    host.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn parts_follow_each_other() {
    let (_press, host, counters) =
        run(Config { strokes: 4, parts: 3, baseline: true, ..quick() }, ms(5)).await;
    assert_clean(&counters);
    let parts: Vec<(u32, u32)> = counters.taken.iter().map(|taken| (taken.part_id, taken.bends)).collect();
    let expected: Vec<(u32, u32)> =
        (1..=3).flat_map(|part| (0..=4).map(move |bends| (part, bends))).collect();
    assert_eq!(parts, expected);
    let mut sessions: Vec<u16> = counters.taken.iter().map(|taken| taken.session_id).collect();
    sessions.dedup();
    assert_eq!((sessions.len(), counters.missed_reported), (3, 0));
    assert_eq!(*host.heard.part_ends.lock().unwrap(), 3);
    host.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_rescan_is_measured_as_a_new_attempt() {
    let press = SimPress::start(Config { automatic: false, ..quick() }).await.unwrap();
    let mut host = Host::start(tcp(press.modbus().unwrap()), Memory::new(7), press.control(), ms(10));
    host.until("ready", |status| status.host.ready).await;
    for (n, command) in
        [Command::Stroke, Command::Rescan, Command::Rescan, Command::Stroke].into_iter().enumerate()
    {
        press.command(command).unwrap();
        press.until("its result", LIMIT, |counters| counters.taken.len() == n + 1).await.unwrap();
    }
    let counters = press.counters();
    assert_clean(&counters);
    let identities: Vec<_> = counters.taken.iter().map(|it| (it.stroke_id, it.attempt, it.bends)).collect();
    assert_eq!(identities, [(1, 0, 1), (1, 1, 1), (1, 2, 1), (2, 0, 2)]);
    assert_eq!((counters.plates_served, counters.missed_reported), (4, 0));
    host.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn bad_habits_of_a_press_lose_nothing() {
    type Set = fn(&mut StrokeFaults);
    let habits: [(&str, Set); 6] = [
        ("torn numbers", |it| it.torn = 1.0),
        ("bouncing trigger", |it| it.bounce = 1.0),
        ("repeated trigger", |it| it.repeat_trigger = 1.0),
        ("numbers left out", |it| it.skip = 0.5),
        ("counter set back", |it| it.counter_back = 0.5),
        ("no acknowledge", |it| it.no_ack = 1.0),
    ];
    beside_each_other(habits.map(|(habit, set)| async move {
        let mut stroke_faults = StrokeFaults::default();
        set(&mut stroke_faults);
        let (_press, host, counters) =
            run(Config { strokes: 10, stroke_id: 100, stroke_faults, ..quick() }, ms(5)).await;
        assert_clean(&counters);
        assert_eq!((counters.strokes, counters.taken.len(), counters.plates_served), (10, 10, 10), "{habit}");
        let missed: Vec<_> = counters.taken.iter().map(|it| (it.stroke_id, it.words[9])).collect();
        assert_eq!(u64::from(counters.missed_reported), counters.skipped, "{habit}: {missed:?}");
        host.stop().await;
    }))
    .await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_number_left_out_before_the_first_stroke_is_missed() {
    let stroke_faults = StrokeFaults { skip: 1.0, ..StrokeFaults::default() };
    let (_press, host, counters) = run(Config { strokes: 3, stroke_faults, ..quick() }, ms(5)).await;
    assert_clean(&counters);
    assert_eq!((counters.taken[0].stroke_id, counters.taken.len()), (2, 3));
    assert_eq!((counters.missed_reported, counters.skipped), (3, 3));
    assert_eq!(counters.taken[0].words[9], 1, "missed_count with the first result");
    host.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_counter_wraps() {
    let (_press, host, counters) = run(Config { strokes: 10, stroke_id: 65_530, ..quick() }, ms(5)).await;
    assert_clean(&counters);
    let numbers: Vec<u16> = counters.taken.iter().map(|taken| taken.stroke_id).collect();
    assert_eq!(numbers, [65_531, 65_532, 65_533, 65_534, 65_535, 1, 2, 3, 4, 5]);
    assert_eq!(counters.missed_reported, 0);
    host.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_second_host_never_writes_and_the_first_goes_on() {
    let press = SimPress::start(Config { automatic: false, strokes: 10, ..quick() }).await.unwrap();
    let mut first = Host::start(tcp(press.modbus().unwrap()), Memory::new(7), press.control(), ms(5));
    first.until("ready", |status| status.host.ready).await;
    press.until("a heartbeat", LIMIT, |counters| counters.owners == [7]).await.unwrap();
    let mut second = Host::start(tcp(press.modbus().unwrap()), Memory::new(8), press.control(), ms(5));
    second.until("fault", |status| status.state.link == LinkState::Fault(Code::SecondHost)).await;
    press.command(Command::Automatic(true)).unwrap();
    let counters = press.until("all strokes", LIMIT, |counters| counters.done).await.unwrap();
    assert_clean(&counters);
    assert_eq!(
        (counters.owners.as_slice(), counters.taken.len(), counters.plates_served),
        (&[7][..], 10, 10)
    );
    assert!(second.heard.alarmed(Code::SecondHost));
    assert!(!first.heard.alarmed(Code::SecondHost));
    second.stop().await;
    first.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nothing_is_written_to_the_wrong_press() {
    let wrong = [
        (Config { press_id: 4, ..quick() }, Code::PressId),
        (Config { map_version: 2, ..quick() }, Code::MapVersion),
        (Config { map_version: 0, ..quick() }, Code::MapVersion),
    ];
    beside_each_other(wrong.map(|(config, code)| async move {
        let press = SimPress::start(Config { wait_ready: false, ..config }).await.unwrap();
        let mut host = Host::start(tcp(press.modbus().unwrap()), Memory::new(7), press.control(), ms(5));
        host.until("refusal", |status| status.link_error == Some(code)).await;
        press.until("some reads", LIMIT, |counters| counters.reads > 5).await.unwrap();
        assert_eq!(press.counters().writes, 0, "{code}");
        host.stop().await;
        assert_eq!(press.counters().writes, 0, "{code}, at the stop");
    }))
    .await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nothing_is_written_at_the_wrong_offset() {
    let config = Config { p_base: 1, h_base: 101, wait_ready: false, ..quick() };
    let press = SimPress::start(config).await.unwrap();
    let mut host = Host::start(tcp(press.modbus().unwrap()), Memory::new(7), press.control(), ms(5));
    host.until("refusal", |status| status.link_error == Some(Code::MapVersion)).await;
    press.until("many reads", LIMIT, |counters| counters.reads > 20).await.unwrap();
    assert!(!host.heard.alarmed(Code::TornBlock), "a shifted map is no torn block");
    assert_eq!(press.counters().writes, 0);
    host.stop().await;
    assert_eq!(press.counters().writes, 0, "at the stop");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn results_survive_a_frozen_press_and_a_cut_line() {
    let press = SimPress::start(Config { automatic: false, ..quick() }).await.unwrap();
    let mut host = Host::start(tcp(press.modbus().unwrap()), Memory::new(7), press.control(), ms(300));
    host.until("ready", |status| status.host.ready).await;
    for (n, disturbance) in
        [Command::FreezeMs(1200), Command::Cut, Command::HaltMs(700)].into_iter().enumerate()
    {
        press.command(Command::Stroke).unwrap();
        press.until("the scan", LIMIT, |counters| counters.plates_served == n as u64 + 1).await.unwrap();
        press.command(disturbance).unwrap();
        press.until("the result", LIMIT, |counters| counters.taken.len() == n + 1).await.unwrap();
    }
    let counters = press.counters();
    assert_clean(&counters);
    assert_eq!((counters.plates_served, counters.published, counters.missed_reported), (3, 3, 0));
    host.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_killed_host_delivers_or_reports_every_stroke() {
    let press = SimPress::start(Config { strokes: 40, ..quick() }).await.unwrap();
    let journal = Memory::new(7);
    let mut random = fastrand::Rng::with_seed(11);
    let mut kills = 0;
    let start = || Host::start(tcp(press.modbus().unwrap()), journal.clone(), press.control(), ms(30));
    let mut host = start();
    // Not a wait for an event: its length is the random moment of the kill.
    while press.until("done", ms(random.u64(30..200)), |counters| counters.done).await.is_err() {
        host.kill().await;
        kills += 1;
        host = start();
    }
    let counters = press.counters();
    println!("{kills} kills, {} strokes, {} results", counters.strokes, counters.taken.len());
    assert_clean(&counters);
    assert!(kills >= 10, "{kills} kills");
    assert_eq!(counters.taken.len() as u64, counters.strokes);
    assert!(journal.accepted().values().all(|&times| times == 1), "{:?}", journal.accepted());
    assert_eq!(counters.missed_reported, 0);
    host.stop().await;
    assert!(!press.h_block().status(status::READY));
}
