//! Tests of records of every released format: they open, are extended and give the same strokes.
//!
//! A migration that is killed leaves the old format or the new one.

use std::path::{Path, PathBuf};
use std::process::Command;

use jiff::Timestamp;
use platen_history::{Archive, Filter, History};

/// Press of the records.
const PRESS: u16 = 3;
/// Environment variable with the record, for the child that extends it.
const CHILD: &str = "PLATEN_MIGRATED_RECORD";
/// Points at which a migration is killed.
const POINTS: u32 = 50;

fn records() -> Vec<PathBuf> {
    let folder = platen_tests::repository().join("core/history/tests/records");
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.extension().is_some_and(|end| end == "sqlite"));
    files.sort();
    files
}

/// Returns the strokes and plates of a record, as text.
fn listed(path: &Path) -> String {
    let archive = Archive::open(path).unwrap();
    format!("{:#?}\n{:#?}", archive.strokes(&Filter::default()).unwrap(), archive.plates().unwrap())
}

/// Returns the output of `platen history list` for a record.
fn list_verb(folder: &Path, record: &Path) -> String {
    let plant = folder.join("plant.toml");
    std::fs::write(&plant, format!("[output]\nhistory = {record:?}\n")).unwrap();
    let output = platen_tests::program("platen").args(["history", "list"]).arg(&plant).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn records_of_every_released_format_open_migrate_and_list_the_same() {
    let records = records();
    assert!(records.len() >= 2, "{records:?}");
    for old in records {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("history.sqlite");
        std::fs::copy(&old, &path).unwrap();
        let (before, text) = (listed(&path), list_verb(folder.path(), &path));
        assert!(text.lines().count() > 1, "{}: {text}", old.display());
        // The text of the release that wrote the record.
        let expected = std::fs::read_to_string(old.with_extension("txt")).unwrap();
        assert_eq!(text, expected, "{}", old.display());
        drop(History::open(&path, PRESS, Timestamp::UNIX_EPOCH).unwrap());
        assert_eq!(listed(&path), before, "{}", old.display());
        assert_eq!(list_verb(folder.path(), &path), text, "{}", old.display());
        assert!(Archive::open(&path).unwrap().damage().unwrap().is_none());
    }
}

/// Extends a record if it was started by the test below; otherwise does nothing.
#[test]
fn the_host_that_is_killed_while_it_migrates() {
    if let Some(path) = std::env::var_os(CHILD) {
        History::open(Path::new(&path), PRESS, Timestamp::UNIX_EPOCH).unwrap();
    }
}

#[test]
fn a_killed_migration_leaves_the_old_format_or_the_new_one() {
    let folder = tempfile::tempdir().unwrap();
    let library = folder.path().join("libdies_at_call.so");
    let arguments = ["-shared", "-fPIC"];
    platen_tests::compile_c(&platen_tests::c_source("dies_at_call.c"), &library, &arguments);
    let oldest = records().remove(0);
    let migrate = |path: &Path, die_at: u32| {
        let count = folder.path().join("count");
        let _ = std::fs::remove_file(&count);
        let status = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "records::the_host_that_is_killed_while_it_migrates", "--quiet"])
            .env(CHILD, path)
            .env("LD_PRELOAD", &library)
            .env("DIE_AT", die_at.to_string())
            .env("DIE_COUNT", &count)
            .output()
            .unwrap()
            .status;
        (status.success(), std::fs::read_to_string(count).unwrap_or_default().parse::<u32>().unwrap_or(0))
    };
    let fresh = |name: &str| {
        let path = folder.path().join(name).join("history.sqlite");
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::copy(&oldest, &path).unwrap();
        path
    };
    let whole = fresh("whole");
    let before = listed(&whole);
    let (ended, calls) = migrate(&whole, 0);
    assert!(ended && calls >= POINTS, "{calls} calls");
    let changes = |path: &Path| Archive::open(path).unwrap().changes(0, 10_000).unwrap();
    let all = changes(&whole);
    assert!(!all.is_empty());

    let (mut old, mut new) = (0, 0);
    for point in 0..POINTS {
        let at = 1 + point * (calls - 1) / (POINTS - 1);
        let path = fresh(&format!("killed-{point}"));
        assert!(!migrate(&path, at).0, "killed at call {at} of {calls}");
        // Opened for reading first, as a backup or a forwarder would.
        assert_eq!(listed(&path), before, "killed at call {at} of {calls}");
        let found = changes(&path);
        assert!(found.is_empty() || found == all, "killed at call {at} of {calls}: {found:?}");
        if found.is_empty() {
            old += 1
        } else {
            new += 1
        }
        assert!(migrate(&path, 0).0, "the next start after call {at}");
        assert_eq!((listed(&path), changes(&path)), (before.clone(), all.clone()), "killed at call {at}");
        assert!(Archive::open(&path).unwrap().damage().unwrap().is_none());
    }
    println!(
        "{calls} calls; killed at {POINTS} of them: {old} records of the old format, {new} of the new one"
    );
    assert!(old > 0 && new > 0, "{old} old, {new} new");
}
