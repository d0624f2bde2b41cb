//! Command `cell`: a press and a scanner on one plate.
//!
//! The scanner serves scans over TCP, or writes a file into a folder at each stroke, as an export script of a real
//! scanner does.
//!
//! Files: the scanner starts when the host has accepted a stroke and the plate is at rest. The file is named
//! `SESSION-STROKE-ATTEMPT.e57` and appears complete, except for a late one (`--late-file`). The scanner communicates
//! with the press only through its control port.

use crate::bridge;
use crate::control_client::{ControlClient, PendingStroke};
use crate::error::Error;
use crate::press;
use crate::scanner_options::ScannerOptions;
use clap::Args;
use platen_sim_press::SimPress;
use platen_sim_scanner::FileFormat;
use platen_sim_scanner::stream::Bridge;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Delay of a late file, and then the time during which only its first half exists.
const LATE: Duration = Duration::from_millis(750);

/// Interval of polling the press.
const LOOK: Duration = Duration::from_millis(20);

/// Options of the command `cell`.
#[derive(Debug, Args)]
pub(crate) struct Command {
    #[command(flatten)]
    press: press::Command,
    /// Write a scan file into this folder at each accepted stroke
    #[arg(long, value_name = "FOLDER", required_unless_present = "serve")]
    drop: Option<PathBuf>,
    /// Write the file of this stroke late and in two halves, as on a slow network share
    #[arg(long, value_name = "STROKE", requires = "drop")]
    late_file: Option<u16>,
    /// Set the format of the files: e57, ptx, xyz or xyb
    #[arg(long, default_value = "e57")]
    format: String,
    #[command(flatten)]
    device: ScannerOptions,
    #[command(flatten)]
    serve: bridge::BridgeOptions,
}

/// Runs press and scanner until the press is stopped.
pub(crate) async fn run(command: Command) -> Result<(), Error> {
    let example = PathBuf::from(format!("scan.{}", command.format));
    if FileFormat::of(&example).is_none() {
        return Err(Error::Format { path: example });
    }
    let press = press::start(&command.press).await?;
    let control = press.control().to_string();
    let bridge = command.serve.start(&command.device, bridge::plate_of_press(control.clone()))?;
    // Before the announcement, so that the folder exists when the ports are printed.
    command.drop.as_ref().map_or(Ok(()), std::fs::create_dir_all)?;
    press::announce(Some(&press), bridge.as_ref().map(Bridge::address))?;
    match command.drop {
        Some(drop) => {
            let ending = Arc::new(AtomicBool::new(false));
            let (format, device) = (command.format, command.device);
            let (address, late_file, ending_too) = (control, command.late_file, Arc::clone(&ending));
            let scanner = Scanner { address, drop, late_file, format, device, ending: ending_too };
            run_with_file_drop(press, &command.press, scanner, &ending).await?;
        }
        None => press::run_until_stopped(press, &command.press).await?,
    }
    bridge.as_ref().map_or(Ok(()), bridge::print_counters)
}

/// Runs the press beside a scanner that writes files.
async fn run_with_file_drop(
    press: SimPress,
    command: &press::Command,
    scanner: Scanner,
    ending: &AtomicBool,
) -> Result<(), Error> {
    let mut scans = tokio::task::spawn_blocking(move || scanner.run());
    tokio::select! {
        ended = press::run_until_stopped(press, command) => {
            ending.store(true, Ordering::Relaxed);
            // The scanner loses its connection when the press ends; that is no failure here.
            let _ = scans.await;
            ended
        }
        failed = &mut scans => failed.map_err(std::io::Error::other)?,
    }
}

struct Scanner {
    address: String,
    drop: PathBuf,
    late_file: Option<u16>,
    format: String,
    device: ScannerOptions,
    ending: Arc<AtomicBool>,
}

impl Scanner {
    fn run(&self) -> Result<(), Error> {
        let mut line = ControlClient::open(&self.address)?;
        let mut last: Option<PendingStroke> = None;
        let mut number = 0;
        while !self.ending.load(Ordering::Relaxed) {
            match line.pending()? {
                Some(pending) if last != Some(pending) => {
                    number += 1;
                    self.scan(&mut line, pending, number)?;
                    last = Some(pending);
                }
                _ => std::thread::sleep(LOOK),
            }
        }
        Ok(())
    }

    fn scan(&self, line: &mut ControlClient, pending: PendingStroke, number: u64) -> Result<(), Error> {
        let state = line.plate()?;
        let PendingStroke { session, stroke, attempt } = pending;
        let path = self.drop.join(format!("{session:05}-{stroke:05}-{attempt}.{}", self.format));
        let capture = self.device.capture(state.as_ref(), number).map_err(platen_sim_press::Error::from)?;
        if self.late_file == Some(stroke) {
            let hidden = self.drop.join(format!(".late.{}", self.format));
            capture.write(&hidden)?;
            write_in_halves(&path, &std::fs::read(&hidden)?)?;
            std::fs::remove_file(hidden)?;
        } else {
            capture.write(&path)?;
        }
        tracing::info!(path = %path.display(), "scan file written");
        Ok(())
    }
}

/// Writes a file with a delay and in two halves.
fn write_in_halves(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let (first, second) = bytes.split_at(bytes.len() / 2);
    std::thread::sleep(LATE);
    let mut file = std::fs::File::create_new(path)?;
    file.write_all(first)?;
    std::thread::sleep(LATE);
    file.write_all(second)
}
