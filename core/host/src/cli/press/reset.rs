//! Command `reset`: clears the latched faults of a running host.

use std::process::ExitCode;
use std::time::{Duration, Instant};

use platen_plant::PlantFile;

use super::{CliError, Common, Failure, output};
use crate::run::{StatusRecord, reset_request};

/// Longest wait for the host, which checks for requests once a second.
const LIMIT: Duration = Duration::from_secs(5);
/// Interval between checks for its answer.
const LOOK: Duration = Duration::from_millis(50);

/// Requests a reset; exit code 0 if the host carried it out and reports no fault.
pub(super) fn run(common: &Common, plant: &PlantFile) -> Result<ExitCode, Failure> {
    let folder = &plant.output.folder;
    let request = reset_request(folder);
    let asked = jiff::Timestamp::now();
    std::fs::create_dir_all(folder)?;
    std::fs::write(&request, b"")?;
    let start = Instant::now();
    while request.exists() {
        if start.elapsed() > LIMIT {
            std::fs::remove_file(&request)?;
            let text = format!("no host runs with this plant file ({}): nothing to reset", folder.display());
            return Err(CliError::Failed(text).into());
        }
        std::thread::sleep(LOOK);
    }
    // The host writes its status again once it has carried out the request.
    let status = loop {
        let status = StatusRecord::load(folder)?;
        if status.reset_at.is_some_and(|at| at >= asked) {
            break status;
        }
        if start.elapsed() > 2 * LIMIT {
            let text = "the host took the request and has not written its status since; see its log";
            return Err(CliError::Failed(text.into()).into());
        }
        std::thread::sleep(LOOK);
    };
    let wrong = [&status.link_error, &status.error, &status.warning];
    if common.json {
        output::json(&serde_json::json!({ "reset": true, "status": status }))?;
    } else {
        output::line(&format!("{}: reset, now {}", status.press, status.state))?;
        for text in wrong.into_iter().flatten() {
            output::line(&format!("still: {text}"))?;
        }
    }
    Ok(ExitCode::from(u8::from(wrong.into_iter().any(Option::is_some))))
}
