//! Program `platen-sim`: a simulated press, for hosts to be tried out and tested on over real sockets.
//!
//! `platen-sim press` serves Modbus and the plate's shape on loopback and prints one line when both ports answer:
//! `{"modbus":"127.0.0.1:5020","plate":"127.0.0.1:5021"}`. It ends on SIGTERM, on Ctrl-C, when told to over its
//! second port and, with `--with-parent`, when its standard input closes.
//!
//! Results go to stdout, the log to stderr (`PLATEN_LOG`); exit codes: 0 done, 1 failed, 2 bad usage or file.

mod error;
mod press;

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
}

#[tokio::main]
async fn main() -> ExitCode {
    let filter = EnvFilter::try_from_env("PLATEN_LOG").unwrap_or_else(|_| EnvFilter::new("warn"));
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).init();
    let ended = match Cli::parse().verb {
        Verb::Press(command) => press::run(&command).await,
    };
    match ended {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("platen-sim: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}
