//! The command line: one module for each verb. Results go to stdout, the log to stderr.

mod bench;
mod calibrate;
pub mod cell;
mod check;
mod convert;
mod demo;
mod history;
mod inspect;
mod measure;
pub mod output;
mod plugins;
pub mod press;
pub mod run;
mod scan;
mod scan_source;
mod setup;
mod status;
mod verify;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand};

use crate::scan_file::ScanFileError;
use platen_engine::pipeline::PipelineError;
use platen_engine::plugin::{Catalogue, PluginError};
use platen_report::output_folder::FilesError;

/// Measures plates on a press, stroke by stroke.
#[derive(Debug, Parser)]
#[command(
    version,
    arg_required_else_help = true,
    after_help = "Exit codes: 0 done, 1 failed, 2 bad usage or plant file.\n\
                  PLATEN_LOG sets what is logged, e.g. PLATEN_LOG=debug or PLATEN_LOG=platen_press=trace."
)]
struct Cli {
    #[command(flatten)]
    common: Common,
    #[command(subcommand)]
    verb: Verb,
}

/// What every verb takes.
#[derive(Debug, Clone, Args)]
pub struct Common {
    /// Folder to look for plugins in first
    #[arg(long, global = true, value_name = "DIR")]
    pub plugins: Option<PathBuf>,
    /// Print the result as JSON
    #[arg(long, global = true)]
    pub json: bool,
}

impl Common {
    /// Where plugins are looked for.
    pub fn catalogue(&self) -> Catalogue {
        Catalogue::new(self.plugins.as_deref())
    }
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// A simulated press and scanner on loopback: strokes until the plate is bent
    Demo(demo::Command),
    /// Serve a press: scan, measure and answer after each stroke
    Run(run::Command),
    /// Measure a plate in one scan file
    Measure(measure::Command),
    /// One scan of the plant's scanner to a file
    Scan(scan::Command),
    /// A scan file in another format
    Convert(convert::Command),
    /// What a scanner's errors are beyond noise, from scans of a plate left alone
    Calibrate(calibrate::Command),
    /// Painted markers in a scan against the virtual ones
    Verify(verify::Command),
    /// What is in a scan file, and how it was oriented
    Inspect(inspect::Command),
    /// Check plant and plate files, all faults at once
    Check(check::Command),
    /// The register map in force, and what stands in the registers
    Press(press::Command),
    /// How a running host stands
    Status(status::Command),
    /// What is on record
    History(history::Command),
    /// What plugins are installed, and their options
    Plugins(plugins::Command),
    /// Print the tables of Masuda et al. beside this machine's figures, on simulated scans
    #[command(disable_help_flag = true)]
    Bench(bench::Arguments),
}

/// Why a verb ended without its result.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// The user or the plant file is to be corrected: exit 2.
    #[error("{0}")]
    Usage(String),
    /// Something failed: exit 1.
    #[error("{0}")]
    Failed(String),
}

impl From<PluginError> for CliError {
    fn from(error: PluginError) -> Self {
        Self::Failed(error.to_string())
    }
}

impl From<platen_plant::Error> for CliError {
    fn from(error: platen_plant::Error) -> Self {
        Self::Usage(error.to_string())
    }
}

impl From<PipelineError> for CliError {
    fn from(error: PipelineError) -> Self {
        match error {
            PipelineError::Plugin(error) => error.into(),
            wrong => Self::Usage(wrong.to_string()),
        }
    }
}

impl From<ScanFileError> for CliError {
    fn from(error: ScanFileError) -> Self {
        match error {
            ScanFileError::Format(_) | ScanFileError::Exists(_) => Self::Usage(error.to_string()),
            failed => Self::Failed(failed.to_string()),
        }
    }
}

impl From<FilesError> for CliError {
    fn from(error: FilesError) -> Self {
        Self::Failed(error.to_string())
    }
}

impl From<std::io::Error> for CliError {
    fn from(error: std::io::Error) -> Self {
        Self::Failed(error.to_string())
    }
}

/// Runs the command line.
pub fn main() -> ExitCode {
    run_program::<Cli>(|cli| match &cli.verb {
        Verb::Demo(command) => demo::run(&cli.common, command),
        Verb::Run(command) => run::run(&cli.common, command),
        Verb::Scan(command) => scan::run(&cli.common, command),
        Verb::Convert(command) => convert::run(&cli.common, command),
        Verb::Inspect(command) => inspect::run(&cli.common, command),
        Verb::Check(command) => check::run(&cli.common, command),
        Verb::Press(command) => press::run(&cli.common, command),
        Verb::Status(command) => status::run(&cli.common, command),
        Verb::History(command) => history::run(&cli.common, command),
        Verb::Calibrate(command) => calibrate::run(&cli.common, command),
        Verb::Verify(command) => verify::run(&cli.common, command),
        Verb::Measure(command) => measure::run(&cli.common, command),
        Verb::Plugins(command) => plugins::run(&cli.common, command),
        Verb::Bench(arguments) => bench::run(&cli.common, "bench", arguments),
    })
}

/// Parses the command line of a program, starts its log, runs it and returns its exit code: 0 done, 1 failed, 2 bad usage.
pub fn run_program<P: Parser>(run: impl FnOnce(&P) -> Result<ExitCode, CliError>) -> ExitCode {
    let program = match P::try_parse() {
        Ok(program) => program,
        Err(error) => {
            let code = if error.use_stderr() { 2 } else { 0 };
            // Nothing is left to report a closed pipe to.
            let _ = error.print();
            return ExitCode::from(code);
        }
    };
    start_log();
    match run(&program) {
        Ok(code) => code,
        Err(error) => {
            output::error(&error.to_string());
            ExitCode::from(if matches!(error, CliError::Usage(_)) { 2 } else { 1 })
        }
    }
}

/// Log lines go to stderr; `PLATEN_LOG` says which, warnings and errors by default.
fn start_log() {
    use tracing_subscriber::filter::{EnvFilter, LevelFilter};
    let filter = EnvFilter::builder()
        .with_default_directive(LevelFilter::WARN.into())
        .with_env_var("PLATEN_LOG")
        .from_env_lossy();
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::IsTerminal::is_terminal(&std::io::stderr()))
        .init();
}
