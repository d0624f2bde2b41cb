//! Faults of a plugin in one measurement: the program reports the plugin and how it ended, prints none of its output,
//! and leaves no process.

use std::path::{Path, PathBuf};
use std::process::Output;

use platen_tests::faulty;
use serde_json::Value as Json;

/// Folder with a scan of a plate, its plate file, and a folder for faulty plugins.
pub(crate) struct Bench(tempfile::TempDir);

impl Bench {
    pub(crate) fn new() -> Self {
        Self::rolled(90.0)
    }

    /// Creates a plate rolled to 6 m about an axis at this angle to its u, degrees.
    pub(crate) fn rolled(axis_deg: f64) -> Self {
        let bench = Self(tempfile::tempdir().unwrap());
        std::fs::write(
            bench.file("plate.toml"),
            "[plate]\nid = \"P\"\nwidth_mm = 2000.0\nheight_mm = 2500.0\nthickness_mm = 36.0\n",
        )
        .unwrap();
        let plant = "[plant]\nname = \"test\"\n[flattening]\nplugin = \"harmonic\"\n[[comparison]]\nplugin = \"template\"\n\
                     [[comparison]]\nplugin = \"curvature\"\n";
        std::fs::write(bench.file("plant.toml"), plant).unwrap();
        let simulated = bench.file("sim.toml");
        let text = format!(
            "strokes = 0\nshape = {{ shape = \"cylinder\", radius_mm = 6000.0, axis_deg = {axis_deg:?} }}\n\
             [blank]\nwidth_mm = 2500.0\nheight_mm = 2000.0\nthickness_mm = 36.0\n\
             [pose]\ncentre_mm = [6000.0, 0.0, -3600.0]\nyaw_deg = 0.0\n"
        );
        std::fs::write(&simulated, text).unwrap();
        let mut sim = platen_tests::program("platen-sim");
        sim.arg("scanner")
            .arg(simulated)
            .arg("--out")
            .arg(bench.file("scan.e57"))
            .args(["--step-deg", "0.1"]);
        let made = sim.output().unwrap();
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        bench
    }

    pub(crate) fn file(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Measures the scan; plugins of this folder are found first.
    pub(crate) fn measure(&self, plugins: &Path, more: &[&str]) -> Output {
        let mut platen = platen_tests::program("platen");
        platen
            .arg("--plugins")
            .arg(plugins)
            .arg("--json")
            .args(more)
            .arg("measure")
            .arg(self.file("scan.e57"));
        platen.arg("--plate").arg(self.file("plate.toml")).arg("--plant").arg(self.file("plant.toml"));
        platen.output().unwrap()
    }

    /// Measures with one faulty plugin; returns the output as text.
    fn with_fault(&self, name: &str, place: &str, fault: &str) -> Measured {
        let plugins = self.file(&format!("{name}-{place}-{fault}"));
        faulty(&plugins, name, place, fault, 0);
        let output = self.measure(&plugins, &[]);
        let left = left_behind(&plugins);
        assert!(left.is_empty(), "{name} {place} {fault} left behind: {left:?}");
        Measured {
            code: output.status.code(),
            out: String::from_utf8(output.stdout).unwrap(),
            error: String::from_utf8(output.stderr).unwrap(),
        }
    }
}

struct Measured {
    code: Option<i32>,
    out: String,
    error: String,
}

/// Returns the processes that have mapped a library of this folder.
fn left_behind(folder: &Path) -> Vec<String> {
    let maps = std::fs::read_dir("/proc").unwrap().flatten().filter_map(|process| {
        let text = std::fs::read_to_string(process.path().join("maps")).ok()?;
        text.contains(folder.to_str().unwrap()).then(|| process.path().display().to_string())
    });
    maps.collect()
}

/// Fault in `run`, and the words that report it.
const ENDS: [(&str, &str); 5] = [
    ("segv", "SIGSEGV"),
    ("leave", "exit code 0"),
    ("leave_3", "exit code 3"),
    ("give_up", "SIGABRT"),
    ("overflow", "SIGSEGV"),
];

#[test]
fn a_flattening_or_driver_that_ends_is_named_with_how_it_ended() {
    let bench = Bench::new();
    for plugin in ["harmonic", "faro-file"] {
        for (fault, how) in ENDS {
            let measured = bench.with_fault(plugin, "run", fault);
            let text = format!("{plugin} {fault}: {}", measured.error);
            assert_eq!(measured.code, Some(1), "{text}");
            assert!(measured.out.is_empty(), "{text}");
            assert!(measured.error.contains(&format!("{plugin}: its process ended: {how}")), "{text}");
        }
    }
}

#[test]
fn a_plugin_that_closes_every_descriptor_loses_its_process() {
    let bench = Bench::new();
    for plugin in ["harmonic", "faro-file"] {
        let measured = bench.with_fault(plugin, "run", "close_all");
        assert!(
            measured.code == Some(1) && measured.error.contains("its process ended"),
            "{}",
            measured.error
        );
    }
}

#[test]
fn a_comparison_that_ends_leaves_the_others_in_force() {
    let bench = Bench::new();
    for (fault, how) in ENDS {
        let measured = bench.with_fault("curvature", "run", fault);
        let result: Json = serde_json::from_str(&measured.out).unwrap();
        let comparisons = result["comparisons"].as_array().unwrap();
        let failed: Vec<&str> = comparisons.iter().filter_map(|report| report["error"].as_str()).collect();
        assert!(comparisons.len() == 2 && failed.len() == 1, "{fault}: {failed:?}");
        assert!(failed[0].starts_with("curvature: ") && failed[0].contains(how), "{fault}: {failed:?}");
        assert_ne!(result["verdict"], "pass", "{fault}: {failed:?}");
    }
}

/// Calls that a flattening or comparison does not need.
const CLOSED: [&str; 4] = ["open_file", "open_socket", "shell", "fork_away"];

#[test]
fn a_flattening_that_reaches_for_files_sockets_or_programs_is_ended() {
    let bench = Bench::new();
    for fault in CLOSED {
        let measured = bench.with_fault("harmonic", "run", fault);
        assert_eq!(measured.code, Some(1), "{fault}: {}", measured.error);
        // system() blocks the signal whose handler would print the call.
        assert!(
            fault == "shell" || measured.error.contains("is closed to flattenings and comparisons"),
            "{fault}: {}",
            measured.error
        );
        assert!(measured.error.contains("SIGSYS"), "{fault}: {}", measured.error);
    }
}

#[test]
fn limits_bite() {
    let bench = Bench::new();
    for plugin in ["harmonic", "faro-file"] {
        for fault in ["eat_memory", "eat_files"] {
            let measured = bench.with_fault(plugin, "run", fault);
            // The plugin stops when it receives no more; without a limit it would hang.
            let ended = if plugin == "harmonic" && fault == "eat_files" { "SIGSYS" } else { "SIGABRT" };
            assert!(measured.error.contains(ended), "{plugin} {fault}: {}", measured.error);
            assert_eq!(measured.code, Some(1));
        }
    }
}

#[test]
fn what_a_plugin_does_to_its_own_process_costs_nothing() {
    let bench = Bench::new();
    let sound = bench.measure(&bench.file("none"), &[]);
    let comparable = |text: &str| {
        let mut result: Json = serde_json::from_str(text).unwrap_or_else(|why| panic!("{why}: {text}"));
        for key in ["timings_ms", "plugins"] {
            result.as_object_mut().unwrap().remove(key).unwrap();
        }
        result
    };
    let wanted = comparable(&String::from_utf8(sound.stdout).unwrap());
    for (plugin, place, fault) in [
        ("harmonic", "run", "print"),
        ("faro-file", "run", "print"),
        ("faro-file", "create", "print"),
        ("harmonic", "run", "ignore_term"),
        ("faro-file", "run", "ignore_term"),
        ("faro-file", "run", "fork_away"),
        ("faro-file", "run", "shrink_pool"),
        ("faro-file", "close_", "hang"),
        ("harmonic", "close_", "segv"),
    ] {
        let measured = bench.with_fault(plugin, place, fault);
        assert_eq!(measured.code, Some(0), "{plugin} {place} {fault}: {}", measured.error);
        assert!(comparable(&measured.out) == wanted, "{plugin} {place} {fault}: {}", measured.error);
    }
}

#[test]
fn results_are_equal_in_both_isolations() {
    let bench = Bench::new();
    let none = bench.file("none");
    let result = |more: &[&str]| {
        let output = bench.measure(&none, more);
        let mut result: Json = serde_json::from_slice(&output.stdout).unwrap();
        result.as_object_mut().unwrap().remove("timings_ms").unwrap();
        let isolated = |plugin: &mut Json| plugin.as_object_mut().unwrap().remove("isolated").unwrap();
        let isolated: Vec<Json> =
            result["plugins"].as_array_mut().unwrap().iter_mut().map(isolated).collect();
        (result, isolated)
    };
    let (here, there) = (result(&["--in-process"]), result(&[]));
    assert!(here.0 == there.0);
    assert!(
        here.1.iter().all(|isolated| isolated == false) && there.1.iter().all(|isolated| isolated == true)
    );
}

#[test]
fn a_library_that_ends_or_hangs_when_it_is_loaded_is_listed_as_refused() {
    let folder = tempfile::tempdir().unwrap();
    let list = |fault: &str| {
        let plugins = folder.path().join(fault);
        faulty(&plugins, "harmonic", "constructor", fault, 0);
        let output =
            platen_tests::program("platen").arg("--plugins").arg(&plugins).args(["plugins", "list"]).output();
        let text = String::from_utf8(output.unwrap().stdout).unwrap();
        assert!(left_behind(&plugins).is_empty(), "{fault}");
        text
    };
    for (fault, how) in
        [("give_up", "SIGABRT"), ("leave", "exit code 0"), ("segv", "SIGSEGV"), ("hang", "within 5 s")]
    {
        let text = list(fault);
        let line = text
            .lines()
            .find(|line| line.contains("libharmonic"))
            .unwrap_or_else(|| panic!("{fault}: {text}"));
        assert!(line.contains("refused") && line.contains(how), "{fault}: {text}");
        assert!(text.contains("template") && text.contains("faro-stream"), "{fault}: {text}");
    }
}

#[test]
fn a_plugin_that_writes_its_input_is_ended() {
    let bench = Bench::new();
    let plugins = bench.file("write-input");
    std::fs::create_dir_all(&plugins).unwrap();
    let target = platen_tests::library("harmonic");
    let define = format!("-DTARGET=\"{}\"", target.display());
    platen_tests::compile_c(
        &platen_tests::c_source("faulty.c"),
        &plugins.join(target.file_name().unwrap()),
        &["-shared", "-fPIC", "-w", &define, "-DWHERE=run", "-DFAULT=none", "-DWRITE_INPUT"],
    );
    let output = bench.measure(&plugins, &[]);
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(1) && error.contains("SIGSEGV"), "{error}");
}

/// Invalid values of a plugin: library, fault, and a part of the error that refuses it.
const WRONG_WORDS: [(&str, &str, &str); 16] = [
    ("faro-file", "face_9", ", must be 0 or 1"),
    ("faro-file", "state_9", "state 9 in column"),
    ("faro-file", "azimuth_100", "azimuth 100 rad"),
    ("faro-file", "range_nan", "NaN"),
    ("faro-file", "same_index", "column 5 twice"),
    ("faro-file", "intensity_beyond", "at most 1 by its header"),
    ("faro-file", "intensity_turned", "intensities from 65535 to"),
    ("faro-file", "rows_4e9", "a lattice of 4000000000 x"),
    ("faro-file", "end_of_7_columns", "of which its end says 7 and"),
    ("faro-file", "end_of_7_points", "and 7"),
    ("faro-file", "outcome_9", "outcome 9"),
    ("faro-file", "span_beyond", "a malformed platen.column/2"),
    ("harmonic", "chart_moved", "it strains the plate by"),
    ("harmonic", "chart_wide", "mm off, "),
    ("elastic", "sigma_nan", "vertex 9 has a standard deviation that is negative or no number"),
    ("elastic", "sigma_minus", "vertex 9 has a standard deviation that is negative or no number"),
];

#[test]
fn a_wrong_word_is_refused_with_a_sentence() {
    let bench = Bench::new();
    let plant = std::fs::read_to_string(bench.file("plant.toml")).unwrap();
    for (plugin, spoil, sentence) in WRONG_WORDS {
        let flattening = if plugin == "elastic" { plugin } else { "harmonic" };
        std::fs::write(bench.file("plant.toml"), plant.replace("harmonic", flattening)).unwrap();
        let measured = bench.with_fault(plugin, "word", spoil);
        assert_eq!(measured.code, Some(1), "{plugin} {spoil}: {}", measured.error);
        assert!(measured.error.contains(sentence), "{plugin} {spoil}: {}", measured.error);
    }
}

#[test]
fn a_wrong_finding_fails_its_comparison_alone() {
    let bench = Bench::new();
    for (spoil, sentence) in [
        ("figure_null", "a number that is none"),
        ("figure_twice", "two figures named a"),
        ("figure_nameless", "a figure named \"\""),
        ("figure_unsure", "figure a with the uncertainty -1"),
    ] {
        let measured = bench.with_fault("curvature", "word", spoil);
        let result: Json = serde_json::from_str(&measured.out).unwrap();
        let failed = result["comparisons"][1]["error"].as_str().unwrap_or_default();
        assert!(failed.contains(sentence), "{spoil}: {result:#}");
        assert!(result["comparisons"][0]["error"].is_null(), "{spoil}");
    }
    let measured = bench.with_fault("curvature", "word", "figure_furlong");
    let result: Json = serde_json::from_str(&measured.out).unwrap();
    let figure = &result["comparisons"][1]["figures"][0];
    assert_eq!((figure["value"].as_f64(), figure["unit"].as_str()), (Some(1.5), Some("furlong")), "{figure}");
    let measured = bench.with_fault("curvature", "word", "says_escape");
    let result: Json = serde_json::from_str(&measured.out).unwrap();
    assert!(result["says"].to_string().contains("\u{fffd}[31mred\u{fffd}"), "{}", result["says"]);
}
