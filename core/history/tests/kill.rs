//! Crash test: `kill -9` at every point of a stroke.
//!
//! No stroke may be scanned twice, lost without a report, or published with two results.
//!
//! The test acts as the press. The host is the same test binary as a child process, connected by pipes. It is killed at
//! each named point while it is paused there, then at random moments.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that fails may panic")]

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use jiff::Timestamp;
use platen_history::{Accepted, Finished, History};
use platen_model::{Entry, Recalled, Stage, StrokeKey, Verdict};

const PRESS: u16 = 1;
const SESSION: u16 = 5;
const CHILD: &str = "PLATEN_HISTORY_CHILD";
const STOP: &str = "PLATEN_HISTORY_STOP";

/// Points at which the child pauses if [`STOP`] contains them: around every step of stroke 2.
const POINTS: [&str; 10] = [
    "before accept",
    "after accept",
    "before scan",
    "after scan",
    "after scanned",
    "before finish",
    "after finish",
    "after publish",
    "before acked",
    "after acked",
];

/// Observations of the press.
#[derive(Default)]
struct Witness {
    scans: BTreeMap<u16, u32>,
    /// Sequence number and result of each stroke.
    results: BTreeMap<u16, (u16, String)>,
    owner: Option<String>,
}

struct Host {
    child: Child,
    orders: ChildStdin,
    reports: BufReader<ChildStdout>,
}

impl Host {
    fn start(database: &Path, stop: &str) -> Self {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "the_host_that_is_killed", "--nocapture", "--quiet"])
            .env(CHILD, database)
            .env(STOP, stop)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::inherit())
            .spawn()
            .unwrap();
        let orders = child.stdin.take().unwrap();
        let reports = BufReader::new(child.stdout.take().unwrap());
        Self { child, orders, reports }
    }

    fn order(&mut self, order: &str) {
        // A child that has died no longer reads; the end of its reports shows it.
        let _ = writeln!(self.orders, "{order}");
    }

    /// Returns the next report. A child that ends without being killed has failed; its standard error shows why.
    fn report(&mut self) -> String {
        self.left().next().unwrap_or_else(|| panic!("the host died by itself"))
    }

    /// Returns the reports up to the end of the child.
    fn left(&mut self) -> impl Iterator<Item = String> {
        let lines = self.reports.by_ref().lines().map(Result::unwrap);
        lines.filter_map(|line| Some(line.trim_end().strip_prefix("host: ")?.to_owned()))
    }

    /// Kills the child; returns the reports that were not read before.
    fn kill(mut self) -> Vec<String> {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
        self.left().collect()
    }
}

impl Witness {
    fn see(&mut self, report: &str) {
        let mut words = report.split(' ');
        let number = |word: Option<&str>| word.unwrap().parse::<u16>().unwrap();
        match words.next().unwrap() {
            "scan" => *self.scans.entry(number(words.next())).or_default() += 1,
            "result" => {
                let (stroke, seq) = (number(words.next()), number(words.next()));
                let result = (seq, words.next().unwrap().to_owned());
                let first = self.results.entry(stroke).or_insert_with(|| result.clone());
                assert_eq!(*first, result, "stroke {stroke} was published with two results");
            }
            "owner" => {
                let owner = words.next().unwrap().to_owned();
                assert_eq!(*self.owner.get_or_insert_with(|| owner.clone()), owner);
            }
            _ => {}
        }
    }

    /// Asserts that no stroke was scanned twice or unreported, and every sequence number was used once and in order.
    fn judge(&self, strokes: u16, database: &Path) {
        assert!(self.scans.values().all(|&scans| scans == 1), "scans: {:?}", self.scans);
        assert_eq!(self.results.keys().copied().collect::<Vec<_>>(), (1..=strokes).collect::<Vec<_>>());
        let seqs: Vec<u16> = self.results.values().map(|(seq, _)| *seq).collect();
        assert_eq!(seqs, (1..=strokes).collect::<Vec<_>>());
        let history = History::open(database, PRESS, Timestamp::UNIX_EPOCH).unwrap();
        let rows = history.archive().strokes(&platen_history::Filter::default()).unwrap();
        assert_eq!(rows.len(), usize::from(strokes));
        for row in &rows {
            assert_eq!(row.stage(), Stage::Acked);
            let (seq, result) = &self.results[&row.key.stroke];
            assert_eq!((row.seq, row.publication.as_deref()), (Some(*seq), Some(result.as_str())));
            let measured = row.verdict != Some(Verdict::NotMeasured);
            assert_eq!(measured, result == "measured");
            assert!(
                !measured || self.scans.contains_key(&row.key.stroke),
                "stroke {} unseen",
                row.key.stroke
            );
        }
    }
}

/// Runs `strokes` strokes; `fatal` is called after each report and returns whether to kill the host.
fn press(database: &Path, strokes: u16, stop: &str, mut fatal: impl FnMut(&str) -> bool) -> (Witness, u32) {
    let mut witness = Witness::default();
    let mut deaths = 0;
    let mut host = Host::start(database, stop);
    let mut stroke = 1;
    host.order("trigger 1");
    while stroke <= strokes {
        let report = host.report();
        witness.see(&report);
        if fatal(&report) {
            deaths += 1;
            host.kill().iter().for_each(|unread| witness.see(unread));
            host = Host::start(database, "");
            host.order(&format!("trigger {stroke}"));
            continue;
        }
        match report.as_str() {
            done if done == format!("acked {stroke}") => {
                stroke += 1;
                if stroke <= strokes {
                    host.order(&format!("trigger {stroke}"));
                }
            }
            result if result.starts_with(&format!("result {stroke} ")) => {
                host.order(&format!("ack {stroke}"))
            }
            _ => {}
        }
    }
    host.kill();
    (witness, deaths)
}

#[test]
fn killed_at_every_point_of_a_stroke() {
    for point in POINTS {
        let folder = tempfile::tempdir().unwrap();
        let database = folder.path().join("history.sqlite");
        let (witness, deaths) = press(&database, 4, point, |report| report == "standing");
        assert_eq!(deaths, 1, "the host never stood still {point}");
        witness.judge(4, &database);
        let interrupted = matches!(
            point,
            "after accept" | "before scan" | "after scan" | "after scanned" | "before finish"
        );
        let expected = if interrupted { "interrupted" } else { "measured" };
        assert_eq!(witness.results[&2].1, expected, "killed {point}");
    }
}

#[test]
fn killed_at_random_moments() {
    let seed = 20_260_302;
    println!("seed {seed}");
    let mut state: u64 = seed;
    let mut random = move |below: u64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % below
    };
    let folder = tempfile::tempdir().unwrap();
    let database = folder.path().join("history.sqlite");
    // The report is read while the child runs on: the kill occurs at its present point, often inside a commit.
    let (witness, deaths) = press(&database, 60, "", |_| random(12) == 0);
    assert!(deaths >= 20, "only {deaths} kills");
    witness.judge(60, &database);
}

/// Child process: a host with a scanner that only counts. Does nothing unless it was started by the tests above.
#[test]
fn the_host_that_is_killed() {
    let Some(database) = std::env::var_os(CHILD) else { return };
    let stop = std::env::var(STOP).unwrap();
    let mut history = History::open(Path::new(&database), PRESS, Timestamp::now()).unwrap();
    let recalled = history.recall().unwrap();
    report(&format!("owner {}", recalled.owner));
    let mut seq = recalled.result_seq;
    let mut run_id = recalled.run_id;
    settle(&mut history, &recalled, &mut seq);
    for order in std::io::stdin().lines() {
        let order = order.unwrap();
        let (verb, stroke) = order.split_once(' ').unwrap();
        let key = StrokeKey { press: PRESS, session: SESSION, stroke: stroke.parse().unwrap(), attempt: 0 };
        let at = |point: &str| {
            if stop == point && key.stroke == 2 {
                stand_still();
            }
        };
        match verb {
            "trigger" => {
                let known = history.recall().unwrap().attempts.contains_key(&key.stroke);
                if known {
                    again(&history, key);
                } else {
                    run_id += 1;
                    measure(&mut history, key, run_id, &mut seq, at);
                }
            }
            "ack" => {
                at("before acked");
                history.acked(key, "explicit", Timestamp::now()).unwrap();
                at("after acked");
                report(&format!("acked {}", key.stroke));
            }
            other => panic!("unknown order {other}"),
        }
    }
}

/// Settles the journal at the start: an accepted stroke without a result is reported as interrupted and never scanned
/// again.
fn settle(history: &mut History, recalled: &Recalled, seq: &mut u16) {
    let unfinished = |last: &&Entry| last.stage < Stage::Finished;
    if let Some(last) = recalled.last.as_ref().filter(unfinished) {
        *seq += 1;
        let result = result(last.key, last.run_id, *seq, Verdict::NotMeasured, "interrupted");
        history.finish(&result, Timestamp::now()).unwrap();
    }
}

/// Publishes the recorded result again, since the press still holds the trigger of a recorded stroke.
fn again(history: &History, key: StrokeKey) {
    let last = history.archive().last(PRESS).unwrap().unwrap();
    assert_eq!(last.key, key);
    let stroke = key.stroke;
    report(&format!("result {stroke} {} {}", last.seq.unwrap(), last.publication.unwrap()));
}

fn measure(history: &mut History, key: StrokeKey, run_id: u32, seq: &mut u16, at: impl Fn(&str)) {
    let accepted = Accepted {
        key,
        run_id,
        part_id: None,
        part_name: None,
        recipe: None,
        baseline: false,
        dry_run: false,
        data: "{}".to_owned(),
    };
    at("before accept");
    history.accept(&accepted, Timestamp::now()).unwrap();
    at("after accept");
    report(&format!("accepted {}", key.stroke));
    at("before scan");
    report(&format!("scan {}", key.stroke));
    at("after scan");
    history.scanned(key, Timestamp::now()).unwrap();
    at("after scanned");
    *seq += 1;
    at("before finish");
    history.finish(&result(key, run_id, *seq, Verdict::Pass, "measured"), Timestamp::now()).unwrap();
    at("after finish");
    report(&format!("result {} {seq} measured", key.stroke));
    at("after publish");
}

fn result(key: StrokeKey, run_id: u32, seq: u16, verdict: Verdict, publication: &str) -> Finished {
    let figures = BTreeMap::from([("gap.max".to_owned(), 0.001)]);
    Finished { key, run_id, seq, verdict, reason: None, figures, publication: publication.to_owned() }
}

fn report(what: &str) {
    let mut out = std::io::stdout().lock();
    writeln!(out, "host: {what}").unwrap();
    out.flush().unwrap();
}

/// Reports the pause and waits to be killed.
fn stand_still() -> ! {
    report("standing");
    loop {
        std::thread::park();
    }
}
