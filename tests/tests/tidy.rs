//! What may know what: the dependency direction, read from `cargo metadata`.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

/// Workspace crates that each kind of crate may use in its library or program (not in its tests).
fn allowed(name: &str, folder: &str) -> Option<&'static [&'static str]> {
    Some(match (folder, name) {
        (_, "platen-abi" | "platen-model" | "platen-numerics" | "platen-scan" | "platen-sim-plate") => &[],
        (_, "platen-formats") => &["platen-scan"],
        (_, "platen-plant" | "platen-history") => &["platen-model"],
        (_, "platen-shape") => &["platen-model", "platen-numerics", "platen-scan"],
        (_, "platen-sdk") => &["platen-abi", "platen-model", "platen-scan", "platen-shape"],
        (_, "platen-press") => &["platen-model", "platen-plant"],
        (_, "platen-engine") => &[
            "platen-abi",
            "platen-formats",
            "platen-model",
            "platen-plant",
            "platen-scan",
            "platen-sdk",
            "platen-shape",
        ],
        // Documents and pictures: no press, no plugin.
        (_, "platen-report") => {
            &["platen-history", "platen-model", "platen-plant", "platen-scan", "platen-sdk", "platen-shape"]
        }
        (_, "platen") => &[
            "platen-abi",
            "platen-engine",
            "platen-formats",
            "platen-history",
            "platen-model",
            "platen-plant",
            "platen-press",
            "platen-report",
            "platen-scan",
            "platen-shape",
        ],
        (_, "platen-bench") => &[
            "platen",
            "platen-engine",
            "platen-model",
            "platen-plant",
            "platen-press",
            "platen-scan",
            "platen-shape",
        ],
        (_, "simulated") => &["platen-sdk", "platen-scan", "platen-sim-plate", "platen-sim-scanner"],
        ("drivers", _) => &["platen-sdk", "platen-scan", "platen-formats"],
        ("plugins", _) => &["platen-model", "platen-numerics", "platen-sdk", "platen-shape"],
        (_, "platen-sim-scanner" | "platen-sim-press") => &["platen-sim-plate"],
        (_, "platen-sim") => &["platen-sim-plate", "platen-sim-scanner", "platen-sim-press"],
        ("tests", _) => return None,
        _ => panic!("{folder}/{name} has no rule: say here what it may use"),
    })
}

fn metadata() -> serde_json::Value {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps"])
        .current_dir(platen_tests::repository())
        .output()
        .unwrap();
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Name of the folder that holds the crate's folder, or `tests`.
fn folder(package: &serde_json::Value) -> String {
    let manifest = std::path::Path::new(package["manifest_path"].as_str().unwrap());
    let place = manifest.strip_prefix(platen_tests::repository()).unwrap();
    place.iter().next().unwrap().to_string_lossy().into_owned()
}

#[test]
fn dependencies_point_one_way() {
    let metadata = metadata();
    let packages = metadata["packages"].as_array().unwrap();
    let members: BTreeSet<&str> = packages.iter().map(|p| p["name"].as_str().unwrap()).collect();
    let mut faults = Vec::new();
    for package in packages {
        let name = package["name"].as_str().unwrap();
        let Some(allowed) = allowed(name, &folder(package)) else { continue };
        for dependency in package["dependencies"].as_array().unwrap() {
            let used = dependency["name"].as_str().unwrap();
            let in_tests = dependency["kind"] == "dev";
            if members.contains(used) && !in_tests && !allowed.contains(&used) {
                faults.push(format!("{name} must not use {used}"));
            }
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

#[test]
fn plugins_are_bare_libraries_and_nobody_links_them() {
    let metadata = metadata();
    let packages = metadata["packages"].as_array().unwrap();
    let mut kinds: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for package in packages.iter().filter(|p| ["drivers", "plugins"].contains(&folder(p).as_str())) {
        let target = &package["targets"].as_array().unwrap()[0];
        let types = target["crate_types"].as_array().unwrap().iter().map(|t| t.as_str().unwrap()).collect();
        kinds.insert(package["name"].as_str().unwrap(), types);
    }
    assert!(kinds.len() >= 4, "{kinds:?}");
    for (name, types) in &kinds {
        assert_eq!(types, &["cdylib"], "{name}");
    }
    for package in packages {
        for dependency in package["dependencies"].as_array().unwrap() {
            let used = dependency["name"].as_str().unwrap();
            assert!(!kinds.contains_key(used), "{} links the plugin {used}", package["name"]);
        }
    }
}

#[test]
fn every_crate_takes_the_lints_and_the_licence_of_the_workspace() {
    for package in metadata()["packages"].as_array().unwrap() {
        let manifest = std::fs::read_to_string(package["manifest_path"].as_str().unwrap()).unwrap();
        assert!(manifest.contains("[lints]\nworkspace = true"), "{}: lints", package["name"]);
        assert_eq!(package["license"], "MIT OR Apache-2.0", "{}: licence", package["name"]);
    }
}
