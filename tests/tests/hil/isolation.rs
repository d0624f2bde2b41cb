//! Isolation of plugins in worker processes: plugins that fail in every way, in the real host at a simulated press.
//!
//! The tests assert the result of the stroke and that the host continues; the error of each single fault is tested in
//! `contract::misbehaviour`.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use platen_tests::faulty;
use serde_json::Value as Json;

use crate::cell::{Host, Press, assert_clean, plant, until};

fn start(folder: &Path, config: &str, more: &str) -> (Press, PathBuf) {
    let press = Press::start(folder, config);
    let plant = plant(folder, &press.modbus, &format!("cell = \"{}\"", press.plate));
    let text = std::fs::read_to_string(&plant).unwrap();
    let text =
        text.replace("[press.link]", "timeouts = { scan_ms = 8000, evaluate_ms = 8000 }\n[press.link]");
    std::fs::write(&plant, text + more).unwrap();
    (press, plant)
}

/// Returns the workers of a host: their process identifiers.
fn workers(host: u32) -> Vec<u32> {
    let children = std::fs::read_dir(format!("/proc/{host}/task")).unwrap().flatten();
    let children = children.filter_map(|task| std::fs::read_to_string(task.path().join("children")).ok());
    children
        .flat_map(|list| list.split_whitespace().map(|n| n.parse().unwrap()).collect::<Vec<u32>>())
        .collect()
}

fn maps(process: u32) -> String {
    std::fs::read_to_string(format!("/proc/{process}/maps")).unwrap_or_default()
}

fn stroke(press: &mut Press) {
    until("ready", || (press.host_status() & 1 == 1).then_some(()));
    assert_eq!(press.ask(r#"{"do":"stroke"}"#)["ok"], true);
}

fn verdicts(plant: &Path) -> Vec<(u64, String, String)> {
    let mut strokes: Vec<(u64, String, String)> = Host::history(plant)
        .iter()
        .map(|record: &Json| {
            let text = |key: &str| record[key].as_str().unwrap_or_default().to_owned();
            (record["key"]["stroke"].as_u64().unwrap(), text("verdict"), text("reason"))
        })
        .collect();
    strokes.sort();
    strokes
}

#[test]
fn a_crash_an_exit_and_a_hang_cost_their_strokes_and_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let plugins = folder.path().join("plugins");
    faulty(&plugins, "template", "run", "segv", 3);
    faulty(&plugins, "harmonic", "run", "leave", 4);
    faulty(&plugins, "simulated", "run", "hang", 5);
    let (mut press, plant) = start(folder.path(), "strokes = 6\n[stroke_faults]", "");
    let mut host = Host::with_plugins(&plant, &plugins);
    let stats = press.wait_done();
    let log = host.log();
    assert_clean(&stats, &log);
    assert_eq!(host.stop(), Some(0), "{log}");
    let strokes = verdicts(&plant);
    println!("{strokes:#?}");
    let verdict = |stroke: u64| {
        let found: Vec<&str> =
            strokes.iter().filter(|(n, ..)| *n == stroke).map(|(_, verdict, _)| verdict.as_str()).collect();
        assert_eq!(found.len(), 1, "stroke {stroke}: {strokes:#?}\n{log}");
        found[0].to_owned()
    };
    assert_eq!(verdict(3), "cannot_tell");
    assert_eq!(verdict(4), "not_measured");
    assert_eq!(verdict(5), "not_measured");
    for stroke in [1, 2, 6] {
        assert_eq!(verdict(stroke), "fail", "measured");
    }
    assert!(log.contains("SIGSEGV") && log.contains("exit code 0") && log.contains("hangs"), "{log}");
}

#[test]
fn the_host_maps_no_plugin_and_its_workers_end_with_it() {
    let folder = tempfile::tempdir().unwrap();
    let plugins = folder.path().join("plugins");
    faulty(&plugins, "simulated", "run", "ignore_term", 0);
    let (mut press, plant) = start(folder.path(), "strokes = 8\nautomatic = false", "");
    let mut host = Host::with_plugins(&plant, &plugins);
    stroke(&mut press);
    press.wait_taken(1);
    let all = workers(host.process());
    assert_eq!(all.len(), 3, "scanner, flattening, comparison");
    for name in ["simulated", "harmonic", "template"] {
        let library = format!("lib{name}.so");
        assert!(!maps(host.process()).contains(&library), "{library} in the host");
        assert!(all.iter().any(|worker| maps(*worker).contains(&library)), "{library} in a worker");
    }
    let status = until("the plugins in the status", || {
        host.status().filter(|it| it["status"]["plugins"][2].is_object())
    });
    let plugins_of = |status: &Json| status["status"]["plugins"].as_array().unwrap().clone();
    for plugin in plugins_of(&status) {
        assert!(all.contains(&u32::try_from(plugin["process"].as_u64().unwrap()).unwrap()), "{plugin}");
        assert!(plugin["confinement"].as_str().is_some_and(|text| !text.is_empty()), "{plugin}");
    }

    // SIGTERM works although the driver ignores it, and ends the workers too.
    assert_eq!(host.stop(), Some(0), "{}", host.log());
    assert!(all.iter().all(|worker| maps(*worker).is_empty()), "{}", host.log());

    // The same holds for kill -9 in the middle of a scan.
    let host = Host::with_plugins(&plant, &plugins);
    stroke(&mut press);
    until("busy", || (press.host_status() & 2 == 2).then_some(()));
    let all = workers(host.process());
    host.kill();
    let killed = Instant::now();
    until("the end of the workers", || all.iter().all(|worker| maps(*worker).is_empty()).then_some(()));
    assert!(killed.elapsed() < Duration::from_secs(1), "{:?}", killed.elapsed());
}

#[test]
fn a_plugin_that_fails_too_often_is_out_of_use_until_its_file_is_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let plugins = folder.path().join("plugins");
    faulty(&plugins, "harmonic", "run", "segv", 0);
    let (mut press, plant) = start(folder.path(), "strokes = 8\nautomatic = false", "");
    let mut host = Host::with_plugins(&plant, &plugins);
    stroke(&mut press);
    // The second attempt is the second fault; the third occurs at the next stroke.
    press.wait_taken(1);
    stroke(&mut press);
    press.wait_taken(2);
    let out_of_use = |code: &Json| code.as_str().is_some_and(|text| text.starts_with("311 "));
    let status = until("alarm 311", || host.status().filter(|it| out_of_use(&it["status"]["error"])));
    assert_eq!(press.host_status() & 1, 0, "READY is off: {status:#}");
    assert!(status["status"]["plugins"].to_string().contains("quarantined after 3 faults"), "{status:#}");
    let list = |verb: &str| {
        let mut platen = platen_tests::program("platen");
        let output = platen.args(["plugins", "quarantine", verb]).arg(&plant).arg("--json").output().unwrap();
        serde_json::from_slice::<Json>(&output.stdout).unwrap()
    };
    let held = list("list");
    assert_eq!(
        (held[0]["plugin"].as_str(), held[0]["faults"].as_u64()),
        (Some("harmonic"), Some(3)),
        "{held:#}"
    );

    // Another build of the library is installed while the host runs.
    std::fs::copy(platen_tests::library("harmonic"), plugins.join("new")).unwrap();
    std::fs::rename(plugins.join("new"), plugins.join("libharmonic.so")).unwrap();
    stroke(&mut press);
    let stats = press.wait_taken(3);
    let log = host.log();
    assert_clean(&stats, &log);
    assert_ne!(stats["taken"][2]["words"][55], 0xFFFF, "measured: {stats:#}\n{log}");

    // The faulty build is still quarantined; released by name it may fail again.
    assert_eq!(list("clear")[0]["plugin"], "harmonic");
    assert_eq!(list("list"), serde_json::json!([]));
    assert_eq!(host.stop(), Some(0), "{log}");
}

#[test]
fn strokes_whose_driver_dies_at_any_moment_are_measured_or_reported() {
    let parts: usize = std::env::var("PLATEN_DEATHS").map_or(10, |n| n.parse().unwrap()) / 5;
    let folder = tempfile::tempdir().unwrap();
    let plugins = folder.path().join("plugins");
    faulty(&plugins, "simulated", "run", "maybe_die", 0);
    let (mut press, plant) =
        start(folder.path(), &format!("strokes = 5\nparts = {parts}\nbaseline = false"), "");
    let mut host = Host::with_plugins(&plant, &plugins);
    let stats = loop {
        // Out of use after too many faults, then released by the maintainer.
        if folder.path().join("results/quarantine.json").exists() {
            let mut platen = platen_tests::program("platen");
            platen.args(["plugins", "quarantine", "clear"]).arg(&plant).output().unwrap();
        }
        let stats = press.stats();
        if stats["done"] == true {
            break stats;
        }
        std::thread::park_timeout(Duration::from_millis(100));
    };
    let files = std::fs::read_dir(format!("/proc/{}/fd", host.process())).unwrap().count();
    assert!(files < 80 && workers(host.process()).len() <= 3, "{files} descriptors");
    assert_eq!(host.stop(), Some(0), "{}", host.log());
    let log = host.log();
    assert_clean(&stats, &log);
    let taken = stats["taken"].as_array().unwrap();
    let measured = taken.iter().filter(|result| result["words"][55] != 0xFFFF).count();
    let deaths = log.matches("its process ended: SIGILL").count();
    println!("{measured} of {} strokes measured, {files} descriptors, {deaths} deaths reported", taken.len());
    assert_eq!(taken.len(), 5 * parts, "{stats:#}\n{log}");
    assert_eq!(verdicts(&plant).len(), 5 * parts);
    assert!(deaths > 0 || parts < 4, "the driver died");
}

#[test]
fn the_figures_of_another_comparison_reach_no_register() {
    let folder = tempfile::tempdir().unwrap();
    let plugins = folder.path().join("plugins");
    // It reports "pass" and a largest gap of 0.
    faulty(&plugins, "curvature", "word", "gap_0", 0);
    let (mut press, plant) = start(folder.path(), "strokes = 1", "[[comparison]]\nplugin = \"curvature\"\n");
    let mut host = Host::with_plugins(&plant, &plugins);
    let stats = press.wait_done();
    let log = host.log();
    assert_eq!(host.stop(), Some(0), "{log}");
    let taken = stats["taken"].as_array().unwrap();
    let gap = taken.last().unwrap()["words"][55].as_u64().unwrap();
    assert!(gap > 100 && gap != 0xFFFF, "the template's gap, 0.01 mm: {gap}");
    assert!(verdicts(&plant).iter().all(|(_, verdict, _)| verdict != "pass"));
}
