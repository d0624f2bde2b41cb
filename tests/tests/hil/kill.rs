//! Crash tests with `kill -9` of the real host, at each point of a stroke and at random.
//!
//! Every stroke is delivered once or reported.
//!
//! The press holds the host at the point by its own behaviour, so no point depends on chance. `PLATEN_KILLS=500` sets
//! the number of random kills.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::cell::{Host, Press, assert_clean, plant, until};
use serde_json::Value as Json;

/// `error_code` of a stroke that a restart interrupted.
const INTERRUPTED: u64 = 208;
const BUSY: u64 = 1 << 1;
const VALID: u64 = 1 << 2;
const SCAN_DONE: u64 = 1 << 7;

/// Starts a press that makes strokes on request, and writes its plant.
fn cell_on_request() -> (tempfile::TempDir, Press, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let press = Press::start(folder.path(), "automatic = false");
    let plant = plant(folder.path(), &press.modbus, &format!("cell = \"{}\"", press.plate));
    (folder, press, plant)
}

fn order(press: &mut Press, command: &str) {
    let answer = press.ask(&format!("{{\"do\":{command}}}"));
    assert_eq!(answer["ok"], true, "{command}: {answer}");
}

fn wait_status(press: &mut Press, what: &str, bits: u64) {
    until(what, || (press.host_status() & bits == bits).then_some(()));
}

fn wait_ready(press: &mut Press) {
    until("ready", || (press.host_status() & (1 | BUSY) == 1).then_some(()));
}

/// Waits until the stroke has a recorded result.
fn wait_on_record(plant: &Path, stroke: usize) {
    until("the result on record", || {
        Host::history(plant)
            .iter()
            .any(|record| record["key"]["stroke"] == stroke && record["verdict"].is_string())
            .then_some(())
    });
}

/// Point at which a stroke is held until the host is killed, and the action that lets it continue afterwards.
struct Point {
    name: &'static str,
    before: &'static str,
    reach: fn(&mut Press, &Path, usize),
    after: &'static str,
    /// Whether the result must be a measurement (`true`), must be reported as interrupted, or may be either.
    measured: Option<bool>,
}

const POINTS: [Point; 6] = [
    Point {
        name: "accepted, waiting for the press to be clear",
        before: r#"{"mask":32}"#,
        reach: |press, _, _| wait_status(press, "busy", BUSY),
        after: r#"{"mask":0}"#,
        measured: Some(false),
    },
    Point {
        name: "scanning",
        before: r#"{"mask":0}"#,
        reach: |press, _, _| wait_status(press, "busy", BUSY),
        after: r#"{"mask":0}"#,
        measured: None,
    },
    Point {
        name: "scanned",
        before: r#"{"mask":4}"#,
        reach: |press, _, _| wait_status(press, "the scan", SCAN_DONE),
        after: r#"{"mask":0}"#,
        measured: None,
    },
    Point {
        name: "result on record, not in the registers",
        before: r#"{"mask":4}"#,
        reach: |press, plant, stroke| {
            wait_status(press, "busy", BUSY);
            order(press, r#"{"line_faults":{"no_answer":1.0}}"#);
            wait_on_record(plant, stroke);
        },
        after: r#"{"mask":0}"#,
        measured: Some(true),
    },
    Point {
        name: "result in the registers, not acknowledged",
        before: r#"{"mask":4}"#,
        reach: |press, _, _| wait_status(press, "the result", VALID),
        after: r#"{"mask":0}"#,
        measured: Some(true),
    },
    Point {
        name: "acknowledged, the acknowledge still standing",
        before: r#"{"mask":4}"#,
        reach: |press, _, stroke| {
            press.wait_taken(stroke);
            order(press, r#"{"force":4}"#);
            order(press, r#"{"mask":0}"#);
            until("the result withdrawn", || (press.host_status() & VALID == 0).then_some(()));
        },
        after: r#"{"force":0}"#,
        measured: Some(true),
    },
];

#[test]
fn a_host_killed_at_each_point_of_a_stroke() {
    let (_folder, mut press, plant) = cell_on_request();
    let mut host = Host::start(&plant);
    for (n, point) in POINTS.iter().enumerate() {
        let stroke = n + 1;
        wait_ready(&mut press);
        order(&mut press, point.before);
        order(&mut press, "\"stroke\"");
        (point.reach)(&mut press, &plant, stroke);
        if point.name.starts_with("result on record") {
            let waits = |status: &Json| status["status"]["result_waits_s"].is_number();
            until("the result that waits in the status", || host.status().filter(waits));
        }
        host.kill();
        order(&mut press, point.after);
        order(&mut press, r#"{"line_faults":{}}"#);
        host = Host::start(&plant);
        let stats = press.wait_taken(stroke);
        let taken = &stats["taken"][n];
        let log = host.log();
        assert_eq!(
            (taken["stroke_id"].as_u64(), stats["taken"].as_array().unwrap().len()),
            (Some(stroke as u64), stroke),
            "{}",
            point.name
        );
        let interrupted = taken["words"][6] == INTERRUPTED;
        println!("{}: {}", point.name, if interrupted { "reported as interrupted" } else { "measured" });
        if let Some(measured) = point.measured {
            assert_eq!(interrupted, !measured, "{}: {taken:#}\n{log}", point.name);
        }
        assert_clean(&stats, &log);
    }
    wait_ready(&mut press);
    assert_eq!(host.stop(), Some(0), "{}", host.log());
    check_record(&Host::history(&plant), POINTS.len());
}

/// Checks that no stroke is recorded twice, and none without its end.
fn check_record(history: &[Json], strokes: usize) {
    let keys: BTreeSet<String> = history.iter().map(|record| record["key"].to_string()).collect();
    assert_eq!((keys.len(), history.len()), (strokes, strokes), "{history:#?}");
    for record in history {
        assert!(record["verdict"].is_string(), "{record:#}");
    }
}

#[test]
fn a_host_killed_at_random() {
    let kills: usize = std::env::var("PLATEN_KILLS").map_or(25, |kills| kills.parse().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let mut press = Press::start(folder.path(), "strokes = 5\nparts = 100000\nbaseline = false");
    let plant = plant(folder.path(), &press.modbus, &format!("cell = \"{}\"", press.plate));
    let seed = 0x5EED;
    let mut random = fastrand::Rng::with_seed(seed);
    for _ in 0..kills {
        let host = Host::start(&plant);
        // Not a wait for an event: its length is the random moment of the kill.
        std::thread::sleep(std::time::Duration::from_millis(random.u64(50..1500)));
        host.kill();
    }
    let mut host = Host::start(&plant);
    order(&mut press, r#"{"automatic":false}"#);
    // No stroke is in progress any more: state 2 is a ram at rest.
    until("the ram at rest", || {
        (press.ask(r#"{"get":"registers"}"#)["registers"]["p"][6] == 2).then_some(())
    });
    let stats = until("the last result", || {
        let stats = press.stats();
        let count = |name: &str| stats[name].as_u64().unwrap();
        let open = count("strokes") - count("superseded") > stats["taken"].as_array().unwrap().len() as u64;
        (!open).then_some(stats)
    });
    assert_eq!(host.stop(), Some(0), "{}", host.log());
    let log = host.log();
    assert_clean(&stats, &log);
    let taken = stats["taken"].as_array().unwrap();
    let interrupted = taken.iter().filter(|taken| taken["words"][6] == INTERRUPTED).count();
    println!(
        "seed {seed}: {kills} kills, {} strokes: {} results, {interrupted} of them reported as interrupted",
        stats["strokes"],
        taken.len()
    );
    assert_eq!((stats["superseded"].as_u64(), stats["host_deaths"].as_u64()), (Some(0), Some(0)), "{log}");
    assert_eq!(stats["strokes"], taken.len(), "each stroke has one result");
    check_record(&Host::history(&plant), taken.len());
}
