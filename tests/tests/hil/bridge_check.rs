//! Tests of `platen bridge check` against the simulator's bridge, without and with faults: each fault fails its tests
//! and no other.

use std::net::SocketAddr;
use std::time::Duration;

use platen_sim_scanner::stream::BridgeConfig;
use serde_json::Value as Json;

use crate::stream;

/// Returns the names of the tests with this result, of those whose names contain `only`.
fn tests(address: SocketAddr, only: &str, result: &str) -> Vec<String> {
    let mut platen = platen_tests::program("platen");
    platen.args(["bridge", "check", &address.to_string(), "--limit-s", "5", "--only", only, "--json"]);
    let output = platen.output().unwrap();
    let report: Json = serde_json::from_slice(&output.stdout).unwrap();
    let outcomes = report["tests"].as_array().unwrap();
    assert_eq!(output.status.success(), outcomes.iter().all(|it| it["verdict"]["failed"].is_null()));
    let is = |outcome: &Json| outcome["verdict"] == result || outcome["verdict"][result].is_string();
    outcomes.iter().filter(|it| is(it)).map(|it| it["test"].as_str().unwrap().to_owned()).collect()
}

#[test]
fn the_bridge_of_the_simulator_passes() {
    // Slow enough to be aborted.
    let config = BridgeConfig { time_scale: 0.2, ..BridgeConfig::default() };
    let bridge = stream::start(&[], config, stream::head());
    let passed = tests(bridge.address(), "", "passed");
    assert_eq!(passed.len(), 34, "only these: {passed:?}");
}

#[test]
fn each_fault_of_a_bridge_is_found() {
    let cases: [(&str, &[&str]); 14] = [
        ("version-mismatch", &["hello.answered"]),
        ("wrong-digest", &["scan.digest"]),
        ("missing-column=5", &["scan.complete", "scan.digest", "scan.again"]),
        ("late-frames", &["scan.complete"]),
        ("zero-length=7", &["scan.complete"]),
        ("torn-column=9", &["scan.complete"]),
        ("event-lost", &["scan.complete"]),
        ("corrupt-frame=9", &["scan.complete"]),
        ("corrupt-end", &["scan.complete"]),
        ("corrupt-header=5", &["scan.complete"]),
        ("oversize=5", &["scan.complete"]),
        ("unknown-command=4", &["scan.complete"]),
        // Allowed.
        ("repeated=4", &[]),
        ("unknown-frame=4", &[]),
    ];
    for (fault, expected) in cases {
        let bridge = stream::bridge(&[fault]);
        let only = if fault == "version-mismatch" { "hello.answered" } else { "scan." };
        assert_eq!(tests(bridge.address(), only, "failed"), expected, "{fault}");
    }
}

#[test]
fn without_a_bridge_one_test_fails_and_the_others_are_left_out() {
    let nobody = platen_tests::unserved_address().unwrap();
    let start = std::time::Instant::now();
    assert_eq!(tests(nobody, "", "failed"), ["hello.answered"]);
    assert!(start.elapsed() < Duration::from_secs(60), "it does not try each again");
}

#[test]
fn a_bridge_is_found_by_datagram() {
    let bridge = stream::bridge(&[]);
    let find = |address: &str| {
        let mut platen = platen_tests::program("platen");
        platen.args(["plugins", "find", "faro-stream", "--option", &format!("address={address}"), "--json"]);
        let output = platen.output().unwrap();
        (output.status.code(), String::from_utf8_lossy(&output.stdout).into_owned())
    };
    let (code, text) = find(&bridge.address().to_string());
    let found: Json = serde_json::from_str(&text).unwrap();
    assert_eq!(code, Some(0), "{text}");
    let expected = serde_json::json!([{
        "option": "address", "value": bridge.address().to_string(), "about": "platen simulated scanner SIM0001",
    }]);
    assert_eq!(found, expected);
    assert_eq!(find(&platen_tests::unserved_address().unwrap().to_string()), (Some(1), "[]\n".to_owned()));
}
