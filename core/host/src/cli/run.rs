//! Command `platen run`: serves a press until SIGTERM or Ctrl-C.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use platen_model::Verdict;
use platen_plant::PlantFile;

use super::{CliError, Common, output};
use crate::run::{self, HostError, Pages, StrokeReport};

use tokio::sync::{mpsc, watch};

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  platen check config/plant-north.toml && platen run config/plant-north.toml\n  \
                        PLATEN_LOG=info platen run config/plant-north.toml\n\n\
                        SIGTERM and Ctrl-C make the press's registers safe and end the host with exit code 0."
)]
pub(super) struct Command {
    /// Plant file
    plant: PathBuf,
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    let plant = PlantFile::load(&command.plant)?;
    let file = command.plant.display();
    let missing = || CliError::Usage(format!("{file}: has no [press]; add the one to serve"));
    let press = plant.press.clone().ok_or_else(missing)?;
    let pages = Pages::open(&plant).map_err(HostError::from)?;
    let json = common.json;
    if let Some(pages) = pages.as_ref().filter(|_| !json) {
        output::line(&format!("pages: {}", pages.address()))?;
    }
    runtime()?.block_on(async {
        let (reports, mut strokes) = mpsc::unbounded_channel();
        let printer = tokio::spawn(async move {
            while let Some(report) = strokes.recv().await {
                // A closed output must not stop the press.
                let _ = print(&report, json);
            }
        });
        let ended = run::run(&plant, press, &common.catalogue(), pages, stop_signal()?, reports).await;
        // The printer ends with the last sender.
        let _ = printer.await;
        ended.map_err(CliError::from)
    })?;
    Ok(ExitCode::SUCCESS)
}

/// Builds the runtime of the press side with two worker threads, so that polling does not wait for a scan.
///
/// # Errors
/// The system gives no threads.
pub fn runtime() -> Result<tokio::runtime::Runtime, CliError> {
    Ok(tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?)
}

/// Returns a signal that becomes true on SIGTERM and Ctrl-C.
///
/// # Errors
/// The signals cannot be caught.
pub fn stop_signal() -> Result<watch::Receiver<bool>, CliError> {
    use tokio::signal::unix::{SignalKind, signal};
    let (stop, stopped) = watch::channel(false);
    let mut terminate = signal(SignalKind::terminate())?;
    let mut interrupt = signal(SignalKind::interrupt())?;
    tokio::spawn(async move {
        tokio::select! {
            _ = terminate.recv() => {}
            _ = interrupt.recv() => {}
        }
        stop.send_replace(true);
        // Keeps the channel open until the host has ended.
        stop.closed().await;
    });
    Ok(stopped)
}

impl From<HostError> for CliError {
    fn from(error: HostError) -> Self {
        match error {
            HostError::Pipeline(error) => error.into(),
            other => Self::Failed(other.to_string()),
        }
    }
}

fn print(report: &StrokeReport, json: bool) -> Result<(), CliError> {
    if json {
        let (verdict, why) = match &report.result {
            Ok(record) => (record.verdict, None),
            Err(why) => (Verdict::NotMeasured, Some(why)),
        };
        return output::line(
            &serde_json::json!({
                "press": report.key.press, "session": report.key.session, "stroke": report.key.stroke,
                "attempt": report.key.attempt, "baseline": report.baseline, "verdict": verdict, "reason": why,
                "folder": report.folder, "elapsed_ms": report.elapsed.as_secs_f64() * 1000.0,
            })
            .to_string(),
        );
    }
    let text = match &report.result {
        Ok(record) => {
            format!("{}: {}", record.verdict.words(), record.says.first().map_or("", |s| s.as_str()))
        }
        Err(why) => format!("{}: {why}", Verdict::NotMeasured.words()),
    };
    let what = if report.baseline { "baseline" } else { "stroke" };
    output::line(&format!("{what} {} {text} ({:.1} s)", report.key.stroke, report.elapsed.as_secs_f64()))
}
