//! Peer test of the real `platen run`: it is driven by a press on another Modbus stack, and its words are read by a
//! third.
//!
//! The test needs pymodbus (a Python that has it in `PLATEN_PYTHON`, else `python3`) and mbpoll. If they are missing,
//! the test prints so and ends; with `PLATEN_PEERS=all`, as in CI, that is a failure.

use std::io::{BufRead as _, BufReader};
use std::process::{Command, Stdio};

use crate::cell::{Host, plant};
use serde_json::Value as Json;

fn python() -> String {
    std::env::var("PLATEN_PYTHON").unwrap_or_else(|_| "python3".into())
}

fn installed(program: &str, argument: &[&str]) -> bool {
    let run = Command::new(program).args(argument).stdout(Stdio::null()).stderr(Stdio::null()).status();
    let there = run.is_ok_and(|status| status.success());
    let wanted = std::env::var("PLATEN_PEERS").is_ok_and(|peers| peers == "all");
    assert!(there || !wanted, "{program} {argument:?} cannot be run; see tests/peers/README.md");
    there
}

#[test]
fn a_pymodbus_press_gets_twenty_right_results() {
    if !installed(&python(), &["-c", "import pymodbus"]) || !installed("sh", &["-c", "command -v mbpoll"]) {
        eprintln!("left out: pymodbus or mbpoll is not installed");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    // The press waits 30 s for a host; a build takes longer.
    platen_tests::built();
    let peers = platen_tests::repository().join("tests/peers");
    let mut press = Command::new(python())
        .arg(peers.join("pymodbus_press.py"))
        .args(["--strokes", "20", "--recipe", "9", "--press-id", "3", "--read-s", "0.3"])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(press.stdout.take().unwrap()).lines();
    let first: Json = serde_json::from_str(&lines.next().unwrap().unwrap()).unwrap();
    let address = format!("127.0.0.1:{}", first["port"]);
    let plant = plant(folder.path(), &address, "shape = \"cylinder\"\nradius_mm = 9018.0");
    let mut host = Host::start(&plant);

    // While it runs, and the press leaves every result valid for 0.3 s, mbpoll reads the words of the host's newest
    // result in the press's registers.
    let words = crate::cell::until("mbpoll", || {
        let output =
            Command::new(peers.join("mbpoll_words.sh")).args([&address, "100", "64"]).output().unwrap();
        let words: Vec<u64> = serde_json::from_slice(&output.stdout).ok()?;
        (words[2] & 4 != 0 && words[8] == words[53]).then_some(words)
    });
    let summary: Json = serde_json::from_str(&lines.next().unwrap().unwrap()).unwrap();
    assert!(press.wait().unwrap().success(), "{summary:#}\n{}", host.log());
    assert_eq!(host.stop(), Some(0), "{}", host.log());

    let history = Host::history(&plant);
    let run_id = words[50] << 16 | words[51];
    let record = history.iter().find(|r| r["run_id"] == run_id).unwrap();
    assert_eq!(record["key"]["stroke"], words[4]);
    let gap = record["figures"]["gap.max"].as_f64().unwrap() * 1e5;
    assert!((gap - words[55] as f64).abs() < 0.51, "record {gap}, mbpoll {}", words[55]);
    assert!(history.len() >= 20, "{}", history.len());
}
