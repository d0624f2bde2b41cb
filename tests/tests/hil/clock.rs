//! Clock jumps of a running host by a day back and forth: the order of the strokes is kept, nothing is removed, and the
//! record contains the jumps.

use std::io::Write as _;
use std::path::Path;

use platen_history::{Archive, Filter};

use crate::cell::{Host, Press, assert_clean, plant, until};

const DAY: i64 = 86_400;

/// Shifts the clock of the host by this many seconds; the file is written in place, since the host has mapped it.
fn set(shift: &Path, seconds: i64) {
    let mut file = std::fs::File::options().write(true).create(true).truncate(false).open(shift).unwrap();
    file.write_all(&seconds.to_ne_bytes()).unwrap();
}

#[test]
fn a_clock_set_back_and_forth_by_a_day_changes_no_order_and_removes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let shift = folder.path().join("shift");
    set(&shift, 0);
    let mut press = Press::start(folder.path(), "strokes = 9\nautomatic = false\nbaseline = false");
    let plant = plant(folder.path(), &press.modbus, &format!("cell = \"{}\"", press.plate));
    let text = std::fs::read_to_string(&plant).unwrap();
    // Half a day: by the realtime clock every scan would be too old after the first jump.
    std::fs::write(&plant, format!("{text}keep_scans = \"12 h\"\n")).unwrap();
    let mut host = Host::with_shifted_clock(&plant, &shift);
    let jumps = [0, DAY, -DAY, 0];
    for (k, seconds) in jumps.into_iter().enumerate() {
        until("the host to be ready", || (press.host_status() & 1 == 1).then_some(()));
        set(&shift, seconds);
        until("the host to see its clock", || {
            (host.log().matches("the clock was set").count() == k).then_some(())
        });
        press.ask(r#"{"do":"stroke"}"#);
        press.wait_taken(k + 1);
        until("the stroke acknowledged", || Host::history(&plant).get(k)?["ack"].is_string().then_some(()));
    }
    let stats = press.stats();
    let status = until("the state of the host", || host.status());
    assert_eq!(host.stop(), Some(0), "{}", host.log());
    assert_clean(&stats, &host.log());

    let archive = Archive::open(&folder.path().join("results/history.sqlite")).unwrap();
    let strokes = archive.strokes(&Filter::default()).unwrap();
    let order: Vec<(u32, u16)> = strokes.iter().map(|stroke| (stroke.run_id, stroke.key.stroke)).collect();
    assert_eq!(order, [(1, 1), (2, 2), (3, 3), (4, 4)]);
    // The times of the record are those of the clock: they go back, the order does not.
    let days: Vec<i64> = strokes
        .iter()
        .map(|stroke| stroke.accepted.duration_since(strokes[0].accepted).as_secs() / (DAY - 3600))
        .collect();
    assert_eq!(days, [0, 1, -1, 0]);
    for (k, stroke) in strokes.iter().enumerate() {
        for name in ["scan_time", "evaluate_time", "stroke_to_result_time"] {
            assert!((0.0..3600.0).contains(&stroke.figures[name]), "{name} of run {}: {stroke:?}", k + 1);
        }
        let run = folder.path().join(format!("results/run-{:06}", k + 1));
        assert!(run.join("scan.e57").exists() && run.join("result.json").exists(), "{}", run.display());
        let before = archive.before(stroke.run_id).unwrap().map(|before| before.run_id);
        assert_eq!(
            before,
            (k > 0).then_some(k as u32),
            "the stroke before is the last run, whatever its time"
        );
    }
    let events = archive.events(0, 100).unwrap();
    let said: Vec<&str> =
        events.iter().filter(|event| event.kind == "clock").map(|event| event.text.as_str()).collect();
    assert_eq!(said.len(), 3, "{said:?}");
    for (text, start) in said.iter().zip(["forward by 8", "back by 17", "forward by 8"]) {
        assert!(text.starts_with(&format!("the clock was set {start}")), "{text}");
    }
    for ms in ["trigger_to_busy_ms", "stroke_to_result_ms", "result_to_ack_ms", "journal_ms"] {
        let percentiles = status["status"][ms].as_array().unwrap();
        assert!(
            percentiles.iter().all(|ms| (0.0..3.6e6).contains(&ms.as_f64().unwrap())),
            "{ms}: {status:#}"
        );
    }
}
