//! Command `platen status`: the state of a running host, from the status file in its output folder.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use platen_plant::PlantFile;

use super::{CliError, Common, output};
use crate::run::{ForwardRecord, StatusRecord};

/// Age of the status above which the host does not run, or hangs, seconds.
const STALE_S: f64 = 5.0;

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  platen status config/plant-north.toml\n  \
                        platen status config/plant-north.toml --prometheus > /var/lib/node_exporter/platen.prom\n\n\
                        The exit code is 0 when the host runs, 1 when it does not.")]
pub(super) struct Command {
    /// Plant file of the host
    plant: PathBuf,
    /// Print the figures in the Prometheus text format, for a textfile collector
    #[arg(long, conflicts_with = "json")]
    prometheus: bool,
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    let plant = PlantFile::load(&command.plant)?;
    let folder = &plant.output.folder;
    let status = StatusRecord::load(folder).map_err(|e| {
        CliError::Failed(format!("no host has run with this plant file ({}: {e})", folder.display()))
    })?;
    let age_s = jiff::Timestamp::now().duration_since(status.at).as_secs_f64();
    // Negative right after the clock was set back.
    let running = age_s.abs() < STALE_S;
    if command.prometheus {
        output::line(status.prometheus(running).trim_end())?;
    } else if common.json {
        output::json(&serde_json::json!({ "running": running, "age_s": age_s, "status": status }))?;
    } else {
        let alive = if running { "running" } else { "not running" };
        output::line(&format!(
            "{}: host {alive} (pid {}, status {age_s:.0} s old), {}",
            status.press, status.pid, status.state
        ))?;
        if let Some(pages) = &status.pages {
            output::line(&format!("pages: {pages}"))?;
        }
        for (what, text) in
            [("link", &status.link_error), ("error", &status.error), ("warning", &status.warning)]
        {
            if let Some(text) = text {
                output::line(&format!("{what}: {text}"))?;
            }
        }
        if let Some(clock) = &status.clock {
            output::line(&format!("clock: {}", clock.words()))?;
        }
        if status.restart_pending {
            output::line("restart pending: the program was replaced; `platen stop --when-idle`")?;
        }
        if status.stop_asked {
            output::line("stops at the end of the plate in hand, as asked")?;
        }
        if let Some((at, text)) = &status.alarm {
            output::line(&format!("newest alarm, {at:.0}: {text}"))?;
        }
        output::line(&format!(
            "strokes {}, measured {}, not measured {}, missed {}",
            status.strokes, status.measured, status.not_measured, status.missed
        ))?;
        output::line(&format!(
            "link: {} connections, {} dropped for an error, out of step for {:.1} s",
            status.link.connections, status.link.poisoned, status.link_down_s
        ))?;
        if let Some(waits_s) = status.result_waits_s {
            output::line(&format!("a result has waited {waits_s:.0} s for the press"))?;
        }
        let free = status.disk_free.map(|bytes| format!("{:.1} GB free, ", bytes as f64 / 1e9));
        output::line(&format!(
            "disk: {}{} records could not be written",
            free.unwrap_or_default(),
            status.records_lost
        ))?;
        // Read now: the forwarder also runs without the host.
        let forward = plant.forward.as_ref().map(|_| ForwardRecord::load(folder));
        for (name, line) in forward.iter().flat_map(ForwardRecord::lines) {
            output::line(&format!("{name}: {line}"))?;
        }
        for plugin in &status.plugins {
            output::line(&format!("{} {}: {}", plugin.kind, plugin.plugin, plugin.line()))?;
        }
        for (what, [median, worst]) in [
            ("trigger to busy", status.trigger_to_busy_ms),
            ("stroke to result", status.stroke_to_result_ms),
            ("result to acknowledge", status.result_to_ack_ms),
            ("journal", status.journal_ms),
        ] {
            if let (Some(median), Some(worst)) = (median, worst) {
                output::line(&format!("{what}: median {median:.0} ms, 99 % within {worst:.0} ms"))?;
            }
        }
    }
    Ok(ExitCode::from(u8::from(!running)))
}
