//! Raw scans kept by the host: measured again they give the same result, and they are removed when they are old.

use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use crate::cell::{Host, Press, plant};
use serde_json::Value as Json;

fn runs(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder.join("results")).unwrap().flatten().map(|entry| entry.path());
    let mut runs: Vec<PathBuf> = entries.filter(|path| path.is_dir()).collect();
    runs.sort();
    runs
}

fn load(path: &Path) -> Json {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

fn measured(scan: &Path, plant: &Path, more: &[(&str, &Path)]) -> Json {
    let plate = platen_tests::repository().join("config/plates/plate-009.toml");
    let mut command = platen_tests::program("platen");
    command.arg("measure").arg(scan).arg("--plate").arg(plate).arg("--plant").arg(plant).arg("--json");
    more.iter().for_each(|(flag, path)| {
        command.arg(flag).arg(path);
    });
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Removes the parts that differ between runs: times, and the stroke's number.
fn comparable(mut result: Json) -> Json {
    let object = result.as_object_mut().unwrap();
    object.remove("timings_ms").unwrap();
    object.remove("clock").unwrap();
    object.remove("stroke").unwrap();
    // One of the two was read from a file and therefore has no scanner plugin.
    object["plugins"].as_array_mut().unwrap().retain(|plugin| plugin["kind"] != "scanner");
    let notes = object["scan"]["notes"].as_array_mut().unwrap();
    notes.retain(|note| !note.as_str().unwrap().starts_with("read from "));
    result
}

#[test]
fn a_kept_scan_measured_again_gives_the_same_result() {
    let folder = tempfile::tempdir().unwrap();
    let mut press = Press::start(folder.path(), "strokes = 2");
    let plant =
        plant(folder.path(), &press.modbus, &format!("cell = \"{}\"\nwarm_up_columns = 10", press.plate));
    let mut host = Host::start(&plant);
    press.wait_done();
    assert_eq!(host.stop(), Some(0), "{}", host.log());
    let runs = runs(folder.path());
    assert_eq!(runs.len(), 3, "the blank and two strokes");
    let scan = |k: usize| runs[k].join("scan.e57");
    let (blank, first) = (scan(0), scan(1));
    for (k, more) in [
        (0, vec![("--baseline", blank.as_path())]),
        (1, vec![("--before", blank.as_path()), ("--baseline", &blank)]),
        (2, vec![("--before", first.as_path()), ("--baseline", &blank)]),
    ] {
        let then = comparable(load(&runs[k].join("result.json")));
        let now = comparable(measured(&scan(k), &plant, &more));
        for (name, value) in then.as_object().unwrap() {
            assert_eq!(value, &now[name], "run {k}: {name}");
        }
    }

    // The next host removes scans that are too old, and no other file.
    let old = SystemTime::now() - Duration::from_secs(61 * 86_400);
    for path in [&first, &runs[1].join("result.json")] {
        std::fs::File::options().write(true).open(path).unwrap().set_modified(old).unwrap();
    }
    let text = std::fs::read_to_string(&plant).unwrap();
    std::fs::write(&plant, format!("{text}keep_scans = \"60 d\"\n")).unwrap();
    let mut host = Host::start(&plant);
    crate::cell::until("the old scan to go", || (!first.exists()).then_some(()));
    assert_eq!(host.stop(), Some(0), "{}", host.log());
    assert!(blank.exists() && scan(2).exists() && runs[1].join("result.json").exists());
}

/// Bytes of a file on a full disk: enough for results and history, too little for a scan.
const NO_ROOM_FOR_A_SCAN: u32 = 5 << 20;

#[test]
fn a_scan_that_finds_no_room_costs_no_result() {
    let folder = tempfile::tempdir().unwrap();
    let mut press = Press::start(folder.path(), "strokes = 1");
    let plant = plant(folder.path(), &press.modbus, &format!("cell = \"{}\"", press.plate));
    let text = std::fs::read_to_string(&plant).unwrap();
    std::fs::write(&plant, text.replace("step_deg = 0.1", "step_deg = 0.06")).unwrap();
    let mut host = Host::on_full_disk(&plant, NO_ROOM_FOR_A_SCAN);
    let stats = press.wait_done();
    assert_eq!(host.stop(), Some(0), "{}", host.log());
    let log = host.log();
    crate::cell::assert_clean(&stats, &log);
    let taken = stats["taken"].as_array().unwrap();
    // Register 55 is gap.max, 0xFFFF where nothing was measured.
    assert!(taken.len() == 2 && taken.iter().all(|result| result["words"][55] != 0xFFFF), "{stats:#}\n{log}");
    assert_eq!(log.matches("the scan is not kept: ").count(), 2, "{log}");
    for run in runs(folder.path()) {
        let names = std::fs::read_dir(&run).unwrap().map(|entry| entry.unwrap().file_name());
        let names: Vec<String> = names.map(|name| name.into_string().unwrap()).collect();
        assert!(names.iter().any(|name| name == "result.json"), "{names:?}\n{log}");
        assert!(!names.iter().any(|name| name.contains("scan.e57")), "{names:?}\n{log}");
    }
}

#[test]
fn nothing_is_kept_when_the_plant_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let mut press = Press::start(folder.path(), "strokes = 1");
    let plant = plant(folder.path(), &press.modbus, &format!("cell = \"{}\"", press.plate));
    let text = std::fs::read_to_string(&plant).unwrap();
    std::fs::write(&plant, format!("{text}keep_scans = 0\n")).unwrap();
    let mut host = Host::start(&plant);
    press.wait_done();
    assert_eq!(host.stop(), Some(0), "{}", host.log());
    assert!(
        runs(folder.path())
            .iter()
            .all(|run| run.join("result.json").exists() && !run.join("scan.e57").exists())
    );
}

/// Files of the store.
fn stored(store: &Path) -> Vec<PathBuf> {
    let folders = std::fs::read_dir(store.join("scans")).into_iter().flatten().flatten().map(|it| it.path());
    let mut files: Vec<PathBuf> = folders
        .filter(|path| path.is_dir())
        .flat_map(|path| std::fs::read_dir(path).unwrap().map(|file| file.unwrap().path()))
        .collect();
    files.sort();
    files
}

#[test]
fn scans_are_stored_by_rule_and_measured_again_from_the_store() {
    let folder = tempfile::tempdir().unwrap();
    let store = folder.path().join("store");
    let mut press = Press::start(folder.path(), "strokes = 2");
    let plant = plant(folder.path(), &press.modbus, &format!("cell = \"{}\"", press.plate));
    let text = std::fs::read_to_string(&plant).unwrap();
    let with = |rule: &str| {
        std::fs::write(&plant, format!("{text}[scan_store]\nfolder = \"store\"\n{rule}\n")).unwrap();
    };
    // An unreachable store has no other effect.
    std::fs::write(&store, "no folder").unwrap();
    with("which = [\"baseline\"]");
    let mut host = Host::start(&plant);
    let stats = press.wait_done();
    crate::cell::until("the failure of the store", || {
        host.log().contains("the scan is not stored").then_some(())
    });
    std::fs::remove_file(&store).unwrap();
    assert_eq!(host.stop(), Some(0), "{}", host.log());
    crate::cell::assert_clean(&stats, &host.log());

    // The next start copies the missing scans.
    let mut host = Host::start(&plant);
    crate::cell::until("the baseline in the store", || (stored(&store).len() == 1).then_some(()));
    let record = crate::cell::until("the record of it", || {
        Some(Host::history(&plant)).filter(|record| record[0]["scan"].is_string())
    });
    assert_eq!(host.stop(), Some(0), "{}", host.log());
    for (run, stroke) in runs(folder.path()).iter().zip(&record) {
        assert_eq!(stroke["scan_sha256"].as_str().unwrap().len(), 64, "every kept scan has its digest");
        assert_eq!(stroke["scan"].is_string(), stroke["baseline"] == true);
        assert!(run.join("scan.e57").exists());
    }
    let first = &stored(&store)[0];
    assert_eq!(record[0]["scan"], first.to_str().unwrap());
    assert!(first.ends_with(format!("{}.e57", record[0]["scan_sha256"].as_str().unwrap())));
    assert_eq!(
        std::fs::read(first).unwrap(),
        std::fs::read(runs(folder.path())[0].join("scan.e57")).unwrap()
    );

    // All other scans, selected by the share; then the kept ones may be removed.
    with("which = []\nshare = 1.0");
    let mut host = Host::start(&plant);
    crate::cell::until("all scans in the store", || (stored(&store).len() == 3).then_some(()));
    crate::cell::until("the record of them", || {
        Host::history(&plant).iter().all(|stroke| stroke["scan"].is_string()).then_some(())
    });
    assert_eq!(host.stop(), Some(0), "{}", host.log());
    runs(folder.path()).iter().for_each(|run| std::fs::remove_file(run.join("scan.e57")).unwrap());
    let again = folder.path().join("again");
    let mut command = platen_tests::program("platen");
    let output = command
        .arg("remeasure")
        .arg(&plant)
        .arg("--out")
        .arg(&again)
        .args(["--compare", "--json"])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let done: Json = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&done["measured"], &done["verdict_changed"]), (&Json::from(3), &serde_json::json!([])));
    for run in runs(folder.path()) {
        let name = run.file_name().unwrap();
        let then = comparable(load(&run.join("result.json")));
        let now = comparable(load(&again.join(name).join("result.json")));
        assert_eq!(then, now, "{}", run.display());
    }
}
