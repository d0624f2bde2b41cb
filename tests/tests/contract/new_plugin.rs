//! Tests of `platen plugins new`: each kind in each language builds without changes, passes `platen plugins check`, and
//! measures a plate.
//!
//! `PLATEN_RUST=all` builds all three kinds in Rust (half a minute for a comparison's libraries), otherwise only the
//! scanner.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value as Json;

use crate::misbehaviour::Bench;

/// Creates and builds a plugin; returns its library.
fn made(folder: &Path, kind: &str, language: &str) -> PathBuf {
    let name = format!("my-{kind}-{language}");
    let place = folder.join(&name);
    let mut new = platen_tests::program("platen");
    new.args(["plugins", "new", &name, "--kind", kind, "--lang", language]).arg(&place);
    if language == "rust" {
        // The target folder may lie outside the sources.
        new.arg("--platen").arg(Path::new(env!("CARGO_MANIFEST_DIR")).join(".."));
    }
    let output = new.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let file = format!("lib{}.so", name.replace('-', "_"));
    let (mut build, library) = if language == "rust" {
        let built = platen_tests::built();
        let target = built.join("new-plugins");
        let mut cargo = platen_tests::cargo();
        cargo.args(["build", "--release", "--quiet"]).env("CARGO_TARGET_DIR", &target);
        // Libraries that the workspace has with the same features are not built again.
        cargo.env("CARGO_BUILD_BUILD_DIR", built.parent().unwrap());
        if kind != "scanner" {
            // Most of the others' libraries are built, and used for seconds.
            cargo.env("CARGO_PROFILE_RELEASE_OPT_LEVEL", "1");
        }
        (cargo, target.join("release").join(&file))
    } else {
        (Command::new("make"), place.join(&file))
    };
    let output = build.current_dir(&place).output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && !text.contains("warning"), "{name}: {text}");
    library
}

fn checked(library: &Path) {
    let output = platen_tests::program("platen").args(["plugins", "check"]).arg(library).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(
        output.status.success() && text.contains(" 0 failed, 0 warnings"),
        "{}: {text}",
        library.display()
    );
}

fn languages(kind: &str) -> &'static [&'static str] {
    let all = std::env::var("PLATEN_RUST").is_ok_and(|which| which == "all");
    if all || kind == "scanner" { &["c", "cpp", "rust"] } else { &["c", "cpp"] }
}

/// Measures the cylinder of `bench` with a plant that uses the plugin.
fn measured(bench: &Bench, library: &Path, plant: &str) -> Json {
    std::fs::write(bench.file("plant.toml"), format!("[plant]\nname = \"test\"\n{plant}")).unwrap();
    let output = bench.measure(library.parent().unwrap(), &[]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn comparisons_give_one_figure_in_each_language() {
    let bench = Bench::rolled(0.0);
    let folder = tempfile::tempdir().unwrap();
    for language in languages("comparison") {
        let library = made(folder.path(), "comparison", language);
        checked(&library);
        let plant = format!("[[comparison]]\nplugin = \"my-comparison-{language}\"\n");
        let result = measured(&bench, &library, &plant);
        let curvature = result["comparisons"][0]["figures"][0]["value_per_m"].as_f64().unwrap();
        let nodes = result["grid"]["kappa_u_per_m"].as_array().unwrap().iter().filter_map(Json::as_f64);
        let nodes: Vec<f64> = nodes.collect();
        let mean = nodes.iter().sum::<f64>() / nodes.len() as f64;
        // Found: 0.016 %, of 101 x 101 nodes against 21 x 21.
        assert!((curvature / mean - 1.0).abs() < 3.3e-4, "{language}: {curvature} {mean}");
        println!("{language}: {curvature}, the host's grid {mean}");
    }
}

#[test]
fn flattenings_give_the_chart_of_our_own_in_each_language() {
    let bench = Bench::new();
    let folder = tempfile::tempdir().unwrap();
    let ours = measured(&bench, &platen_tests::library("harmonic"), "[flattening]\nplugin = \"harmonic\"\n");
    for language in languages("flattening") {
        let library = made(folder.path(), "flattening", language);
        checked(&library);
        let plant = format!("[flattening]\nplugin = \"my-flattening-{language}\"\n");
        let theirs = measured(&bench, &library, &plant);
        let corners = |result: &Json| -> Vec<f64> {
            let corners = result["corners_m"].as_array().unwrap().iter();
            corners
                .flat_map(|corner| corner.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()))
                .collect()
        };
        let off = corners(&ours).iter().zip(corners(&theirs)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        println!("{language}: {off:e} m");
        assert!(off < 1e-9, "{language}: {off} m");
    }
}

#[test]
fn scanners_scan_in_each_language() {
    let folder = tempfile::tempdir().unwrap();
    for language in languages("scanner") {
        let library = made(folder.path(), "scanner", language);
        checked(&library);
        let plant = folder.path().join("plant.toml");
        let text = format!("[plant]\nname = \"test\"\n[scanner]\nplugin = \"my-scanner-{language}\"\n");
        std::fs::write(&plant, text).unwrap();
        let scan = folder.path().join(format!("{language}.e57"));
        let mut platen = platen_tests::program("platen");
        platen.arg("--plugins").arg(library.parent().unwrap()).arg("scan").arg(&plant).arg(&scan);
        let output = platen.output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let inspected =
            platen_tests::program("platen").arg("inspect").arg(&scan).arg("--json").output().unwrap();
        let facts: Json = serde_json::from_slice(&inspected.stdout).unwrap();
        assert_eq!((facts["rows"].as_u64(), facts["columns"].as_u64()), (Some(60), Some(80)), "{facts:#}");
    }
}

#[test]
fn the_lines_of_its_readme_run() {
    let folder = tempfile::tempdir().unwrap();
    let path = std::env::var("PATH").unwrap_or_default();
    for kind in ["comparison", "flattening", "scanner"] {
        made(folder.path(), kind, "c");
        let place = folder.path().join(format!("my-{kind}-c"));
        let readme = std::fs::read_to_string(place.join("README.md")).unwrap();
        let lines = readme.split("```").nth(1).and_then(|block| block.strip_prefix("sh\n")).unwrap();
        let mut shell = Command::new("sh");
        shell.args(["-ec", lines]).current_dir(&place);
        shell.env("PATH", format!("{}:{path}", platen_tests::built().display()));
        let output = shell.output().unwrap();
        assert!(output.status.success(), "{kind}: {}", String::from_utf8_lossy(&output.stderr));
        println!("{kind}: {} lines", lines.lines().count());
    }
}

#[test]
fn a_name_or_folder_that_will_not_do_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |name: &str, place: &Path, sentence: &str| {
        let mut new = platen_tests::program("platen");
        let output = new.args(["plugins", "new", name, "--kind", "scanner"]).arg(place).output().unwrap();
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && text.contains(sentence), "{text}");
    };
    refused("My Plugin", &folder.path().join("new"), "lower case letters, digits and hyphens");
    refused("my-plugin", folder.path(), "exists already");
    refused("faro-stream", &folder.path().join("new"), "the name of a plugin that is here already");
}
