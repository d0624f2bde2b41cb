//! Tests of recording, queries and export, and of the refusal of steps that do not follow.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that fails may panic")]

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::PathBuf;

use jiff::{SignedDuration, Timestamp};
use platen_history::{
    Accepted, Archive, ChangeKind, Difference, Error, Filter, Finished, History, Stroke, Table, compare,
};
use platen_model::{Stage, StrokeKey, Verdict};

const PRESS: u16 = 3;

/// History in a temporary folder, with a clock that advances by a second in each step.
struct Fixture {
    folder: tempfile::TempDir,
    history: Option<History>,
    now: Timestamp,
    run_id: u32,
}

impl Fixture {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let now = "2026-03-02T06:00:00Z".parse().unwrap();
        let mut fixture = Self { folder, history: None, now, run_id: 0 };
        fixture.reopen();
        fixture
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("results/history.sqlite")
    }

    fn reopen(&mut self) {
        self.history = None;
        self.history = Some(History::open(&self.path(), PRESS, self.now).unwrap());
    }

    fn history(&mut self) -> &mut History {
        self.history.as_mut().unwrap()
    }

    fn tick(&mut self) -> Timestamp {
        self.now += SignedDuration::from_secs(1);
        self.now
    }

    fn accept(&mut self, session: u16, stroke: u16, part_id: Option<u32>) -> u32 {
        self.accept_as(session, stroke, 0, part_id, |_| {})
    }

    fn accept_as(
        &mut self,
        session: u16,
        stroke: u16,
        attempt: u16,
        part_id: Option<u32>,
        change: impl FnOnce(&mut Accepted),
    ) -> u32 {
        self.run_id += 1;
        let mut accepted = accepted(key(session, stroke, attempt), self.run_id);
        accepted.part_id = part_id;
        change(&mut accepted);
        let now = self.tick();
        self.history().accept(&accepted, now).unwrap();
        self.run_id
    }

    /// Accepts, scans and judges a stroke.
    fn measure(&mut self, session: u16, stroke: u16, part_id: Option<u32>, verdict: Verdict) -> u32 {
        let run_id = self.accept(session, stroke, part_id);
        self.conclude(key(session, stroke, 0), run_id, verdict);
        run_id
    }

    fn conclude(&mut self, key: StrokeKey, run_id: u32, verdict: Verdict) {
        let now = self.tick();
        self.history().scanned(key, now).unwrap();
        let now = self.tick();
        self.history().finish(&finished(key, run_id, verdict), now).unwrap();
    }

    fn archive(&self) -> &platen_history::Archive {
        self.history.as_ref().unwrap().archive()
    }

    fn before(&self, run_id: u32) -> Option<u32> {
        self.archive().before(run_id).unwrap().map(|stroke| stroke.run_id)
    }
}

fn key(session: u16, stroke: u16, attempt: u16) -> StrokeKey {
    StrokeKey { press: PRESS, session, stroke, attempt }
}

fn accepted(key: StrokeKey, run_id: u32) -> Accepted {
    Accepted {
        key,
        run_id,
        part_id: None,
        part_name: None,
        recipe: Some(17),
        baseline: false,
        dry_run: false,
        data: r#"{"die_id":4}"#.to_owned(),
    }
}

fn finished(key: StrokeKey, run_id: u32, verdict: Verdict) -> Finished {
    Finished {
        key,
        run_id,
        seq: run_id as u16,
        verdict,
        reason: (verdict == Verdict::NotMeasured).then(|| "coverage".to_owned()),
        figures: BTreeMap::from([("gap.max".to_owned(), 0.001 * f64::from(run_id))]),
        publication: format!(r#"{{"seq":{run_id}}}"#),
    }
}

#[test]
fn a_new_history_has_an_owner_that_stays() {
    let mut fixture = Fixture::new();
    let new = fixture.history().recall().unwrap();
    assert_ne!(new.owner, 0);
    assert_eq!((new.result_seq, new.run_id, new.last.is_none(), new.attempts.len()), (0, 0, true, 0));
    fixture.reopen();
    assert_eq!(fixture.history().recall().unwrap(), new);
}

#[test]
fn every_stage_is_on_record_with_its_time_and_survives_reopening() {
    let mut fixture = Fixture::new();
    let run_id = fixture.accept(9, 41, Some(700));
    let stages = |fixture: &mut Fixture| {
        fixture.reopen();
        let recalled = fixture.history().recall().unwrap();
        (recalled.last.unwrap().stage, recalled.result_seq)
    };
    assert_eq!(stages(&mut fixture), (Stage::Accepted, 0));
    let key = key(9, 41, 0);
    let now = fixture.tick();
    fixture.history().scanned(key, now).unwrap();
    assert_eq!(stages(&mut fixture), (Stage::Scanned, 0));
    let now = fixture.tick();
    fixture.history().finish(&finished(key, run_id, Verdict::Fail), now).unwrap();
    assert_eq!(stages(&mut fixture), (Stage::Finished, 1));
    let now = fixture.tick();
    fixture.history().acked(key, "explicit", now).unwrap();
    assert_eq!(stages(&mut fixture), (Stage::Acked, 1));

    fixture.history().attach_document(run_id, "results/1/result.json".as_ref()).unwrap();
    let stroke = fixture.archive().stroke(run_id).unwrap();
    let times = [Some(stroke.accepted), stroke.scanned, stroke.finished, stroke.acked];
    let times = times.map(|time| time.unwrap().to_string());
    let expected = ["06:00:01", "06:00:02", "06:00:03", "06:00:04"].map(|t| format!("2026-03-02T{t}Z"));
    assert_eq!(times, expected);
    assert_eq!((stroke.key, stroke.recipe, stroke.verdict), (key, Some(17), Some(Verdict::Fail)));
    assert_eq!((stroke.seq, stroke.ack.as_deref()), (Some(1), Some("explicit")));
    assert_eq!(stroke.figures, BTreeMap::from([("gap.max".to_owned(), 0.001)]));
    assert_eq!(
        (stroke.data.as_str(), stroke.publication.as_deref()),
        (r#"{"die_id":4}"#, Some(r#"{"seq":1}"#))
    );
    assert_eq!(stroke.document.as_deref(), Some("results/1/result.json".as_ref()));
    assert_eq!(stroke.reason, None);
    let missing = fixture.history().attach_document(77, "result.json".as_ref());
    assert!(matches!(missing, Err(Error::NoSuchRun { run_id: 77, .. })));
}

#[test]
fn the_same_step_again_changes_nothing() {
    let mut fixture = Fixture::new();
    let run_id = fixture.measure(1, 1, None, Verdict::Pass);
    let key = key(1, 1, 0);
    let now = fixture.tick();
    fixture.history().acked(key, "explicit", now).unwrap();
    let once = fixture.archive().stroke(run_id).unwrap();
    for _ in 0..2 {
        let now = fixture.tick();
        fixture.history().accept(&accepted(key, run_id), now).unwrap();
        fixture.history().scanned(key, now).unwrap();
        fixture.history().finish(&finished(key, run_id, Verdict::Pass), now).unwrap();
        fixture.history().acked(key, "never", now).unwrap();
    }
    assert_eq!(fixture.archive().strokes(&Filter::default()).unwrap(), [once]);
}

#[test]
fn what_does_not_follow_is_refused_and_leaves_no_trace() {
    let mut fixture = Fixture::new();
    let run_id = fixture.measure(1, 7, None, Verdict::Pass);
    let before = fixture.archive().strokes(&Filter::default()).unwrap();
    let now = fixture.now;
    let history = fixture.history();
    let check = |result: Result<(), Error>, expected: &str| {
        assert_eq!(result.unwrap_err().to_string(), expected);
    };
    check(
        history.accept(&accepted(key(1, 7, 0), 2), now),
        "press 3 session 1 stroke 7: is on record as run 1; a stroke is measured once",
    );
    check(
        history.accept(&accepted(key(1, 8, 0), run_id), now),
        "press 3 session 1 stroke 8: run id 1 is that of press 3 session 1 stroke 7",
    );
    check(history.scanned(key(1, 8, 2), now), "press 3 session 1 stroke 8 attempt 2: was never accepted");
    check(history.acked(key(2, 7, 0), "explicit", now), "press 3 session 2 stroke 7: was never accepted");
    check(
        history.finish(&finished(key(1, 7, 0), 5, Verdict::Fail), now),
        "press 3 session 1 stroke 7: has a result under run 5, but was not accepted under it",
    );
    let other = Finished { publication: "{}".to_owned(), ..finished(key(1, 7, 0), run_id, Verdict::Fail) };
    check(
        history.finish(&other, now),
        "press 3 session 1 stroke 7: run 1 has another result already; it stands",
    );
    check(
        history.accept(&accepted(StrokeKey { press: 4, ..key(1, 9, 0) }, 9), now),
        "press 4 session 1 stroke 9: this history was opened for press 3",
    );
    assert_eq!(fixture.archive().strokes(&Filter::default()).unwrap(), before);
}

#[test]
fn a_stroke_number_may_come_back_after_a_turn_of_the_counter() {
    let mut fixture = Fixture::new();
    fixture.measure(1, 7, None, Verdict::Pass);
    fixture.run_id = 65_535;
    let again = fixture.measure(1, 7, None, Verdict::Fail);
    assert_eq!(again, 65_536);
    let recalled = fixture.history().recall().unwrap();
    let last = fixture.archive().last(PRESS).unwrap().unwrap();
    assert_eq!((recalled.run_id, last.verdict), (65_536, Some(Verdict::Fail)));
    let now = fixture.tick();
    fixture.history().acked(key(1, 7, 0), "explicit", now).unwrap();
    assert_eq!(fixture.archive().stroke(1).unwrap().stage(), Stage::Finished);
    assert_eq!(fixture.archive().stroke(again).unwrap().stage(), Stage::Acked);
}

#[test]
fn attempts_of_the_running_session_are_recalled_for_half_a_turn() {
    let mut fixture = Fixture::new();
    fixture.measure(1, 5, None, Verdict::Pass);
    fixture.measure(2, 6, None, Verdict::Pass);
    fixture.run_id = 40_000;
    fixture.measure(2, 7, None, Verdict::Pass);
    fixture.accept_as(2, 7, 1, None, |_| {});
    fixture.accept(2, 8, None);
    let recalled = fixture.history().recall().unwrap();
    assert_eq!(recalled.attempts, BTreeMap::from([(7, 1), (8, 0)]));
    assert_eq!(recalled.last.unwrap().key, key(2, 8, 0));
}

#[test]
fn a_plate_is_its_part_number_else_what_lies_between_two_ends_of_part() {
    let mut fixture = Fixture::new();
    let numbered =
        [fixture.accept(1, 1, Some(700)), fixture.accept(1, 2, Some(701)), fixture.accept(1, 3, Some(700))];
    let nameless = [fixture.accept(1, 4, None), fixture.accept(1, 5, Some(0))];
    let now = fixture.tick();
    fixture.history().part_end(now).unwrap();
    let next = fixture.accept(1, 6, None);
    let back = fixture.accept(1, 7, Some(701));
    let plate = |run_id| fixture.archive().stroke(run_id).unwrap().plate;
    assert_eq!(numbered.map(plate), [1, 2, 1]);
    assert_eq!(nameless.map(plate), [3, 3]);
    assert_eq!((plate(next), plate(back)), (4, 2));
    let plates = fixture.archive().plates().unwrap();
    let ended: Vec<bool> = plates.iter().map(|plate| plate.ended.is_some()).collect();
    assert_eq!(ended, [true, false, true, false]);
    let strokes: Vec<u32> = plates.iter().map(|plate| plate.strokes).collect();
    assert_eq!(strokes, [2, 2, 2, 1]);
}

#[test]
fn the_stroke_before_is_the_last_measured_one_of_the_same_plate() {
    let mut fixture = Fixture::new();
    let blank = fixture.accept_as(1, 1, 0, Some(700), |stroke| stroke.baseline = true);
    fixture.conclude(key(1, 1, 0), blank, Verdict::CannotTell);
    let first = fixture.measure(1, 2, Some(700), Verdict::Fail);
    let failed = fixture.measure(1, 3, Some(700), Verdict::NotMeasured);
    let other = fixture.measure(1, 4, Some(701), Verdict::Pass);
    let trial = fixture.accept_as(1, 5, 0, Some(700), |stroke| stroke.dry_run = true);
    fixture.conclude(key(1, 5, 0), trial, Verdict::Pass);
    let unfinished = fixture.accept(1, 6, Some(700));
    let second = fixture.measure(1, 7, Some(700), Verdict::Fail);
    let rescan = fixture.accept_as(1, 7, 1, Some(700), |_| {});
    fixture.conclude(key(1, 7, 1), rescan, Verdict::Pass);
    let third = fixture.accept(1, 8, Some(700));

    assert_eq!(fixture.before(blank), None);
    assert_eq!(fixture.before(first), Some(blank));
    assert_eq!(fixture.before(failed), Some(first));
    assert_eq!(fixture.before(other), None);
    assert_eq!(fixture.before(unfinished), Some(first));
    assert_eq!(fixture.before(second), Some(first));
    assert_eq!(fixture.before(rescan), Some(first));
    assert_eq!(fixture.before(third), Some(rescan));
    let baseline = |run_id| fixture.archive().baseline(run_id).unwrap().map(|stroke| stroke.run_id);
    assert_eq!((baseline(third), baseline(blank), baseline(other)), (Some(blank), None, None));
    let plate = &fixture.archive().plates().unwrap()[0];
    assert_eq!((plate.strokes, plate.verdict), (8, Some(Verdict::Pass)));
}

#[test]
fn strokes_are_found_by_plate_part_time_and_verdict() {
    let mut fixture = Fixture::new();
    for stroke in 1..=4 {
        let verdict = if stroke < 4 { Verdict::Fail } else { Verdict::Pass };
        fixture.measure(1, stroke, Some(700 + u32::from(stroke % 2)), verdict);
    }
    let runs = |filter: Filter| -> Vec<u32> {
        fixture.archive().strokes(&filter).unwrap().iter().map(|stroke| stroke.run_id).collect()
    };
    let at = |text: &str| Some(text.parse().unwrap());
    assert_eq!(runs(Filter::default()), [1, 2, 3, 4]);
    assert_eq!(runs(Filter { plate: Some(2), ..Filter::default() }), [2, 4]);
    assert_eq!(runs(Filter { part_id: Some(701), ..Filter::default() }), [1, 3]);
    assert_eq!(runs(Filter { verdict: Some(Verdict::Pass), ..Filter::default() }), [4]);
    assert_eq!(runs(Filter { newest: Some(2), ..Filter::default() }), [3, 4]);
    assert_eq!(runs(Filter { since: at("2026-03-02T06:00:04Z"), ..Filter::default() }), [2, 3, 4]);
    assert_eq!(runs(Filter { until: at("2026-03-02T06:00:04Z"), ..Filter::default() }), [1]);
    let missing = fixture.archive().stroke(9).unwrap_err().to_string();
    assert!(missing.ends_with("no stroke has the run id 9; `platen history list` shows them"), "{missing}");
}

#[test]
fn two_strokes_compare_figure_by_figure_and_all_export_as_one_table() {
    let mut fixture = Fixture::new();
    let first = fixture.measure(1, 1, Some(700), Verdict::Fail);
    let second = fixture.accept(1, 2, Some(700));
    let mut result = finished(key(1, 2, 0), second, Verdict::NotMeasured);
    result.figures = BTreeMap::from([("gap.max".to_owned(), 0.002), ("deviation.max".to_owned(), 0.01)]);
    result.reason = Some("two loops, \"chain\"".to_owned());
    let now = fixture.tick();
    fixture.history().finish(&result, now).unwrap();
    let strokes = fixture.archive().strokes(&Filter::default()).unwrap();
    let difference = |name: &str, first, second| Difference { name: name.to_owned(), first, second };
    assert_eq!(
        compare(&strokes[0], &strokes[1]),
        [difference("deviation.max", None, Some(0.01)), difference("gap.max", Some(0.001), Some(0.002)),]
    );
    let table = Table::of_strokes(&strokes);
    let mut csv = Vec::new();
    table.write_csv(&mut csv).unwrap();
    let expected = "run_id,press,session,stroke,attempt,plate,recipe,baseline,dry_run,accepted,scanned,finished,acked,\
        verdict,reason,press.die_id,deviation.max,gap.max\r\n\
        1,3,1,1,0,1,17,false,false,2026-03-02T06:00:01.000Z,2026-03-02T06:00:02.000Z,2026-03-02T06:00:03.000Z,,fail,,4,,0.001\r\n\
        2,3,1,2,0,1,17,false,false,2026-03-02T06:00:04.000Z,,2026-03-02T06:00:05.000Z,,not_measured,\
        \"two loops, \"\"chain\"\"\",4,0.01,0.002\r\n";
    assert_eq!(String::from_utf8(csv).unwrap(), expected);
    assert_eq!(first, 1);
    let mut parquet = Vec::new();
    table.write_parquet(&mut parquet).unwrap();
    assert_eq!(
        rows(parquet),
        [
            "run_id: 1, press: 3, session: 1, stroke: 1, attempt: 0, plate: 1, recipe: 17, baseline: false, dry_run: false, \
         accepted: 2026-03-02 06:00:01.000 +00:00, scanned: 2026-03-02 06:00:02.000 +00:00, finished: 2026-03-02 06:00:03.000 +00:00, \
         acked: null, verdict: \"fail\", reason: null, press.die_id: 4.0, deviation.max: null, gap.max: 0.001",
            "run_id: 2, press: 3, session: 1, stroke: 2, attempt: 0, plate: 1, recipe: 17, baseline: false, dry_run: false, \
         accepted: 2026-03-02 06:00:04.000 +00:00, scanned: null, finished: 2026-03-02 06:00:05.000 +00:00, acked: null, \
         verdict: \"not_measured\", reason: \"two loops, \"chain\"\", press.die_id: 4.0, deviation.max: 0.01, gap.max: 0.002",
        ]
    );
}

#[test]
fn cells_are_quoted_only_where_rfc_4180_requires_it() {
    for (reason, cell) in [
        ("plain; tab\t 'x' #1", "plain; tab\t 'x' #1"),
        (" spaces ", " spaces "),
        ("a,b", "\"a,b\""),
        ("\"a\"", "\"\"\"a\"\"\""),
        ("two\nlines", "\"two\nlines\""),
        ("carriage\rreturn", "\"carriage\rreturn\""),
        ("-1", "-1"),
        ("0.7 m\u{b2}", "0.7 m\u{b2}"),
    ] {
        let mut fixture = Fixture::new();
        let run_id = fixture.accept_as(1, 1, 0, None, |stroke| stroke.data = "{}".to_owned());
        let mut result = finished(key(1, 1, 0), run_id, Verdict::NotMeasured);
        (result.figures, result.reason) = (BTreeMap::new(), Some(reason.to_owned()));
        let now = fixture.tick();
        fixture.history().finish(&result, now).unwrap();
        let mut csv = Vec::new();
        Table::of_strokes(&fixture.archive().strokes(&Filter::default()).unwrap())
            .write_csv(&mut csv)
            .unwrap();
        let csv = String::from_utf8(csv).unwrap();
        assert!(csv.ends_with(&format!(",,not_measured,{cell}\r\n")), "{csv:?}");
    }
}

/// Returns the rows of a Parquet file as its own reader shows them.
fn rows(file: Vec<u8>) -> Vec<String> {
    use parquet::file::reader::{FileReader as _, SerializedFileReader};
    let mut disk = tempfile::tempfile().unwrap();
    disk.write_all(&file).unwrap();
    let reader = SerializedFileReader::new(disk).unwrap();
    reader
        .get_row_iter(None)
        .unwrap()
        .map(|row| {
            let row = row.unwrap();
            let cells = row.get_column_iter().map(|(name, cell)| format!("{name}: {cell}"));
            cells.collect::<Vec<_>>().join(", ")
        })
        .collect()
}

#[test]
fn values_of_the_press_are_exported_in_their_own_types() {
    let mut fixture = Fixture::new();
    let data = r#"{"die_id":4,"force":1.5e6,"part_name":"a,b","plc_time":{"unix_s":1},"temperature":null}"#;
    fixture.accept_as(1, 1, 0, None, |stroke| stroke.data = data.to_owned());
    fixture.accept_as(1, 2, 0, None, |stroke| stroke.data = r#"{"die_id":null}"#.to_owned());
    let strokes = fixture.archive().strokes(&Filter::default()).unwrap();
    let mut csv = Vec::new();
    Table::of_strokes(&strokes).write_csv(&mut csv).unwrap();
    let csv = String::from_utf8(csv).unwrap();
    let lines: Vec<&str> = csv.lines().collect();
    assert!(lines[0].ends_with(",verdict,reason,press.die_id,press.force,press.part_name"), "{csv}");
    assert!(lines[1].ends_with("Z,,,,,,4,1500000,\"a,b\""), "{csv}");
    assert!(lines[2].ends_with("Z,,,,,,,,"), "a missing value is an empty cell: {csv}");
    let mut parquet = Vec::new();
    Table::of_strokes(&strokes).write_parquet(&mut parquet).unwrap();
    assert!(rows(parquet)[1].ends_with("press.die_id: null, press.force: null, press.part_name: null"));
}

#[test]
fn a_second_writer_is_refused_by_name_and_readers_are_not_blocked() {
    let mut fixture = Fixture::new();
    let path = fixture.path();
    let refused = History::open(&path, PRESS, fixture.now).unwrap_err().to_string();
    let program = std::env::current_exe().unwrap();
    let program = program.file_name().unwrap().to_string_lossy().into_owned();
    let process = std::process::id();
    assert_eq!(
        refused,
        format!(
            "{}: in use by {program}, process {process}, since 2026-03-02T06:00:00Z; \
             one history belongs to one host, stop that one first",
            path.display()
        )
    );
    let reader = Archive::open(&path).unwrap();
    fixture.measure(1, 1, None, Verdict::Pass);
    assert_eq!(reader.strokes(&Filter::default()).unwrap().len(), 1);
    fixture.reopen();
    assert_eq!(reader.strokes(&Filter::default()).unwrap().len(), 1);
}

#[test]
fn files_that_are_not_a_history_are_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let now = Timestamp::UNIX_EPOCH;
    let check = |name: &str, expected: &str| {
        let path = folder.path().join(name);
        let before = std::fs::read(&path).ok();
        let error = History::open(&path, PRESS, now).unwrap_err().to_string();
        assert_eq!(error, format!("{}: {expected}", path.display()));
        assert_eq!(std::fs::read(&path).ok(), before);
    };
    std::fs::write(folder.path().join("plate.toml"), "[plate]\nid = 'A17'\n".repeat(50)).unwrap();
    check("plate.toml", "is not a database; name another file");
    let database = |name: &str, sql: &str| {
        rusqlite::Connection::open(folder.path().join(name)).unwrap().execute_batch(sql).unwrap();
    };
    database("other.sqlite", "CREATE TABLE t (x)");
    check("other.sqlite", "is a database, but not a history of platen; name another file");
    database(
        "newer.sqlite",
        "CREATE TABLE t (x); PRAGMA application_id = 0x706c746e; PRAGMA user_version = 200",
    );
    check("newer.sqlite", "has format 2.0, this program reads format 1.1; use the program that wrote it");
    let absent = folder.path().join("absent.sqlite");
    let error = Archive::open(&absent).unwrap_err().to_string();
    assert_eq!(error, format!("{}: No such file or directory (os error 2)", absent.display()));
    assert!(!absent.exists());
}

#[test]
fn a_row_changed_by_hand_is_named() {
    let mut fixture = Fixture::new();
    fixture.measure(1, 1, None, Verdict::Pass);
    let other = rusqlite::Connection::open(fixture.path()).unwrap();
    other.execute("UPDATE stroke SET verdict = 'good'", []).unwrap();
    let error = fixture.archive().stroke(1).unwrap_err().to_string();
    assert!(error.contains("run 1: ") && error.contains("unknown verdict \"good\""), "{error}");
}

/// A record of the first release is read unchanged, a host extends it after making a copy, and no stroke is missed.
#[test]
fn a_record_of_format_1_0_is_read_and_extended() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("history.sqlite");
    let old = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/records/1.0.sqlite");
    std::fs::copy(&old, &path).unwrap();
    let strokes = Archive::open(&path).unwrap().strokes(&Filter::default()).unwrap();
    assert_eq!(strokes.len(), 3);
    assert!(Archive::open(&path).unwrap().changes(0, 100).unwrap().is_empty());

    let history = History::open(&path, PRESS, Timestamp::UNIX_EPOCH).unwrap();
    assert_eq!(history.archive().strokes(&Filter::default()).unwrap(), strokes);
    let changes = history.archive().changes(0, 100).unwrap();
    let kinds: Vec<_> = changes.iter().map(|change| (change.run_id.unwrap(), change.kind)).collect();
    let of = |run| [(run, ChangeKind::Accepted), (run, ChangeKind::Finished), (run, ChangeKind::Acked)];
    assert_eq!(kinds, [of(1), of(2), of(3)].concat());
    assert_eq!(history.archive().changes(changes[4].n, 2).unwrap(), changes[5..7]);
    drop(history);
    assert_eq!(
        std::fs::read(folder.path().join("history.sqlite.1.0")).map(|copy| copy.len() > 4096).ok(),
        Some(true)
    );
    History::open(&path, PRESS, Timestamp::UNIX_EPOCH).unwrap();
    assert_eq!(Archive::open(&path).unwrap().changes(0, 100).unwrap(), changes, "extended once");
}

#[test]
fn each_step_is_a_change_and_a_repeated_one_none() {
    let mut fixture = Fixture::new();
    let run_id = fixture.accept(1, 1, None);
    let key = StrokeKey { press: PRESS, session: 1, stroke: 1, attempt: 0 };
    let now = fixture.tick();
    for _ in 0..2 {
        fixture.history().acked(key, "acknowledged", now).unwrap();
        fixture.history().part_end(now).unwrap();
    }
    fixture.history().note("alarm", Some(run_id), "410 a sink is behind", now).unwrap();
    fixture.history().note("clock", Some(99), "set back by 2.0 s", now).unwrap();
    let changes = fixture.history().archive().changes(0, 10).unwrap();
    let kinds: Vec<_> = changes.iter().map(|change| (change.run_id, change.kind)).collect();
    assert_eq!(
        kinds,
        [
            (Some(run_id), ChangeKind::Accepted),
            (Some(run_id), ChangeKind::Acked),
            (None, ChangeKind::Plate),
            (Some(run_id), ChangeKind::Event),
            (None, ChangeKind::Event),
        ]
    );
    assert_eq!(changes[2].plate, Some(1));
    let events = fixture.history().archive().events(0, 10).unwrap();
    assert_eq!(
        events.iter().map(|it| Some(it.event)).collect::<Vec<_>>(),
        [changes[3].event, changes[4].event]
    );
    // A stroke that is not recorded is not referred to.
    assert_eq!((events[0].run_id, events[1].run_id), (Some(run_id), None));
    assert_eq!(
        (events[1].kind.as_str(), events[1].text.as_str(), events[1].at),
        ("clock", "set back by 2.0 s", now)
    );
}

#[test]
fn a_restored_copy_has_the_same_strokes_and_another_owner() {
    let mut fixture = Fixture::new();
    let run_id = fixture.accept(1, 1, None);
    fixture.history().attach_document(run_id, std::path::Path::new("old/run-000001/result.json")).unwrap();
    let copy = fixture.folder.path().join("copy.sqlite");
    fixture.history().archive().copy_to(&copy).unwrap();
    let before = fixture.history().archive().strokes(&Filter::default()).unwrap();
    let owners = platen_history::adopt(&copy, |run| format!("new/{run}")).unwrap();
    let [[old, new]] = owners[..] else { panic!("{owners:?}") };
    assert!(old != new && new > 0, "{owners:?}");
    let mut after = Archive::open(&copy).unwrap().strokes(&Filter::default()).unwrap();
    assert_eq!(after[0].document.take().unwrap(), PathBuf::from(format!("new/{run_id}")));
    assert_eq!(after[0], Stroke { document: None, ..before[0].clone() });
    let restored = Archive::open(&copy).unwrap();
    assert_eq!(restored.damage().unwrap(), None);
    // Changes before the copy keep the number under which they were made; those after it get the new one.
    drop(restored);
    let mut goes_on = History::open(&copy, PRESS, Timestamp::UNIX_EPOCH).unwrap();
    goes_on.note("alarm", None, "after", Timestamp::UNIX_EPOCH).unwrap();
    let key = StrokeKey { press: PRESS, session: 1, stroke: 1, attempt: 0 };
    goes_on.acked(key, "late", Timestamp::UNIX_EPOCH).unwrap();
    let changes = goes_on.archive().changes(0, 10).unwrap();
    assert_eq!(
        changes.iter().map(|it| it.owner).collect::<Vec<_>>(),
        [old, new, old],
        "a stroke keeps its owner"
    );
    let owners = goes_on.archive().owners().unwrap();
    assert_eq!(owners.iter().map(|it| (it.owner, it.after_change)).collect::<Vec<_>>(), [(old, 0), (new, 1)]);
}
