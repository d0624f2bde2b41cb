//! Tests of `platen press` and `platen status` against a simulated press in a process of its own.

use std::path::Path;
use std::process::{Command, Output};

use crate::cell::{Host, Press, plant, until};
use serde_json::Value as Json;

/// Runs `platen press VERB PLANT ...`.
fn verb(verb: &str, plant: &Path, rest: &[&str]) -> Output {
    platen_tests::program("platen").args(["press", verb]).arg(plant).args(rest).output().unwrap()
}

fn json(output: &Output) -> Json {
    let text = String::from_utf8_lossy(&output.stdout);
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|e| panic!("{e}: {text}\n{}", String::from_utf8_lossy(&output.stderr)))
}

/// Starts an idle press and writes a plant file for it.
fn idle() -> (tempfile::TempDir, Press, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let press = Press::start(folder.path(), "automatic = false");
    let plant = plant(folder.path(), &press.modbus, "shape = \"flat\"");
    (folder, press, plant)
}

#[test]
fn check_needs_no_press() {
    let folder = tempfile::tempdir().unwrap();
    let plant = plant(folder.path(), "127.0.0.1:9", "shape = \"flat\"");
    let said = json(&verb("check", &plant, &["--json"]));
    assert_eq!(
        (said["may_write"].as_str(), said["counts_strokes"].as_bool()),
        (Some("100..=163"), Some(true))
    );
    assert_eq!(said["exchanges"][0]["registers"], 32);
    let people = verb("check", &plant, &[]);
    assert!(String::from_utf8_lossy(&people.stdout).contains("holding registers 100..=163 and no others"));
    let map = json(&verb("map", &plant, &["--json"]));
    assert_eq!(map["press_to_host"].as_array().unwrap().len(), 32, "{map:#}");
    assert_eq!(map["may_write"], "100..=163");
    let alarms = json(&verb("map", &plant, &["--format", "alarms", "--language", "ja", "--json"]));
    assert_eq!((alarms[0]["code"].as_u64(), alarms[0]["severity"].as_str()), (Some(101), Some("error")));
    assert!(alarms[0]["text"].as_str().unwrap().contains("プレス"), "{alarms}");
    std::fs::write(&plant, "[press]\nname = \"x\"\n").unwrap();
    assert_eq!(verb("check", &plant, &["--json"]).status.code(), Some(2));
}

#[test]
fn a_press_that_is_not_there_is_a_failure_of_the_link() {
    let folder = tempfile::tempdir().unwrap();
    let nobody = platen_tests::unserved_address().unwrap();
    let plant = plant(folder.path(), &nobody.to_string(), "shape = \"flat\"");
    for name in ["ping", "dump", "scan-unit"] {
        let output = verb(name, &plant, &["--json"]);
        assert_eq!(
            (output.status.code(), json(&output)["cause"].as_str()),
            (Some(1), Some("link")),
            "{name}"
        );
        assert!(String::from_utf8_lossy(&output.stderr).contains("check that it is on"), "{name}");
    }
}

#[test]
fn the_readers_find_what_stands_there_and_never_write() {
    let (_folder, mut press, plant) = idle();
    let ping = json(&verb("ping", &plant, &["-n", "5", "--json"]));
    assert_eq!(
        (ping["reads"].as_u64(), ping["second_connection"].as_bool()),
        (Some(5), Some(true)),
        "{ping}"
    );

    let units = json(&verb("scan-unit", &plant, &["1..3", "--json"]));
    assert_eq!(units["units"].as_array().unwrap().len(), 1, "{units}");
    assert_eq!(units["units"][0]["unit"], 1);
    assert_eq!(verb("scan-unit", &plant, &["2..3"]).status.code(), Some(1), "nobody answers there");

    let named = json(&verb("dump", &plant, &["--json"]));
    assert_eq!(named["fields"]["press"]["press_id"], "3", "{named}");
    let range = json(&verb("dump", &plant, &["--range", "4..8", "--json"]));
    assert_eq!(range["words"][3], serde_json::json!([7, 3]), "register 7 is the press's number: {range}");

    // The value of part_id is 1, in the registers 8 and 9, high word first.
    let probe = verb("probe-order", &plant, &["--at", "8", "--expect", "1"]);
    let text = String::from_utf8_lossy(&probe.stdout).into_owned();
    assert_eq!(probe.status.code(), Some(0), "{text}");
    assert!(text.contains("{ at = \"@8\", type = \"u32\", order = \"ABCD\" }"), "{text}");
    assert_eq!(verb("probe-order", &plant, &["--at", "8", "--expect", "-12.5"]).status.code(), Some(1));

    let stats = press.stats();
    assert_eq!(stats["writes"], 0, "{stats:#}");
}

#[test]
fn a_recording_is_played_again() {
    let (folder, _press, plant) = idle();
    let file = folder.path().join("field.jsonl");
    let name = file.to_str().unwrap();
    let recorded = json(&verb("record", &plant, &[name, "--for-s", "1", "--json"]));
    let lines = std::fs::read_to_string(&file).unwrap();
    assert_eq!(recorded["lines"].as_u64().unwrap() as usize, lines.lines().count());
    let first: Json = serde_json::from_str(lines.lines().next().unwrap()).unwrap();
    assert_eq!((first["fc"].as_u64(), first["addr"].as_u64()), (Some(3), Some(0)));
    assert_eq!(first["words"].as_array().unwrap().len(), 32);
    let replayed = json(&verb("replay", &plant, &[name, "--json"]));
    assert_eq!(
        (replayed["accepted"].clone(), replayed["agrees"].as_bool()),
        (serde_json::json!([]), Some(true))
    );
    std::fs::write(&file, "{}\n").unwrap();
    let broken = verb("replay", &plant, &[name]);
    assert_eq!(broken.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&broken.stderr).contains("field.jsonl:1:"));
}

#[test]
fn a_guided_handshake_keeps_every_step() {
    let folder = tempfile::tempdir().unwrap();
    let mut press = Press::start(folder.path(), "strokes = 2\nbaseline = false");
    let plant = plant(folder.path(), &press.modbus, "shape = \"flat\"");
    let tried = verb("test", &plant, &["--strokes", "2", "--json"]);
    let steps = json(&tried);
    let names: Vec<_> =
        steps["steps"].as_array().unwrap().iter().map(|it| it["step"].as_str().unwrap()).collect();
    for step in
        ["in step", "heartbeat of the press", "stroke 2: trigger to busy", "stroke 2: result", "acknowledge"]
    {
        assert!(names.contains(&step), "{step} is not in {steps:#}");
    }
    let stats = press.stats();
    crate::cell::assert_clean(&stats, "");
    // The bit `simulated` was set with every result.
    for taken in stats["taken"].as_array().unwrap() {
        assert_ne!(taken["words"][2].as_u64().unwrap() & 1 << 9, 0, "{taken}");
    }
    assert_eq!(press.host_status(), 0, "safe after the trial");
}

#[test]
fn a_guided_handshake_with_a_press_of_another_number_says_so() {
    let (_folder, mut press, plant) = idle();
    press.ask(r#"{"do":{"press_id":4}}"#);
    let tried = verb("test", &plant, &["--json"]);
    assert_eq!((tried.status.code(), json(&tried)["cause"].as_str()), (Some(1), Some("handshake")));
    assert!(json(&tried)["error"].as_str().unwrap().contains("502 "), "{}", json(&tried));
    assert_eq!(press.stats()["writes"], 0);
}

#[test]
fn a_write_test_writes_figures_and_leaves_none() {
    let (_folder, mut press, plant) = idle();
    assert_eq!(verb("write-test", &plant, &[]).status.code(), Some(2), "not without --i-know");
    let written = verb("write-test", &plant, &["--i-know", "--json"]);
    let fields = json(&written);
    assert_eq!((written.status.code(), fields["good"].as_bool()), (Some(0), Some(true)), "{fields:#}");
    let stats = press.stats();
    assert_eq!(
        (stats["writes_outside"].as_u64(), stats["published"].as_u64()),
        (Some(0), Some(0)),
        "{stats:#}"
    );
    let words = press.ask(r#"{"get":"registers"}"#);
    let words = words["registers"]["h"].as_array().unwrap();
    assert_eq!(
        (words[2].as_u64(), words[10].as_u64(), words[55].as_u64()),
        (Some(0), Some(0x8000), Some(0xFFFF))
    );
}

#[test]
fn soak_on_each_line() {
    let soak = |line: &str, strokes: &str, wanted: u64| {
        let output = platen_tests::program("platen")
            .args(["press", "soak", "-n", strokes, "--line", line, "--json"])
            .output()
            .unwrap();
        let run = json(&output);
        assert_eq!((output.status.code(), run["good"].as_bool()), (Some(0), Some(true)), "{line}: {run:#}");
        assert_eq!(
            (run["strokes"].as_u64(), run["scans"].as_u64()),
            (Some(wanted), Some(wanted)),
            "{line}: {run:#}"
        );
    };
    // Each has a press of its own, and is idle most of the time.
    std::thread::scope(|scope| {
        for (line, strokes, wanted) in [("tcp", "60", 100), ("rtu-over-tcp", "12", 12), ("rtu", "12", 12)] {
            scope.spawn(move || soak(line, strokes, wanted));
        }
    });
}

#[test]
fn a_fault_is_reset_and_the_figures_are_for_prometheus() {
    let (_folder, mut press, plant) = idle();
    let mut host = Host::start(&plant);
    until("ready", || (press.host_status() & 1 == 1).then_some(()));
    press.ask(r#"{"do":{"line_faults":{"exception":1.0,"exception_code":1}}}"#);
    until("the fault", || host.status().filter(|it| it["status"]["state"] == "fault"));
    press.ask(r#"{"do":{"line_faults":{}}}"#);
    let reset = verb("reset", &plant, &["--json"]);
    assert!(reset.status.code().is_some_and(|code| code <= 1), "{}", String::from_utf8_lossy(&reset.stderr));
    assert_eq!(json(&reset)["reset"], true);
    until("ready again", || host.status().filter(|it| it["status"]["state"] == "idle"));

    let text = Command::new(platen_tests::program("platen").get_program())
        .arg("status")
        .arg(&plant)
        .arg("--prometheus")
        .output()
        .unwrap();
    let text = String::from_utf8(text.stdout).unwrap();
    for line in [
        "platen_up{press=\"press\"} 1",
        "platen_error{press=\"press\"} 0",
        "platen_strokes_total{press=\"press\"} 0",
        "platen_results_waiting{press=\"press\"} 0",
        "platen_records_lost_total{press=\"press\"} 0",
    ] {
        assert!(text.lines().any(|it| it == line), "{line} is not in\n{text}");
    }
    for metric in
        ["platen_exceptions_total{press=\"press\",code=\"01\"}", "platen_disk_free_bytes{press=\"press\"}"]
    {
        assert!(text.contains(metric), "{metric} is not in\n{text}");
    }
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let (_, value) = line.rsplit_once(' ').unwrap();
        assert!(value.parse::<f64>().is_ok(), "{line}");
    }
    assert_eq!(host.stop(), Some(0), "{}", host.log());
    assert_eq!(verb("reset", &plant, &[]).status.code(), Some(1), "no host runs any more");
}
