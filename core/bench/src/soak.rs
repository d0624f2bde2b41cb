//! Command `platen press soak`: the host's press side against a simulated press on a faulty line, for many strokes.
//!
//! The press is `platen-sim` in a process of its own, which counts strokes, results and writes. A substitute answers
//! for scanner and evaluation. The figures of every result identify its stroke, so that a result under another stroke's
//! number is detected.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use platen_host::cli::bench::{Line, SoakArguments};
use platen_host::cli::cell::Cell;
use platen_host::cli::press::trial::{Seen, serve};
use platen_host::cli::press::{self, Failure};
use platen_host::cli::run::{runtime, stop_signal};
use platen_host::cli::{CliError, Common, output};
use platen_host::progress;
use platen_plant::press::{Link, Press, Quiet, Serial, Transport};
use platen_press::{Answer, Durations, HostSide, MemoryJournal, PressLink, channels, run_press};

use serde::Deserialize;
use serde_json::json;
use tokio::sync::mpsc;

/// Strokes on one plate; the next part follows in a new session.
const PER_PART: u64 = 50;
/// Interval between reads of the press's counts.
const INTERVAL: Duration = Duration::from_millis(500);
/// Time without a result after which the run has failed: far longer than a stroke takes on the worst of these lines.
const STANDSTILL: Duration = Duration::from_secs(60);
/// Shortest and longest delay of a late answer; the silence of the host on a serial line must be longer.
const LATE_MS: [u64; 2] = [150, 350];
/// Heartbeat limit of the press: a faulty serial line may interrupt the host's heartbeat for longer than a real press
/// allows.
const HOST_MS: u64 = 10_000;
/// Limit of writes, set high enough to have no effect: strokes follow as fast as the line allows.
const WRITES_PER_S: u32 = 1000;

/// Counts of the press.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Counts {
    done: bool,
    results: u64,
    strokes: u64,
    superseded: u64,
    result_timeouts: u64,
    host_deaths: u64,
    missed_reported: u64,
    connections: u64,
    reads: u64,
    writes: u64,
    writes_outside: u64,
    writes_before_sync: u64,
    writes_while_void: u64,
    duplicates: u64,
    changed: u64,
    wrong_values: u64,
    wrong: Vec<String>,
    line_faults: std::collections::BTreeMap<String, u64>,
}

/// Outcome of a run.
struct Outcome {
    counts: Counts,
    /// Number of results with another stroke's figures.
    wrong_figures: u64,
    /// Number of scans ordered, and of those that were ordered for a stroke scanned before.
    scans: u64,
    scanned_twice: u64,
    /// Times from the trigger to the echo of the stroke's number, on the press's clock.
    trigger_to_busy: Durations,
    elapsed: Duration,
    stopped: bool,
}

impl Outcome {
    fn wrong(&self) -> u64 {
        let counts = &self.counts;
        let writes = counts.writes_outside + counts.writes_before_sync + counts.writes_while_void;
        self.wrong_figures + counts.wrong_values + counts.changed + writes
    }

    fn doubled(&self) -> u64 {
        self.counts.duplicates + self.scanned_twice
    }

    /// Returns the number of strokes without a result that neither host nor press reported.
    fn lost(&self) -> u64 {
        let counts = &self.counts;
        let reported = counts.missed_reported + counts.result_timeouts + counts.host_deaths;
        self.counts.strokes.saturating_sub(self.counts.results + reported)
    }

    fn good(&self) -> bool {
        self.counts.done && !self.stopped && self.wrong() + self.doubled() + self.lost() == 0
    }
}

/// Runs the strokes; exit code 0 if no result was wrong, doubled or lost.
pub(crate) fn run(common: &Common, arguments: &SoakArguments) -> Result<ExitCode, CliError> {
    press::report(common, soak_strokes(common, arguments))
}

fn soak_strokes(common: &Common, arguments: &SoakArguments) -> Result<ExitCode, Failure> {
    let folder = tempfile::Builder::new().prefix("platen-soak-").tempdir()?;
    let per_part = PER_PART.min(arguments.strokes);
    let parts = arguments.strokes.div_ceil(per_part);
    let device = folder.path().join("adapter");
    let config = folder.path().join("press.toml");
    std::fs::write(&config, press_file(arguments, per_part, parts, &device))?;
    let mut cell = Cell::start(&config, &[])?;
    let press = plant(arguments, &cell, &device);
    let outcome = runtime()?.block_on(soak(press, &mut cell, per_part * parts))?;
    progress::done();
    report(common, arguments, &outcome)?;
    Ok(ExitCode::from(u8::from(!outcome.good())))
}

/// Returns the configuration of the simulated press.
fn press_file(arguments: &SoakArguments, per_part: u64, parts: u64, device: &Path) -> String {
    let link = match arguments.line {
        Line::Tcp => "type = \"tcp\"".to_owned(),
        Line::RtuOverTcp => "type = \"rtu-over-tcp\"".to_owned(),
        Line::Rtu => format!("type = \"pty\"\ndevice = {:?}", device.display().to_string()),
    };
    let SoakArguments { late, reset, seed, .. } = arguments;
    let [least, most] = LATE_MS;
    format!(
        "strokes = {per_part}\nparts = {parts}\nbaseline = false\nseed = {seed}\n[link]\n{link}\n\
         [timings]\ncycle_ms = 2\ndown_ms = 2\nup_ms = 2\nbetween_ms = 0\nhost_ms = {HOST_MS}\n[plate.plan]\npasses = 10\n\
         [line_faults]\nlate = {late}\nlate_ms = [{least}, {most}]\nreset = {reset}\n"
    )
}

/// Returns the press as configured for the host.
fn plant(arguments: &SoakArguments, cell: &Cell, device: &Path) -> Press {
    let (host, port) = cell.modbus.map_or((String::new(), 0), |at| (at.ip().to_string(), at.port()));
    let mut link = match arguments.line {
        Line::Tcp => Link::tcp(host, port, 1),
        Line::RtuOverTcp => Link::rtu_over_tcp(host, port, 1),
        Line::Rtu => Link::rtu(Serial::new(device, 115_200), 1),
    };
    link.poll = Duration::from_millis(arguments.poll_ms);
    link.response_timeout = link.response_timeout.min(Duration::from_millis(LATE_MS[0] - 50));
    if let Transport::Rtu(_, quiet) | Transport::RtuOverTcp(_, quiet) = &mut link.transport {
        *quiet = Quiet(Duration::from_millis(LATE_MS[1] + 100));
    }
    let mut press = Press::pph1("simulated press", 3, link);
    press.write.max_writes_per_s = WRITES_PER_S;
    press
}

async fn soak(press: Press, cell: &mut Cell, strokes: u64) -> Result<Outcome, Failure> {
    let start = Instant::now();
    let (HostSide { orders, answers, status }, side) = channels();
    let (observer, mut seen) = mpsc::unbounded_channel();
    tokio::spawn(serve(orders, answers.clone(), observer));
    let link = PressLink::new(&press);
    let host = tokio::spawn(run_press(press, link, MemoryJournal::new(7), side));
    let mut stop = stop_signal()?;
    let (mut newest, mut since) = (0, Instant::now());
    let stopped = loop {
        tokio::select! {
            () = tokio::time::sleep(INTERVAL) => {}
            _ = stop.changed() => break true,
        }
        let counts: Counts = cell.read(r#"{"get":"counts"}"#, "/counts")?;
        if counts.done {
            break false;
        }
        if counts.results > newest {
            (newest, since) = (counts.results, Instant::now());
        } else if since.elapsed() > STANDSTILL {
            let state = status.borrow().state;
            let text = format!(
                "no result for {} s after {newest} of {strokes}; the host is in {state}",
                STANDSTILL.as_secs()
            );
            return Err(Failure::Handshake(text));
        }
        progress::phase(&format!("{newest} of {strokes} strokes, {} connections", counts.connections));
    };
    let counts: Counts = cell.read(r#"{"get":"counts"}"#, "/counts")?;
    // The host may have ended by itself.
    let _ = answers.send(Answer::Stop);
    let _ = host.await;
    let accepted = cell.accepted_results()?;
    let mut outcome = Outcome {
        counts,
        wrong_figures: 0,
        scans: 0,
        scanned_twice: 0,
        trigger_to_busy: Durations::default(),
        elapsed: start.elapsed(),
        stopped,
    };
    for it in &accepted {
        let [high, low] = it.session_id.to_be_bytes().map(u16::from);
        let figures = [it.words.get(55), it.words.get(57), it.words.get(58)].map(Option::<&u16>::copied);
        outcome.wrong_figures += u64::from(figures != [Some(it.stroke_id % 60_000), Some(low), Some(high)]);
        outcome.trigger_to_busy.add(Duration::from_millis(it.accepted_ms as u64));
    }
    let mut scanned = BTreeSet::new();
    while let Ok(what) = seen.try_recv() {
        if let Seen::Scan(key) = what {
            outcome.scans += 1;
            outcome.scanned_twice += u64::from(!scanned.insert(key));
        }
    }
    Ok(outcome)
}

fn report(common: &Common, arguments: &SoakArguments, outcome: &Outcome) -> Result<(), CliError> {
    let counts = &outcome.counts;
    let busy = |percent| outcome.trigger_to_busy.percentile(percent).map(|time| time.as_secs_f64() * 1000.0);
    let seconds = outcome.elapsed.as_secs_f64();
    if common.json {
        return output::json(&json!({
            "strokes": counts.strokes, "results": counts.results, "scans": outcome.scans,
            "wrong": outcome.wrong(), "doubled": outcome.doubled(), "lost": outcome.lost(), "good": outcome.good(),
            "missed_reported": counts.missed_reported, "superseded": counts.superseded,
            "result_timeouts": counts.result_timeouts, "host_deaths": counts.host_deaths,
            "writes_outside": counts.writes_outside, "sentences": counts.wrong,
            "line_faults": counts.line_faults, "connections": counts.connections, "reads": counts.reads,
            "writes": counts.writes, "seed": arguments.seed, "elapsed_s": seconds,
            "trigger_to_busy_ms": { "median": busy(50.0), "p99": busy(99.0), "most": busy(100.0) },
        }));
    }
    output::line(&format!(
        "{} strokes, {} results, {} scans in {seconds:.0} s; {} connections, {} reads, {} writes, {} outside the allowed \
         registers",
        counts.strokes,
        counts.results,
        outcome.scans,
        counts.connections,
        counts.reads,
        counts.writes,
        counts.writes_outside
    ))?;
    let faults: Vec<_> = counts.line_faults.iter().map(|(name, count)| format!("{name} {count}")).collect();
    output::line(&format!("faults of the line (seed {}): {}", arguments.seed, faults.join(", ")))?;
    if let (Some(median), Some(p99), Some(most)) = (busy(50.0), busy(99.0), busy(100.0)) {
        let newest = Durations::KEPT.min(counts.results as usize);
        output::line(&format!(
            "trigger to busy on the press's clock, last {newest}: median {median:.0} ms, 99 % within {p99:.0} ms, most {most:.0} ms"
        ))?;
    }
    for sentence in &counts.wrong {
        output::line(sentence)?;
    }
    output::line(&format!(
        "wrong {}, doubled {}, silently lost {}; reported as missed {}, given up by the press {}",
        outcome.wrong(),
        outcome.doubled(),
        outcome.lost(),
        counts.missed_reported,
        counts.result_timeouts + counts.host_deaths
    ))
}
