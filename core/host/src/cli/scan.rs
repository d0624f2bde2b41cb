//! Command `platen scan`: writes one scan of the plant's scanner to a file.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use clap::Args;
use platen_plant::PlantFile;
use platen_scan::Window;

use super::{CliError, Common, output, scan_source};
use crate::progress;
use platen_engine::pipeline;
use platen_formats::{Format, ScanFile, WriteError, Written};

/// Longest scan: a full dome takes many minutes.
const SCAN_LIMIT: Duration = Duration::from_secs(7200);
/// Time for a scanner to connect.
const OPEN_LIMIT: Duration = Duration::from_secs(60);

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  platen scan config/plant-north.toml first.e57\n  \
                        platen scan config/plant-north.toml plate.e57 --window -40,80,-60,10")]
pub(super) struct Command {
    /// Plant file: which scanner, and how it is reached
    plant: PathBuf,
    /// New file; its ending selects the format: .e57, .ptx, .xyz or .xyb
    output: PathBuf,
    /// Scan only this part: first azimuth, width counter-clockwise, lowest and highest elevation, degrees
    #[arg(long, value_name = "AZ,WIDTH,LOW,HIGH", allow_hyphen_values = true, value_parser = window)]
    window: Option<Window>,
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    check_output(&command.output)?;
    let plant = PlantFile::load(&command.plant)?;
    let scanner = pipeline::scanner(&plant, &common.catalogue())?;
    progress::phase("connecting to the scanner");
    scanner.instance().open(OPEN_LIMIT)?;
    let (file, window) = (ScanFile::create(&command.output)?, command.window.as_ref());
    let written = scan_source::follow(&scanner, SCAN_LIMIT, window, "scanning", None)?.write(file)?;
    say(common, &command.output, &written)
}

fn window(text: &str) -> Result<Window, String> {
    let numbers: Vec<f64> = text.split(',').filter_map(|part| part.trim().parse().ok()).collect();
    let degrees: [f64; 4] =
        numbers.try_into().map_err(|_| "give four numbers, e.g. -40,80,-60,10".to_owned())?;
    let [azimuth_start, azimuth_width, elevation_min, elevation_max] = degrees.map(f64::to_radians);
    let sound = degrees.iter().all(|d| d.is_finite())
        && (0.0..=360.0).contains(&degrees[1])
        && degrees[1] > 0.0
        && -90.0 <= degrees[2]
        && degrees[2] < degrees[3]
        && degrees[3] <= 90.0;
    let window = Window { azimuth_start, azimuth_width, elevation_min, elevation_max };
    sound
        .then_some(window)
        .ok_or_else(|| "give a width of 0 to 360 and elevations from -90 up to 90".to_owned())
}

/// Refuses an output file that cannot be written, before a scan is read or acquired for it.
pub(super) fn check_output(path: &Path) -> Result<(), CliError> {
    Format::of(path)?;
    if path.exists() {
        return Err(WriteError::Exists(path.to_path_buf()).into());
    }
    Ok(())
}

pub(super) fn say(common: &Common, path: &Path, written: &Written) -> Result<ExitCode, CliError> {
    let Written { rows, columns, points, bytes } = *written;
    let megabytes = bytes as f64 / 1e6;
    let text = format!(
        "wrote {}: {rows} rows x {columns} columns, {points} valid cells, {megabytes:.1} MB",
        path.display()
    );
    let json = serde_json::json!({
        "file": path, "rows": rows, "columns": columns, "valid": points, "bytes": bytes,
    });
    output::either(common, &json, &text)?;
    Ok(ExitCode::SUCCESS)
}
