//! Program `platen-sim`: a simulated press, a simulated scanner, or both on one plate, for hosts to be tried out and
//! tested on over real sockets and real files.
//!
//! - `platen-sim press` serves Modbus and the plate's shape on loopback.
//! - `platen-sim scanner PLATE.toml --out scan.e57` scans a described plate into a file, with the truth beside it.
//! - `platen-sim scanner PLATE.toml --serve 127.0.0.1:7040` serves scans of it by the scan bridge protocol.
//! - `platen-sim cell --serve 127.0.0.1:7040` is a press with such a scanner beside it.
//! - `platen-sim cell --drop FOLDER` is a press whose scanner drops a file into a folder at each accepted stroke.
//!
//! Who serves prints one line when the ports answer: `{"modbus":"127.0.0.1:5020","plate":"127.0.0.1:5021"}`, with
//! `"scanner"` where scans are served, and at the end what the bridge has done.
//! They end on SIGTERM, on Ctrl-C, when told to over the second port and, with `--with-parent`, when their standard
//! input closes. Results go to stdout, the log to stderr (`PLATEN_LOG`); exit codes: 0 done, 1 failed, 2 bad usage or
//! file.

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
use tracing_subscriber::EnvFilter;

/// Simulated press and scanner.
#[derive(Debug, Parser)]
#[command(version, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// A press on Modbus that bends a simulated plate at each stroke
    Press(press::Command),
    /// Scans a simulated plate into a file, or serves scans over TCP
    Scanner(scanner::Command),
    /// A press with a scanner that serves scans over TCP or drops them into a folder
    Cell(cell::Command),
}

#[tokio::main]
async fn main() -> ExitCode {
    let filter = EnvFilter::try_from_env("PLATEN_LOG").unwrap_or_else(|_| EnvFilter::new("warn"));
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).init();
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
