//! Command `platen demo`: a simulated press bends a plate and the host measures it, over real sockets and plugin
//! libraries.

mod files;
mod operator;

use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Args;
use platen_model::Verdict;
use platen_plant::{PlantFile, Screen};

use operator::Operator;

use super::cell::{AcceptedResult, Cell};
use super::run::{runtime, stop_signal};
use super::{CliError, Common, output};
use crate::progress;
use crate::run::{self, HostError, Pages, StrokeReport};

use tokio::sync::{mpsc, watch};

/// Longest time of a demo that is not stuck.
const LIMIT: Duration = Duration::from_secs(1800);
/// Most strokes of the demo, of `config/sim-press.toml`, with the blank.
const MOST_STROKES: u32 = 15;

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  platen demo\n  platen demo --screen --pace 20\n  platen demo --advice --screen\n\n\
                        Only steel and light are simulated: platen-sim bends the plate and serves Modbus, the simulated scanner casts rays, \
                        the host measures with the plugin libraries beside the program and writes the results to the press."
)]
pub(super) struct Command {
    /// Folder for the results; an earlier demo there is replaced
    #[arg(long, value_name = "DIR", default_value = "platen-demo")]
    out: PathBuf,
    /// Serve the browser pages during the demo, on this address, and stay until Ctrl-C
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, default_missing_value = "127.0.0.1:8380")]
    screen: Option<SocketAddr>,
    /// Pause between two strokes, as in a shop: seconds
    #[arg(long, value_name = "S", value_parser = clap::value_parser!(u32).range(0..=3600))]
    pace: Option<u32>,
    /// Advise each stroke; the press is driven to ordered depths, its steel is hidden, and its operator follows the advice or ignores it
    #[arg(long, value_name = "OPERATOR", num_args = 0..=1, default_missing_value = "follow")]
    advice: Option<Operator>,
    /// Seed of the hidden steel and of the operator's and the ram's scatter, with --advice
    #[arg(long, default_value_t = 1, requires = "advice")]
    seed: u64,
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    let start = Instant::now();
    files::prepare(&command.out)?;
    let press_file = files::press_file(&command.out, command.pace, command.advice, command.seed)?;
    let mut cell = Cell::start(&press_file, &["--modbus-port", "0"])?;
    let Some(modbus) = cell.modbus else {
        return Err(CliError::Failed("the demo's press serves no Modbus TCP".into()));
    };
    let plant_file = files::plant_file(&command.out, modbus, cell.plate, command.advice)?;
    let mut plant = PlantFile::load(&plant_file)?;
    plant.screen = command.screen.map(Screen::on);
    let pages = Pages::open(&plant).map_err(HostError::from)?;
    let Some(press) = plant.press.clone() else {
        return Err(CliError::Failed("the demo's plant file has no [press]".into()));
    };
    if !common.json {
        output::line(&format!("simulated press on {modbus}, plate on {}", cell.plate))?;
        if let Some(pages) = &pages {
            output::line(&format!("pages: {}", pages.address()))?;
        }
    }
    let mut reports = Vec::new();
    let (ended, registers) = runtime()?.block_on(async {
        let (sender, mut strokes) = mpsc::unbounded_channel();
        let (stop, stopped) = watch::channel(false);
        let mut interrupted = stop_signal()?;
        let catalogue = common.catalogue();
        let host = run::run(&plant, press, &catalogue, pages, stopped, sender);
        tokio::pin!(host);
        let most = if command.advice.is_some() { operator::MOST_ADVISED + 1 } else { MOST_STROKES };
        let pauses = Duration::from_secs(u64::from(command.pace.unwrap_or(0))) * most;
        let limit = tokio::time::sleep(LIMIT + pauses);
        tokio::pin!(limit);
        let mut look = tokio::time::interval(Duration::from_millis(100));
        loop {
            tokio::select! {
                ended = &mut host => return Ok::<_, CliError>((ended, None)),
                Some(report) = strokes.recv() => {
                    progress(&report);
                    if let (Some(operator), Ok(record), Some(folder)) = (command.advice, &report.result, &report.folder) {
                        let strokes = reports.iter().filter(|earlier: &&StrokeReport| !earlier.baseline).count();
                        let made = u32::try_from(strokes).unwrap_or(u32::MAX) + u32::from(!report.baseline);
                        tokio::task::block_in_place(|| operator.order(&mut cell, record, folder, made))?;
                    }
                    reports.push(report);
                }
                _ = look.tick() => if cell.is_done()? { break },
                _ = interrupted.changed() => break,
                () = &mut limit => return Err(CliError::Failed(format!("the demo has not ended after {} s", LIMIT.as_secs()))),
            }
        }
        if command.screen.is_some() && !*interrupted.borrow() {
            progress::phase("the demo has ended; its pages stay until Ctrl-C");
            tokio::select! {
                ended = &mut host => return Ok((ended, None)),
                _ = interrupted.changed() => {}
            }
        }
        let registers = cell.registers()?;
        stop.send_replace(true);
        let ended = host.await;
        // The press may receive its last result before the report on it is written, as on a slow computer.
        while let Ok(report) = strokes.try_recv() {
            reports.push(report);
        }
        Ok((ended, Some(registers)))
    })?;
    ended?;
    progress::done();
    let accepted = cell.accepted_results()?;
    let after_stop = cell.registers()?;
    summary(common, command, &reports, &accepted, registers, after_stop, start.elapsed())
}

fn progress(report: &StrokeReport) {
    let what = if report.baseline { "baseline".to_owned() } else { format!("stroke {}", report.key.stroke) };
    let text = match &report.result {
        Ok(record) => record.verdict.words().to_owned(),
        Err(why) => why.clone(),
    };
    progress::phase(&format!("{what}: {text}; the press bends"));
}

/// Returns the largest gap under a template and its uncertainty, millimetres.
fn gap_mm(report: &StrokeReport) -> Option<(f64, f64)> {
    let record = report.result.as_ref().ok()?;
    let templates = record.reference_lines.iter().flat_map(|line| &line.templates);
    templates.map(|t| (t.max_gap_mm, t.uncertainty_mm)).max_by(|a, b| a.0.total_cmp(&b.0))
}

fn summary(
    common: &Common,
    command: &Command,
    reports: &[StrokeReport],
    accepted: &[AcceptedResult],
    registers: Option<Vec<u16>>,
    after_stop: Vec<u16>,
    elapsed: Duration,
) -> Result<ExitCode, CliError> {
    let mut rows = Vec::new();
    let mut documents = Vec::new();
    let mut before = None;
    for report in reports {
        let timed = accepted.iter().find(|t| t.is(report.key.stroke, report.key.session, report.key.attempt));
        let gap = gap_mm(report);
        let length =
            |gap: Option<(f64, f64)>| gap.map(|(g, u)| format!("{g:.2} +- {u:.2}")).unwrap_or_default();
        let record = report.result.as_ref().ok();
        let scan_ms = record.map(|r| r.timings_ms.acquire + r.timings_ms.extract);
        let evaluation_ms = record.map(|r| r.timings_ms.total - r.timings_ms.extract);
        let verdict = record.map_or(Verdict::NotMeasured, |r| r.verdict).words();
        rows.push(vec![
            if report.baseline { "blank".to_owned() } else { report.key.stroke.to_string() },
            output::number(timed.map(|t| t.accepted_ms), 0),
            output::number(scan_ms, 0),
            output::number(evaluation_ms, 0),
            output::number(timed.map(|t| t.result_ms), 0),
            length(before),
            length(gap),
            verdict.to_owned(),
        ]);
        documents.push(serde_json::json!({
            "stroke": report.key.stroke, "baseline": report.baseline, "verdict": verdict,
            "trigger_to_busy_ms": timed.map(|t| t.accepted_ms), "scan_ms": scan_ms, "evaluation_ms": evaluation_ms,
            "stroke_to_result_ms": timed.map(|t| t.result_ms),
            "gap_before_mm": before.map(|(g, _)| g), "gap_after_mm": gap.map(|(g, _)| g), "folder": report.folder,
        }));
        before = gap.or(before);
    }
    let passed =
        reports.last().and_then(|r| r.result.as_ref().ok()).is_some_and(|r| r.verdict == Verdict::Pass);
    // The commit word and its copy at the end of the block agree and identify the last stroke: result_seq,
    // result_seq_tail, result_stroke_id.
    let correct = registers
        .as_deref()
        .zip(reports.last())
        .is_some_and(|(h, last)| h.get(8) == h.get(53) && h.get(4) == Some(&last.key.stroke));
    let elapsed_s = elapsed.as_secs_f64();
    let safe = after_stop.get(2) == Some(&0);
    if common.json {
        output::json(&serde_json::json!({
            "strokes": documents, "bent": passed, "registers_correct": correct, "registers_safe": safe,
            "elapsed_s": elapsed_s, "folder": command.out,
        }))?;
    } else {
        output::titled(
            "stroke | trigger to busy ms | scan ms | evaluation ms | stroke to result ms | gap before mm | gap after mm | verdict",
            rows,
        )?;
        let plate = if passed { "the plate is in tolerance" } else { "the plate is not in tolerance" };
        let held = if correct { "the last stroke's" } else { "a wrong" };
        let after = if safe { "safe after the stop" } else { "not safe after the stop" };
        output::line(&format!(
            "{plate}; the press holds {held} result; its registers are {after}; {elapsed_s:.1} s"
        ))?;
        output::line(&format!(
            "files: {} (the plate's report plate-1.html; one folder a stroke: result.json, tables, mesh, pictures; history.sqlite)",
            command.out.join("results").display()
        ))?;
        let verb = if command.advice.is_some() { "advice" } else { "list" };
        output::line(&format!("next: platen history {verb} {}", command.out.join("plant.toml").display()))?;
    }
    Ok(ExitCode::from(u8::from(!(passed && correct && safe))))
}
