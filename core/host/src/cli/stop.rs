//! Command `platen stop`: ends a running host, at once or when no plate is being worked on.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Args;
use platen_plant::PlantFile;

use super::{CliError, Common, output};
use crate::run::{StopRequest, stop_request};

/// Longest time until a running host has accepted the request.
const LIMIT: Duration = Duration::from_secs(5);
/// Interval between checks of the request.
const LOOK: Duration = Duration::from_millis(20);

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  platen stop /etc/platen/press-3.toml --when-idle\n  platen stop config/plant-north.toml\n\n\
                        The host makes the registers of its press safe and ends with exit code 0; systemd starts it again with the program that is installed \
                        then. --when-idle waits for the end of the plate: the press's signal, or ten minutes without a stroke. Write access to the output folder is \
                        the permission."
)]
pub(super) struct Command {
    /// Plant file of the host
    plant: PathBuf,
    /// Only when no plate is in hand; the host remembers the request
    #[arg(long)]
    when_idle: bool,
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    let plant = PlantFile::load(&command.plant)?;
    let folder = &plant.output.folder;
    let request = stop_request(folder);
    let wanted = if command.when_idle { StopRequest::WhenIdle } else { StopRequest::AtOnce };
    let written = std::fs::create_dir_all(folder).and_then(|()| std::fs::write(&request, wanted.text()));
    written.map_err(|e| CliError::Failed(format!("{}: {e}", request.display())))?;
    let start = Instant::now();
    while request.exists() {
        if start.elapsed() > LIMIT {
            std::fs::remove_file(&request)?;
            return Err(CliError::Failed(format!(
                "no host runs with this plant file ({}): nothing to stop",
                folder.display()
            )));
        }
        std::thread::sleep(LOOK);
    }
    let text = match wanted {
        StopRequest::AtOnce => "the host is stopping",
        StopRequest::WhenIdle => "the host stops at the end of the plate in hand; `platen status` shows it",
    };
    output::either(common, &serde_json::json!({ "asked": true, "when_idle": command.when_idle }), text)?;
    Ok(ExitCode::SUCCESS)
}
