//! Command line of `platen`, with one module for each command (verb).
//!
//! Results go to stdout, the log to stderr.
//!
//! Exit codes: 0 done, 1 failed, 2 bad usage or plant file. `--json` prints the result of any verb as one JSON
//! document.

mod advise;
pub mod bench;
mod bridge;
mod calibrate;
pub mod cell;
mod check;
mod convert;
mod demo;
mod forward;
mod generate;
mod history;
mod inspect;
mod measure;
mod outcomes;
pub mod output;
mod plate;
mod plugins;
pub mod press;
mod remeasure;
pub mod run;
mod scan;
mod scan_source;
mod screen;
mod selection;
mod setup;
mod status;
mod stop;
mod systemd;
mod verify;
mod worker;

pub(crate) use measure::scan_file;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, CommandFactory as _, Parser, Subcommand};

use platen_engine::pipeline::PipelineError;
use platen_engine::plugin::{Catalogue, Isolation, PluginError};
use platen_formats::WriteError;
use platen_history::Error as HistoryError;
use platen_report::output_folder::FilesError;
use platen_report::plate_report::ReportError;
use platen_report::sequence::SequenceError;

/// Measure plates on a press, stroke by stroke
#[derive(Debug, Parser)]
#[command(
    version,
    arg_required_else_help = true,
    after_help = "Exit codes: 0 done, 1 failed, 2 bad usage or plant file.\n\
                  PLATEN_LOG sets the log filter, e.g. PLATEN_LOG=debug or PLATEN_LOG=platen_press=trace."
)]
struct Cli {
    #[command(flatten)]
    common: Common,
    #[command(subcommand)]
    verb: Verb,
}

/// Options of every verb.
#[derive(Debug, Clone, Args)]
pub struct Common {
    /// Folder searched for plugins first
    #[arg(long, global = true, value_name = "DIR")]
    pub plugins: Option<PathBuf>,
    /// Print the result as JSON
    #[arg(long, global = true)]
    pub json: bool,
    /// Run plugins in threads of this process, for a debugger
    #[arg(long, global = true, hide_short_help = true)]
    pub in_process: bool,
}

impl Common {
    /// Returns the catalogue of the plugin folders; the folder of `--plugins` is searched first.
    pub fn catalogue(&self) -> Catalogue {
        let isolation = if self.in_process { Isolation::InProcess } else { Isolation::Process };
        Catalogue::new(self.plugins.as_deref()).isolated(isolation)
    }
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Bend a simulated plate: press and scanner on loopback, strokes until it is in tolerance
    Demo(demo::Command),
    /// Serve a press: scan, measure and answer after each stroke
    Run(run::Command),
    /// Measure the plate in one scan file
    Measure(measure::Command),
    /// Measure the strokes of a record again from their kept scans
    Remeasure(remeasure::Command),
    /// Write one scan of the plant's scanner to a file
    Scan(scan::Command),
    /// Convert a scan file to another format
    Convert(convert::Command),
    /// Estimate a scanner's errors beyond noise from repeated scans of one plate
    Calibrate(calibrate::Command),
    /// Compare painted discs in a scan with the markers of the plate file
    Verify(verify::Command),
    /// Describe a scan file: lattice, orientation, notes of the driver
    Inspect(inspect::Command),
    /// Check plant and plate files and list all faults
    Check(check::Command),
    /// Make plate files from the zones of a tank
    Plate(plate::Command),
    /// Print the register map, read registers, test link and handshake
    Press(press::Command),
    /// Send the record to databases and brokers, beside the host
    Forward(forward::Command),
    /// Show the state of a running host
    Status(status::Command),
    /// Stop a running host, at once or between two plates
    Stop(stop::Command),
    /// Print the drop-in of the unit platen@ for a plant: its addresses, devices, folders
    Systemd(systemd::Command),
    /// Make the token of the browser pages
    Screen(screen::Command),
    /// Advise the next stroke of a plate on record
    Advise(advise::Command),
    /// Query the record
    History(history::Command),
    /// List, test and make plugins
    Plugins(plugins::Command),
    /// Test a scan bridge over TCP
    Bridge(bridge::Command),
    /// Print the tables of Masuda et al. beside this machine's figures, on simulated scans
    Bench(bench::BenchArguments),
    /// Generate man pages or shell completions
    Generate(generate::Command),
    /// Carry one plugin; started by platen itself
    #[command(hide = true)]
    Worker(worker::Command),
}

/// Failure of a verb, by exit code.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// Wrong command line or plant file: exit 2.
    #[error("{0}")]
    Usage(String),
    /// Any other failure: exit 1.
    #[error("{0}")]
    Failed(String),
}

/// Makes these errors exit with 1.
macro_rules! failed {
    ($($error:ty),*) => { $(impl From<$error> for CliError {
        fn from(error: $error) -> Self {
            Self::Failed(error.to_string())
        }
    })* };
}

failed!(PluginError, FilesError, HistoryError, ReportError, SequenceError, std::io::Error);

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

impl From<WriteError> for CliError {
    fn from(error: WriteError) -> Self {
        match error {
            WriteError::Format(_) | WriteError::Exists(_) => Self::Usage(error.to_string()),
            failed => Self::Failed(failed.to_string()),
        }
    }
}

/// A verb of the program `platen-bench`.
#[derive(Debug)]
pub enum BenchVerb<'a> {
    /// `bench`
    Bench(&'a bench::BenchArguments),
    /// `press soak`
    Soak(&'a bench::SoakArguments),
}

/// Runs the command line of `platen`.
pub fn main() -> ExitCode {
    run_program(|cli| match &cli.verb {
        Verb::Demo(command) => demo::run(&cli.common, command),
        Verb::Run(command) => run::run(&cli.common, command),
        Verb::Scan(command) => scan::run(&cli.common, command),
        Verb::Convert(command) => convert::run(&cli.common, command),
        Verb::Inspect(command) => inspect::run(&cli.common, command),
        Verb::Check(command) => check::run(&cli.common, command),
        Verb::Plate(command) => plate::run(&cli.common, command),
        Verb::Press(command) => press::run(&cli.common, command),
        Verb::Forward(command) => forward::run(&cli.common, command),
        Verb::Status(command) => status::run(&cli.common, command),
        Verb::Stop(command) => stop::run(&cli.common, command),
        Verb::Systemd(command) => systemd::run(&cli.common, command),
        Verb::Screen(command) => screen::run(&cli.common, command),
        Verb::Advise(command) => advise::run(&cli.common, command),
        Verb::History(command) => history::run(&cli.common, command),
        Verb::Calibrate(command) => calibrate::run(&cli.common, command),
        Verb::Verify(command) => verify::run(&cli.common, command),
        Verb::Measure(command) => measure::run(&cli.common, command),
        Verb::Remeasure(command) => remeasure::run(&cli.common, command),
        Verb::Plugins(command) => plugins::run(&cli.common, command),
        Verb::Bridge(command) => bridge::run(&cli.common, command),
        Verb::Bench(_) => bench::start(),
        Verb::Generate(command) => generate::run(&cli.common, command, Cli::command()),
        Verb::Worker(_) => worker::run(),
    })
}

/// Runs the command line of `platen-bench`: the commands `bench` and `press soak` of `platen`.
pub fn main_of_bench(run: impl FnOnce(&Common, BenchVerb<'_>) -> Result<ExitCode, CliError>) -> ExitCode {
    run_program(|cli| {
        let verb = match &cli.verb {
            Verb::Bench(arguments) => Some(BenchVerb::Bench(arguments)),
            Verb::Press(command) => command.soak().map(BenchVerb::Soak),
            _ => None,
        };
        let verb = verb.ok_or_else(|| {
            CliError::Usage("platen-bench runs `bench` and `press soak`; start platen".into())
        })?;
        run(&cli.common, verb)
    })
}

/// Parses the command line, starts the log, runs the verb and returns the exit code: 0 done, 1 failed, 2 bad usage.
fn run_program(run: impl FnOnce(&Cli) -> Result<ExitCode, CliError>) -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            let code = if error.use_stderr() { 2 } else { 0 };
            // A closed pipe cannot be reported anywhere.
            let _ = error.print();
            return ExitCode::from(code);
        }
    };
    if !matches!(cli.verb, Verb::Worker(_)) {
        start_log();
    }
    match run(&cli) {
        Ok(code) => code,
        Err(error) => {
            output::error(&error.to_string());
            ExitCode::from(if matches!(error, CliError::Usage(_)) { 2 } else { 1 })
        }
    }
}

/// Starts the log on stderr, filtered by `PLATEN_LOG`; warnings and errors by default.
fn start_log() {
    use tracing_subscriber::filter::{LevelFilter, Targets};
    use tracing_subscriber::prelude::*;

    let given = std::env::var("PLATEN_LOG").ok().filter(|given| !given.trim().is_empty());
    let filter = given.map_or(Ok(Targets::new()), |given| given.parse::<Targets>());
    let mut filter = filter.unwrap_or_else(|error| {
        output::error(&format!("PLATEN_LOG: {error}; write for example debug or platen_press=trace"));
        Targets::new()
    });
    if filter.default_level().is_none() {
        filter = filter.with_default(LevelFilter::WARN);
    }
    let colours = std::io::IsTerminal::is_terminal(&std::io::stderr());
    let lines = tracing_subscriber::fmt::layer().with_writer(std::io::stderr).with_ansi(colours);
    tracing_subscriber::registry().with(lines.with_filter(filter)).init();
}
