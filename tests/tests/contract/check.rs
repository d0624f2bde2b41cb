//! Tests of `platen plugins check`: our own plugins pass it, each faulty one fails the test for its fault and no other.

use std::path::Path;
use std::process::Output;

use platen_tests::faulty;
use serde_json::Value as Json;

fn check(library: &Path, more: &[&str]) -> Output {
    platen_tests::program("platen").args(["plugins", "check"]).arg(library).args(more).output().unwrap()
}

/// Returns the names of the tests that failed.
fn failed(library: &Path, more: &[&str]) -> Vec<String> {
    let output = check(library, &[&["--json"], more].concat());
    let report: Json = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|_| panic!("{}", String::from_utf8_lossy(&output.stderr)));
    let tests = report["tests"].as_array().unwrap().iter();
    let failed = tests.filter(|test| test["verdict"]["failed"].is_string());
    let failed: Vec<String> = failed.map(|test| test["test"].as_str().unwrap().to_owned()).collect();
    assert_eq!(output.status.code(), Some(i32::from(!failed.is_empty())), "{report:#}");
    failed
}

#[test]
fn our_flattenings_and_comparisons_pass() {
    for plugin in ["elastic", "harmonic", "abf", "template", "curvature", "displacement"] {
        // The slowest plugin takes 10 s for 30 jobs; for it one name of each level's tests is run instead.
        let level = if ["harmonic", "template"].contains(&plugin) { "3" } else { "2" };
        let output = check(&platen_tests::library(plugin), &["--level", level]);
        let text = String::from_utf8_lossy(&output.stdout);
        // The time of loading depends on the other load of the machine.
        let warned = text.lines().any(|line| line.starts_with("warning") && !line.contains("load.quick"));
        assert!(output.status.success() && !warned, "{plugin}: {text}");
    }
}

#[test]
fn our_drivers_pass_what_needs_no_device() {
    for plugin in ["faro-file", "faro-stream", "simulated"] {
        let found = failed(&platen_tests::library(plugin), &["--level", "1"]);
        assert!(found.is_empty(), "{plugin}: {found:?}");
    }
}

/// Place of the fault, the fault, and the test that finds it.
const FAULTS: [(&str, &str, &str, &str); 36] = [
    ("harmonic", "constructor", "segv", "load.loads"),
    ("harmonic", "constructor", "leave", "load.loads"),
    ("harmonic", "constructor", "give_up", "load.loads"),
    ("harmonic", "constructor", "hang", "load.loads"),
    ("harmonic", "constructor", "print", "load.silent"),
    ("harmonic", "constructor", "start_thread", "load.threads"),
    ("harmonic", "init", "segv", "load.loads"),
    ("harmonic", "init", "leave_3", "load.loads"),
    ("harmonic", "init", "print", "load.silent"),
    ("harmonic", "desc", "no_vendor", "load.words"),
    ("harmonic", "desc", "no_licence", "load.words"),
    ("harmonic", "desc", "no_purpose", "load.words"),
    ("harmonic", "desc", "every_time_another", "load.same"),
    ("harmonic", "desc", "options_twice", "load.options"),
    ("harmonic", "desc", "option_unexplained", "load.options"),
    ("harmonic", "desc", "option_beyond", "load.options"),
    ("harmonic", "desc", "option_shouted", "load.options"),
    ("harmonic", "create", "segv", "options.default"),
    ("harmonic", "create", "leave", "options.default"),
    ("harmonic", "create", "hang", "options.default"),
    ("harmonic", "run", "segv", "answer.given"),
    ("harmonic", "run", "leave", "answer.given"),
    ("harmonic", "run", "overflow", "answer.given"),
    ("harmonic", "run", "hang", "answer.given"),
    ("harmonic", "run", "open_file", "answer.given"),
    ("harmonic", "run", "fork_away", "answer.given"),
    ("harmonic", "run", "eat_memory", "answer.given"),
    ("harmonic", "run", "print", "answer.silent"),
    ("harmonic", "run", "leak", "leak.memory"),
    ("harmonic", "word", "chart_moved", "answer.given"),
    ("elastic", "word", "sigma_nan", "answer.given"),
    ("harmonic", "word", "chart_off", "sense.lengths"),
    ("harmonic", "word", "chart_of_process", "answer.same"),
    ("harmonic", "word", "chart_of_job", "answer.again"),
    ("curvature", "word", "figure_null", "answer.given"),
    ("curvature", "word", "figure_twice", "answer.given"),
];

#[test]
fn each_fault_fails_its_test() {
    let folder = tempfile::tempdir().unwrap();
    for (plugin, place, fault, test) in FAULTS {
        let plugins = folder.path().join(format!("{place}-{fault}"));
        faulty(&plugins, plugin, place, fault, 0);
        let library = plugins.join(platen_tests::library(plugin).file_name().unwrap());
        let found = failed(&library, &["--limit", "2"]);
        assert_eq!(found, [test], "{place} {fault}");
    }
}

#[test]
fn a_plugin_that_ignores_its_deadline_is_found() {
    let folder = tempfile::tempdir().unwrap();
    faulty(folder.path(), "harmonic", "run", "doze", 0);
    let library = folder.path().join(platen_tests::library("harmonic").file_name().unwrap());
    assert_eq!(failed(&library, &["--only", "deadline"]), ["deadline.kept"]);
}

#[test]
fn what_is_no_plugin_gets_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let whole = std::fs::read(platen_tests::library("harmonic")).unwrap();
    for (name, content, test) in [
        ("text.so", b"no library at all".as_slice(), "file.library"),
        ("cut.so", &whole[..whole.len() / 3], "file.library"),
        ("program.so", &std::fs::read("/bin/sh").unwrap(), "file.entry"),
    ] {
        let file = folder.path().join(name);
        std::fs::write(&file, content).unwrap();
        assert_eq!(failed(&file, &[]).first().map(String::as_str), Some(test), "{name}");
    }
    let missing = check(&folder.path().join("missing.so"), &[]);
    assert_eq!(missing.status.code(), Some(2));
}

#[test]
fn the_outcome_is_written_as_junit() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("report.xml");
    let report = file.to_str().unwrap();
    let output = check(&platen_tests::library("harmonic"), &["--level", "1", "--junit", report]);
    assert!(output.status.success());
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(
        text.starts_with("<?xml") && text.contains("failures=\"0\"") && text.contains("name=\"load.loads\""),
        "{text}"
    );
}
