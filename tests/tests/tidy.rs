//! Repository rules: the direction of dependencies, manifests, links of pages, heads of modules.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Returns the workspace crates that each kind of crate may use in its library or program (not in its tests).
fn allowed(name: &str, folder: &str) -> Option<&'static [&'static str]> {
    Some(match (folder, name) {
        (_, "platen-abi" | "platen-model" | "platen-numerics" | "platen-scan" | "platen-sim-plate") => &[],
        (_, "platen-formats") => &["platen-scan"],
        (_, "platen-plant" | "platen-history") => &["platen-model"],
        (_, "platen-shape") => &["platen-model", "platen-numerics", "platen-scan"],
        (_, "platen-tank") => &["platen-model", "platen-plant"],
        (_, "platen-advice") => &["platen-model", "platen-shape"],
        (_, "platen-sdk") => &["platen-abi", "platen-model", "platen-scan", "platen-shape"],
        (_, "platen-press") => &["platen-model", "platen-plant"],
        (_, "platen-engine") => &[
            "platen-abi",
            "platen-model",
            // Two plugins start at a time.
            "platen-numerics",
            "platen-plant",
            "platen-scan",
            "platen-sdk",
            "platen-shape",
        ],
        (_, "platen-conformance") => {
            &["platen-engine", "platen-model", "platen-plant", "platen-scan", "platen-shape"]
        }
        // Documents and pictures: no press, no plugin.
        (_, "platen-report") => {
            &["platen-history", "platen-model", "platen-plant", "platen-scan", "platen-sdk", "platen-shape"]
        }
        // Pages: no press, no plugin, no database; the host is their source.
        (_, "platen-screen") => &["platen-model", "platen-report"],
        // Documents and names: no press, no plugin, no geometry.
        (_, "platen-forward") => &["platen-history", "platen-model", "platen-plant"],
        (_, "platen") => &[
            "platen-abi",
            "platen-advice",
            "platen-conformance",
            "platen-engine",
            "platen-formats",
            "platen-forward",
            "platen-history",
            "platen-model",
            "platen-plant",
            "platen-press",
            "platen-report",
            "platen-scan",
            "platen-screen",
            "platen-shape",
            "platen-tank",
        ],
        (_, "platen-bench") => &[
            "platen",
            "platen-advice",
            "platen-engine",
            "platen-model",
            "platen-numerics",
            "platen-plant",
            "platen-press",
            "platen-report",
            "platen-scan",
            "platen-shape",
            // Steel model for the study of the advice.
            "platen-sim-plate",
        ],
        (_, "simulated") => &["platen-sdk", "platen-scan", "platen-sim-plate", "platen-sim-scanner"],
        ("drivers", _) => &["platen-sdk", "platen-scan", "platen-formats"],
        ("plugins", _) => &["platen-advice", "platen-model", "platen-numerics", "platen-sdk", "platen-shape"],
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

/// Returns the name of the folder that contains the crate's folder, or `tests`.
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
        assert!(package["description"].is_string(), "{}: description", package["name"]);
        assert!(package["readme"].is_string(), "{}: readme", package["name"]);
    }
}

/// Returns the files of the repository with this ending, without those that git ignores.
fn files(ending: &str) -> Vec<PathBuf> {
    let root = platen_tests::repository();
    let (mut found, mut folders) = (Vec::new(), vec![root.clone()]);
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap().flatten() {
            let (path, name) = (entry.path(), entry.file_name().to_string_lossy().into_owned());
            if !path.is_dir() {
                found.extend(name.ends_with(ending).then_some(path));
            } else if !name.starts_with('.') && !["target", "corpus", "artifacts"].contains(&&*name) {
                // Folders of results beside the sources, for example of `platen demo`.
                folders.extend((!path.join("history.sqlite").exists()).then_some(path));
            }
        }
    }
    found.sort();
    found
}

/// Returns the text of a page outside its blocks of code.
fn prose(page: &Path) -> String {
    let text = std::fs::read_to_string(page).unwrap();
    text.split("```").step_by(2).collect()
}

/// Returns the anchors of a page's headings as GitHub makes them: lower case, spaces as `-`, no punctuation; a repeated
/// one is numbered.
fn anchors(page: &Path) -> BTreeSet<String> {
    let mut seen: BTreeMap<String, usize> = BTreeMap::new();
    let text = prose(page);
    let headings = text.lines().filter(|line| line.starts_with('#'));
    let anchor = |line: &str| {
        let title = line.trim_start_matches('#').trim().to_lowercase();
        let kept = title.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
        let anchor: String = kept.map(|c| if c == ' ' { '-' } else { c }).collect();
        let n = seen.entry(anchor.clone()).or_default();
        *n += 1;
        if *n > 1 { format!("{anchor}-{}", *n - 1) } else { anchor }
    };
    headings.map(anchor).collect()
}

#[test]
fn every_link_in_every_page_resolves() {
    let mut broken = Vec::new();
    let mut n_links = 0;
    for page in files(".md") {
        let text = prose(&page);
        let ends = text.match_indices("](").map(|(at, _)| &text[at + 2..]);
        for link in ends.filter_map(|rest| rest.split_once(')')).map(|(link, _)| link) {
            if link.contains("://") || link.starts_with("mailto:") {
                continue;
            }
            n_links += 1;
            let (file, anchor) = link.split_once('#').map_or((link, None), |(file, a)| (file, Some(a)));
            let target = if file.is_empty() { page.clone() } else { page.with_file_name(file) };
            let target = if anchor.is_some() && target.is_dir() { target.join("README.md") } else { target };
            let resolves = target.exists() && anchor.is_none_or(|a| anchors(&target).contains(a));
            if !resolves {
                broken.push(format!("{}: {link}", page.display()));
            }
        }
    }
    assert!(broken.is_empty(), "{broken:#?}");
    assert!(n_links > 20, "only {n_links} links found");
}

#[test]
fn the_front_page_is_short_and_every_folder_has_its_page() {
    let root = platen_tests::repository();
    let lines = std::fs::read_to_string(root.join("README.md")).unwrap().lines().count();
    assert!(
        lines <= 130,
        "README.md has {lines} lines; the front page has at most 130, the rest is in the folders"
    );
    for folder in ["config", "core", "drivers", "plugins", "sim", "tests"] {
        assert!(root.join(folder).join("README.md").exists(), "{folder} has no README.md");
    }
    for file in ["CHANGELOG.md", "LICENSE-APACHE", "LICENSE-MIT"] {
        assert!(root.join(file).exists(), "{file} is missing");
    }
}

#[test]
fn module_heads_begin_with_the_subject() {
    let mut faults = Vec::new();
    for file in files(".rs") {
        let text = std::fs::read_to_string(&file).unwrap();
        let first = text.lines().find_map(|line| line.strip_prefix("//! ")).unwrap_or_default();
        let word = first.split([' ', ',']).next().unwrap_or_default();
        if ["What", "Who", "Those", "Something"].contains(&word) {
            faults.push(format!("{}: {first}", file.display()));
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

#[test]
fn transitions_of_the_handshake_have_names() {
    let numbered = |word: &str| {
        let digits = word.strip_prefix('T').unwrap_or_default();
        (1..=2).contains(&digits.len()) && digits.bytes().all(|b| b.is_ascii_digit())
    };
    for file in [files(".rs"), files(".md")].concat() {
        if file.strip_prefix(platen_tests::repository()).unwrap().starts_with("core/press") {
            let text = std::fs::read_to_string(&file).unwrap();
            let words = text.split(|c: char| !c.is_alphanumeric() && c != '_');
            let found: Vec<&str> = words.filter(|word| numbered(word)).collect();
            assert!(found.is_empty(), "{}: {found:?}", file.display());
        }
    }
}

#[test]
fn the_changelog_has_an_entry_for_the_version() {
    let changelog = std::fs::read_to_string(platen_tests::repository().join("CHANGELOG.md")).unwrap();
    let mut entries = changelog.lines().filter_map(|line| line.strip_prefix("## "));
    let newest = entries.find(|entry| *entry != "[Unreleased]").unwrap();
    let version = env!("CARGO_PKG_VERSION");
    assert!(
        newest.starts_with(&format!("{version} - ")),
        "CHANGELOG.md begins with {newest}, not with {version}"
    );
}
