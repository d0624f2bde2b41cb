//! Tests of the real `platen run` against the simulated press: every check is made on the press's side or on the
//! record.

use crate::cell::{Host, Press, assert_clean, plant, until};

/// More than the journal of one stroke writes, less than its result files.
const LESS_THAN_A_RESULT: u32 = 200 << 10;

#[test]
fn strokes_are_measured_recorded_and_answered() {
    let folder = tempfile::tempdir().unwrap();
    let mut press = Press::start(folder.path(), "strokes = 2\nparts = 2");
    let plant = plant(folder.path(), &press.modbus, &format!("cell = \"{}\"", press.plate));
    let mut host = Host::start(&plant);
    let stats = press.wait_done();
    assert_clean(&stats, &host.log());
    let taken = stats["taken"].as_array().unwrap();
    assert_eq!(taken.len(), 6, "two plates, of each the blank and two strokes");
    assert_eq!(stats["plates_served"].as_u64().unwrap(), 7, "one look at the start and one scan a stroke");

    let history = Host::history(&plant);
    assert_eq!(history.len(), 6);
    let mut outlines = Vec::new();
    for (record, taken) in history.iter().zip(taken) {
        assert_eq!(record["key"]["stroke"], taken["stroke_id"]);
        assert_eq!(record["ack"], "explicit");
        // run_id is two words, high word first; gap.max is in hundredths of a millimetre.
        let word = |k: usize| taken["words"][k].as_u64().unwrap();
        assert_eq!(word(50) << 16 | word(51), record["run_id"].as_u64().unwrap());
        let gap_mm =
            record["figures"]["gap.max"].as_f64().unwrap_or_else(|| panic!("{record:#}\n{}", host.log()));
        let gap_mm = gap_mm * 1000.0;
        assert!((gap_mm - word(55) as f64 * 0.01).abs() < 0.0051, "{gap_mm} mm, register {}", word(55));
        let document = std::path::Path::new(record["document"].as_str().unwrap());
        let result: serde_json::Value = serde_json::from_slice(&std::fs::read(document).unwrap()).unwrap();
        assert_eq!(result["verdict"], record["verdict"]);
        outlines.push(result["outline"].clone());
    }
    strokes_are_mapped_to_their_blank(&outlines);
    let status = host.status().unwrap();
    assert_eq!(status["status"]["measured"], 6, "{status}");
    assert_eq!(host.stop(), Some(0), "{}", host.log());
    assert_eq!(press.host_status(), 0, "nothing is left valid");
    two_plates_are_compared(&plant);
}

/// Checks that each plate's first scan gives the outline of its blank, and that its strokes keep it.
fn strokes_are_mapped_to_their_blank(outlines: &[serde_json::Value]) {
    for plate in outlines.chunks(3) {
        let blank = &plate[0];
        assert_eq!(blank["from"], "baseline");
        assert!(plate[1] == *blank && plate[2] == *blank, "{plate:#?}");
        for (name, cut) in [("width_mm", 3004.0), ("height_mm", 2497.0), ("diagonal_difference_mm", 5.0)] {
            let found = blank[name].as_f64().unwrap();
            // Cells are 12 mm apart here.
            assert!((found - cut).abs() < 1.5, "{name} {found}, cut {cut}");
        }
    }
    assert_ne!(outlines[0], outlines[3], "two scans of two blanks");
}

/// Compares two strokes of different plates in (u, v).
fn two_plates_are_compared(plant: &std::path::Path) {
    let compare = |first: &str, second: &str| {
        let mut program = platen_tests::program("platen");
        program.args(["history", "compare"]).arg(plant).args([first, second, "--json"]).output().unwrap()
    };
    // The second strokes of two plates that are bent alike, numbered consecutively by the press; and the blank of one
    // against the bent other.
    let moved = |first: &str, second: &str| {
        let output = compare(first, second);
        let said = String::from_utf8_lossy(&output.stderr);
        let found: serde_json::Value =
            serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {said}"));
        let figures = found["comparisons"][0]["figures"].as_array().unwrap();
        let rms = figures.iter().find(|figure| figure["name"] == "displacement.rms");
        rms.and_then(|figure| figure["value_mm"].as_f64()).unwrap_or_else(|| panic!("{found:#}"))
    };
    let (alike, bent) = (moved("1:3", "2:6"), moved("1:blank", "2:6"));
    println!("bent alike {alike:.3} mm rms, bent {bent:.3}");
    assert!(alike < 0.5 && bent > 10.0 * alike, "{alike} {bent}");
    let missing = compare("1:3", "3:1");
    assert_eq!(missing.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&missing.stderr).contains("plate 3 has no stroke 1"));
}

#[test]
fn a_killed_host_delivers_once_or_reports() {
    let folder = tempfile::tempdir().unwrap();
    let mut press = Press::start(folder.path(), "strokes = 6\n[stroke_faults]");
    let plant = plant(folder.path(), &press.modbus, &format!("cell = \"{}\"", press.plate));
    for kills in 1..=4 {
        let host = Host::start(&plant);
        // Killed at another point each time: while scanning, while evaluating, after the result.
        press.wait_taken(kills);
        let busy = kills % 2 == 0;
        until("the state to kill in", || (busy == (press.host_status() & 2 != 0)).then_some(()));
        host.kill();
    }
    let mut host = Host::start(&plant);
    let stats = press.wait_done();
    let log = host.log();
    for count in ["writes_outside", "wrong_values", "duplicates", "changed"] {
        assert_eq!(stats[count], 0, "{count}: {stats:#}\n{log}");
    }
    assert_eq!(host.stop(), Some(0));
    let history = Host::history(&plant);
    let mut keys: Vec<String> = history.iter().map(|record| record["key"].to_string()).collect();
    let all = keys.len();
    keys.sort();
    keys.dedup();
    assert_eq!(keys.len(), all, "no stroke is on record twice");
    for record in &history {
        assert!(record["verdict"].is_string(), "every stroke accepted has its end: {record}\n{log}");
    }
}

#[test]
fn the_wrong_press_is_never_written_to() {
    for (config, code) in [("", "502"), ("map_version = 2", "501")] {
        let folder = tempfile::tempdir().unwrap();
        let mut press = Press::start(folder.path(), config);
        if code == "502" {
            press.ask(r#"{"do":{"press_id":4}}"#);
        }
        let plant = plant(folder.path(), &press.modbus, &format!("cell = \"{}\"", press.plate));
        let mut host = Host::start(&plant);
        let status = until("the fault in the status", || {
            host.status().filter(|s| s.to_string().contains(&format!("\"{code} ")))
        });
        assert_eq!(status["running"], true);
        let stats = press.stats();
        assert_eq!(stats["writes"], 0, "{stats:#}");
        assert_eq!(host.stop(), Some(0), "{}", host.log());
        assert_eq!(press.stats()["writes"], 0);
    }
}

#[test]
fn a_press_that_cannot_be_reached_is_named_and_tried_again() {
    let folder = tempfile::tempdir().unwrap();
    let nobody = platen_tests::unserved_address().unwrap();
    let plant = plant(folder.path(), &nobody.to_string(), "shape = \"flat\"");
    let mut host = Host::start(&plant);
    until("the fault in the status", || host.status().filter(|s| s.to_string().contains("\"101 ")));
    assert_eq!(host.stop(), Some(0), "{}", host.log());
}

#[test]
fn a_second_host_on_the_same_record_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let press = Press::start(folder.path(), "automatic = false");
    let plant = plant(folder.path(), &press.modbus, &format!("cell = \"{}\"", press.plate));
    let mut first = Host::start(&plant);
    until("the first host", || first.status());
    let mut second = Host::start(&plant);
    assert_eq!(second.wait(), Some(1));
    assert!(second.log().contains("history"), "{}", second.log());
    assert_eq!(first.stop(), Some(0));
}

#[test]
fn a_scanner_that_fails_is_reported_to_the_press() {
    let folder = tempfile::tempdir().unwrap();
    let mut press = Press::start(folder.path(), "strokes = 1\nbaseline = false\nwait_ready = false");
    let nobody = platen_tests::unserved_address().unwrap();
    let plant = plant(folder.path(), &press.modbus, &format!("cell = \"{nobody}\""));
    let mut host = Host::start(&plant);
    let status =
        until("the fault in the status", || host.status().filter(|s| s.to_string().contains("\"201 ")));
    assert_eq!(status["running"], true);
    until("the code in the registers", || {
        let registers = press.ask(r#"{"get":"registers"}"#);
        (registers["registers"]["h"][6] == 201).then_some(())
    });
    assert_eq!(host.stop(), Some(0), "{}", host.log());
}

#[test]
fn a_missing_calibration_takes_ready_off_until_it_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let mut press = Press::start(folder.path(), "strokes = 2\nbaseline = false");
    let plant = plant(folder.path(), &press.modbus, &format!("cell = \"{}\"", press.plate));
    let text = std::fs::read_to_string(&plant).unwrap();
    std::fs::write(&plant, format!("{text}\n[calibration]\nfile = \"cal.toml\"\nmax_age = \"10 d\"\n"))
        .unwrap();
    let mut host = Host::start(&plant);
    until("the code in the registers", || {
        let registers = press.ask(r#"{"get":"registers"}"#);
        (registers["registers"]["h"][6] == 207).then_some(())
    });
    // Bit 11 is set because the calibration is not valid; bit 0 would mean ready.
    assert_eq!(press.host_status() & (1 << 11 | 1), 1 << 11);
    assert!(press.stats()["taken"].as_array().unwrap().is_empty());

    let now = std::process::Command::new("date").args(["-u", "+%FT%TZ"]).output().unwrap();
    let now = String::from_utf8(now.stdout).unwrap();
    let calibration = format!(
        "[calibration]\nmade = \"{}\"\ninstrument = \"\"\nplate = \"A\"\nscans = 4\nsigma_correlated_mm = 0.02\n\
         sigma_true_mm = 0.1\n",
        now.trim()
    );
    std::fs::write(folder.path().join("cal.toml"), calibration).unwrap();
    let stats = press.wait_done();
    assert_clean(&stats, &host.log());
    assert_eq!(press.host_status() & 1 << 11, 0);
    let history = Host::history(&plant);
    assert_eq!(history.len(), 2);
    let document = std::path::Path::new(history[1]["document"].as_str().unwrap());
    let result: serde_json::Value = serde_json::from_slice(&std::fs::read(document).unwrap()).unwrap();
    assert_eq!(result["calibration"]["sigma_true_mm"], 0.1);
    assert_eq!(host.stop(), Some(0), "{}", host.log());
}

/// Returns the words of the newest result that the press accepted.
fn newest_words(stats: &serde_json::Value) -> Vec<u64> {
    let words = stats["taken"].as_array().unwrap().last().unwrap()["words"].as_array().unwrap();
    words.iter().map(|word| word.as_u64().unwrap()).collect()
}

fn run_on_full_disk(file_bytes: u32, wanted: &str) {
    let folder = tempfile::tempdir().unwrap();
    let mut press = Press::start(folder.path(), "strokes = 2\nautomatic = false");
    let plant = plant(folder.path(), &press.modbus, &format!("cell = \"{}\"", press.plate));
    // The history must exist: a host that cannot open it does not start.
    let mut first = Host::start(&plant);
    until("ready", || (press.host_status() & 1 == 1).then_some(()));
    assert_eq!(first.stop(), Some(0), "{}", first.log());

    let mut host = Host::on_full_disk(&plant, file_bytes);
    until("ready", || (press.host_status() & 1 == 1).then_some(()));
    assert_eq!(press.ask(r#"{"do":"stroke"}"#)["ok"], true);
    let stats = press.wait_taken(1);
    assert_clean(&stats, &host.log());
    let words = newest_words(&stats);
    assert_eq!(words[7], 402, "warning_code: {words:?}\n{}", host.log());
    assert_ne!(words[55], 0xFFFF, "measured and delivered all the same\n{}", host.log());
    let says = |text: &serde_json::Value| text.as_str().is_some_and(|text| text.starts_with("402 "));
    let status =
        until("the warning in the status", || host.status().filter(|it| says(&it["status"]["warning"])));
    assert!(status["status"]["records_lost"].as_u64() > Some(0), "{status:#}");
    assert!(status["status"]["disk_free"].as_u64() > Some(0), "{status:#}");
    assert!(host.log().contains(wanted), "{}", host.log());
    assert_eq!(host.stop(), Some(0), "{}", host.log());
}

#[test]
fn a_full_journal_costs_the_record_and_not_the_result() {
    run_on_full_disk(32 << 10, "the journal cannot be written");
}

#[test]
fn a_lost_result_file_is_told_to_the_press() {
    run_on_full_disk(LESS_THAN_A_RESULT, "the record is lost");
}
