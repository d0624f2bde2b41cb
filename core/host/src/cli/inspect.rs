//! `platen inspect`: what is in a scan file, and how it was oriented.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::Args;
use platen_scan::{ScanHeader, State};

use super::{CliError, Common, measure, output};
use crate::plugin::{JobSpec, ScanEvent};

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  platen inspect scan.e57")]
pub(super) struct Command {
    /// Scan file
    scan: PathBuf,
}

/// What was counted while the columns came by.
#[derive(Debug, Default)]
struct Counts {
    columns: u32,
    valid: u64,
    direction_only: u64,
    nearest_m: f32,
    farthest_m: f32,
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    let scanner = measure::open_file(&common.catalogue(), &command.scan)?;
    let mut header = ScanHeader::default();
    let mut counts = Counts { nearest_m: f32::INFINITY, ..Counts::default() };
    let job = JobSpec::untriggered(Duration::from_secs(600));
    let end = scanner.scan(job, None, &mut |event| {
        match event {
            ScanEvent::Begin(begun) => header = begun,
            ScanEvent::Column(column) => {
                counts.columns += 1;
                for (state, range) in column.state.iter().zip(&column.range_m) {
                    match state {
                        State::Valid => {
                            counts.valid += 1;
                            counts.nearest_m = counts.nearest_m.min(*range);
                            counts.farthest_m = counts.farthest_m.max(*range);
                        }
                        State::DirectionOnly => counts.direction_only += 1,
                        State::NoReturn => {}
                    }
                }
            }
        }
        ControlFlow::Continue(())
    });
    end.map_err(|e| CliError::Failed(format!("{}: {e}", command.scan.display())))?;
    if common.json {
        output::json(&json(&header, &counts))?;
    } else {
        print(&header, &counts)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn json(header: &ScanHeader, counts: &Counts) -> serde_json::Value {
    serde_json::json!({
        "rows": header.n_rows, "columns": header.n_columns, "columns_sent": counts.columns,
        "valid": counts.valid, "direction_only": counts.direction_only,
        "azimuth_start_deg": header.azimuth_start.to_degrees(), "azimuth_step_deg": header.azimuth_step.to_degrees(),
        "elevation_start_deg": header.elevation_start.to_degrees(), "elevation_step_deg": header.elevation_step.to_degrees(),
        "seam_column": header.seam_column, "intensity": header.intensity_range, "instrument": header.instrument,
        "acquired_unix_s": header.acquired_unix_s, "simulated": header.simulated, "notes": header.notes,
        "range_m": (counts.valid > 0).then_some([counts.nearest_m, counts.farthest_m]),
    })
}

fn print(header: &ScanHeader, counts: &Counts) -> Result<(), CliError> {
    let cells = u64::from(header.n_rows) * u64::from(header.n_columns);
    let share = counts.valid as f64 / cells.max(1) as f64 * 100.0;
    output::line(&format!(
        "{} rows x {} columns, {} valid cells ({share:.0} %), range {:.2} to {:.2} m",
        header.n_rows, header.n_columns, counts.valid, counts.nearest_m, counts.farthest_m
    ))?;
    output::line(&format!(
        "columns from azimuth {:+.3} deg every {:.4} deg, rows from elevation {:+.3} deg down every {:.4} deg",
        header.azimuth_start.to_degrees(),
        header.azimuth_step.to_degrees(),
        header.elevation_start.to_degrees(),
        header.elevation_step.to_degrees()
    ))?;
    if !header.instrument.is_empty() {
        output::line(&format!("instrument: {}", header.instrument))?;
    }
    for note in &header.notes {
        output::line(&format!("  {note}"))?;
    }
    Ok(())
}
