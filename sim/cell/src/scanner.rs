//! Command `scanner`: one scan of a plate into a file, or scans served over TCP.

use crate::error::Error;
use crate::scanner_options::ScannerOptions;
use crate::{bridge, press, toml_file};
use clap::Args;
use platen_sim_plate::{Plate, PlateState};
use platen_sim_scanner::{CellCounts, FileFormat, truth_document};
use std::path::{Path, PathBuf};

/// Options of the command `scanner`.
#[derive(Debug, Args)]
pub(crate) struct Command {
    /// Read the plate (blank, shape, pose) from this TOML file
    plate: Option<PathBuf>,
    /// Write one scan to this file: .e57, .ptx, .xyz or .xyb
    #[arg(long, requires = "plate", required_unless_present = "serve", conflicts_with = "serve")]
    out: Option<PathBuf>,
    /// Write the ground truth of the scan to this file, as JSON
    #[arg(long, requires = "out")]
    truth: Option<PathBuf>,
    #[command(flatten)]
    serve: bridge::BridgeOptions,
    /// Scan the plate of the simulated press with this control port
    #[arg(long, value_name = "ADDRESS", requires = "serve", conflicts_with = "plate")]
    press: Option<String>,
    /// End when standard input closes
    #[arg(long, requires = "serve")]
    with_parent: bool,
    #[command(flatten)]
    device: ScannerOptions,
}

/// Scans once into a file, or serves scans until a stop is requested.
pub(crate) async fn run(command: &Command) -> Result<(), Error> {
    match (&command.plate, &command.out) {
        (Some(plate), Some(out)) => write(command, plate, out),
        _ => serve(command).await,
    }
}

fn read(path: &Path) -> Result<PlateState, Error> {
    let state: PlateState = toml_file::read(path)?;
    Plate::new(&state).map_err(|source| Error::Plate { path: path.into(), source })?;
    Ok(state)
}

async fn serve(command: &Command) -> Result<(), Error> {
    let plate = match &command.press {
        Some(press) => bridge::plate_of_press(press.clone()),
        None => bridge::fixed_plate(command.plate.as_deref().map(read).transpose()?),
    };
    if let Some(bridge) = command.serve.start(&command.device, plate)? {
        press::announce(None, Some(bridge.address()))?;
        press::stop_requested(command.with_parent).await?;
        bridge::print_counters(&bridge)?;
    }
    Ok(())
}

fn write(command: &Command, plate: &Path, out: &Path) -> Result<(), Error> {
    if FileFormat::of(out).is_none() {
        return Err(Error::Format { path: out.into() });
    }
    let state = read(plate)?;
    let impossible = |source| Error::Plate { path: plate.into(), source };
    let capture = command.device.capture(Some(&state), 0).map_err(impossible)?;
    capture.write(out)?;
    if let Some(path) = &command.truth {
        let mut counts = CellCounts::default();
        capture.scan.columns.iter().for_each(|column| counts.add(column));
        let truth = truth_document(&state, &capture.scene, &counts);
        std::fs::write(path, format!("{truth:#}\n"))?;
    }
    Ok(())
}
