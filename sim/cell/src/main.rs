//! Program `platen-sim`: a simulated press, a simulated scanner, or both on one plate, for tests of hosts over real
//! sockets and files.
//!
//! - `platen-sim press` serves Modbus and the plate's shape on loopback.
//! - `platen-sim scanner PLATE.toml --out scan.e57` scans a described plate into a file, with the ground truth beside
//!   it.
//! - `platen-sim scanner PLATE.toml --serve 127.0.0.1:7040` serves scans of it by the scan bridge protocol.
//! - `platen-sim cell --serve 127.0.0.1:7040` runs a press with such a scanner beside it.
//! - `platen-sim cell --drop FOLDER` runs a press whose scanner writes a file into a folder at each accepted stroke.
//!
//! A server prints one line when its ports are open: `{"modbus":"127.0.0.1:5020","plate":"127.0.0.1:5021"}`, with
//! `"scanner"` where scans are served. At the end it prints the counters of the bridge. It ends on SIGTERM, Ctrl-C, the
//! command `stop` of the control port and, with `--with-parent`, when its standard input closes. Results go to stdout,
//! the log to stderr (`PLATEN_LOG`). Exit codes: 0 success, 1 failure, 2 invalid usage or file.

mod bridge;
mod cell;
mod control_client;
mod error;
mod press;
mod scanner;
mod scanner_options;
mod toml_file;

use clap::{Parser, Subcommand};
use std::process::ExitCode;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::prelude::*;

const EXAMPLES: &str = "\
Examples:
  platen-sim press --modbus-port 5020 --plate-port 5021
  platen-sim scanner plate.toml --out scan.e57 --truth truth.json
  platen-sim scanner plate.toml --serve 127.0.0.1:7040 --fault drop-mid-scan=17
  platen-sim cell config/sim-press.toml --serve 127.0.0.1:7040
  platen-sim cell --strokes 3 --drop scans";

/// Simulate a plate press, a terrestrial laser scanner, or both on one plate
#[derive(Debug, Parser)]
#[command(version, arg_required_else_help = true, after_help = EXAMPLES)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Serve a press on Modbus that bends a simulated plate at each stroke
    Press(press::Command),
    /// Cast one scan of a plate into a file, or serve scans by the scan bridge protocol
    Scanner(scanner::Command),
    /// Serve a press, and scans of its plate over TCP or as files in a folder
    Cell(cell::Command),
}

#[tokio::main]
async fn main() -> ExitCode {
    let filter = std::env::var("PLATEN_LOG")
        .ok()
        .filter(|filter| !filter.is_empty())
        .and_then(|filter| filter.parse::<Targets>().ok());
    let filter = filter.unwrap_or_else(|| Targets::new().with_default(LevelFilter::WARN));
    let lines = tracing_subscriber::fmt::layer().with_writer(std::io::stderr);
    tracing_subscriber::registry().with(lines.with_filter(filter)).init();
    let ended = match Cli::parse().verb {
        Verb::Press(command) => press::run(&command).await,
        Verb::Scanner(command) => scanner::run(&command).await,
        Verb::Cell(command) => cell::run(command).await,
    };
    match ended {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("platen-sim: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}
