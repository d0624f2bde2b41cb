//! Command `platen press`: register map, contents of the registers, and tests of link and handshake.
//!
//! `test` and `write-test` write to the press, `soak` to a simulated press of its own; all other subcommands only read.

mod line;
mod recording;
mod registers;
mod reset;
pub mod trial;
mod write_test;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Subcommand, ValueEnum};
use platen_model::{Code, Language};
use platen_plant::PlantFile;
use platen_plant::press::{Press, Role};
use platen_press::{Client, LinkError, ModbusLink, alarms_csv, map_csv, map_markdown, map_page};

use super::bench::{self, SoakArguments};
use super::{CliError, Common, output};

#[derive(Debug, Args)]
#[command(after_help = "Examples, in the order of a first day:\n  \
                        platen press check plant.toml             what the host reads and writes; no connection\n  \
                        platen press map plant.toml > map.md      for the programmer of the press\n  \
                        platen press ping plant.toml              does it answer, how fast\n  \
                        platen press scan-unit plant.toml 1..10   which unit ids answer\n  \
                        platen press dump plant.toml              contents of the registers; watch: their changes\n  \
                        platen press probe-order plant.toml --at 120 --expect -12.5\n  \
                        platen press write-test plant.toml --i-know\n  \
                        platen press test plant.toml --strokes 5  the handshake, step by step, with simulated results\n  \
                        platen press soak -n 10000                against a simulated press; needs no plant file\n\n\
                        check, map, ping, dump, watch, probe-order, scan-unit and record only read; they may run beside the \
                        host where the press allows two connections. With --json an error has a cause: config, link, protocol, \
                        handshake or system.")]
pub(super) struct Command {
    #[command(subcommand)]
    verb: Verb,
}

impl Command {
    /// Returns the arguments of `soak`, if it is the subcommand.
    pub(super) fn soak(&self) -> Option<&SoakArguments> {
        match &self.verb {
            Verb::Soak(arguments) => Some(arguments),
            _ => None,
        }
    }
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Format {
    /// Markdown with the reference program
    Md,
    /// Comma-separated values
    Csv,
    /// Alarm table for the screen of the press, CSV
    Alarms,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum AlarmLanguage {
    /// English
    En,
    /// Japanese
    Ja,
}

impl From<AlarmLanguage> for Language {
    fn from(language: AlarmLanguage) -> Self {
        match language {
            AlarmLanguage::En => Self::En,
            AlarmLanguage::Ja => Self::Ja,
        }
    }
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// List what the host reads and writes, and the time it takes; no connection
    Check {
        /// Plant file
        plant: PathBuf,
    },
    /// Print the register map of a plant file, for the programmer of the press
    Map {
        /// Plant file
        plant: PathBuf,
        /// Format
        #[arg(long, value_enum, default_value = "md")]
        format: Format,
        /// Language of the alarm table
        #[arg(long, value_enum, default_value = "en")]
        language: AlarmLanguage,
    },
    /// Connect, read one register many times and print the round-trip times
    Ping {
        /// Plant file
        plant: PathBuf,
        /// Number of reads
        #[arg(short = 'n', long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..))]
        count: u32,
    },
    /// Find the unit ids that answer at this address, by one read each; slow
    ScanUnit {
        /// Plant file
        plant: PathBuf,
        /// Unit ids, e.g. 1..10
        #[arg(value_parser = line::units, default_value = "1..10")]
        units: line::Units,
    },
    /// Read both blocks now, or any registers
    Dump {
        /// Plant file
        plant: PathBuf,
        /// Words with their addresses instead of named fields
        #[arg(long)]
        raw: bool,
        /// Holding registers to read instead, zero-based, e.g. 0..200; those that the press refuses are left out
        #[arg(long, value_parser = registers::range)]
        range: Option<registers::Range>,
    },
    /// Print fields as they change, until Ctrl-C
    Watch {
        /// Plant file
        plant: PathBuf,
    },
    /// Find address and word order of a known 32-bit number
    ProbeOrder {
        /// Plant file
        plant: PathBuf,
        /// Zero-based address of the first of its two registers
        #[arg(long)]
        at: u16,
        /// Number that the press shows
        #[arg(long, allow_negative_numbers = true)]
        expect: f64,
    },
    /// Test the handshake at the real press with results marked as simulated, each step against its limit
    Test {
        /// Plant file
        plant: PathBuf,
        /// Number of strokes to make at the press
        #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..))]
        strokes: u32,
        /// Longest wait for a stroke
        #[arg(long, value_name = "SECONDS", default_value_t = 300)]
        patience_s: u64,
    },
    /// Write a pattern into each figure of the host's block, for comparison with the press's screen
    WriteTest {
        /// Plant file
        plant: PathBuf,
        /// Confirm that the press is safe and nobody relies on its registers now
        #[arg(long, required = true)]
        i_know: bool,
    },
    /// Record both blocks as they change into a file, until Ctrl-C
    Record {
        /// Plant file
        plant: PathBuf,
        /// File to write, JSON lines
        file: PathBuf,
        /// End after this time
        #[arg(long, value_name = "SECONDS")]
        for_s: Option<u64>,
    },
    /// Replay a recording to the handshake and compare the accepted strokes with the recorded host's
    Replay {
        /// Plant file
        plant: PathBuf,
        /// File written by `record`
        file: PathBuf,
    },
    /// Run many strokes against a simulated press on a faulty line: none wrong, doubled or lost
    Soak(SoakArguments),
    /// Clear the latched faults of the running host
    Reset {
        /// Plant file of the host
        plant: PathBuf,
    },
}

/// Failure of a subcommand, by the person who must act.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// Plant file, command line or system.
    #[error(transparent)]
    Cli(#[from] CliError),
    /// The press does not answer, or answers wrongly.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The handshake fails although the link works.
    #[error("{0}")]
    Handshake(String),
}

impl From<std::io::Error> for Failure {
    fn from(error: std::io::Error) -> Self {
        Self::Cli(error.into())
    }
}

impl From<Failure> for CliError {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Cli(error) => error,
            Failure::Link(error) => Self::Failed(error.to_string()),
            Failure::Handshake(text) => Self::Failed(text),
        }
    }
}

impl Failure {
    fn cause(&self) -> &'static str {
        match self {
            Self::Cli(CliError::Usage(_)) | Self::Link(LinkError::Refused { .. }) => "config",
            Self::Cli(CliError::Failed(_)) => "system",
            Self::Link(LinkError::Mismatch { .. } | LinkError::Exception { .. }) => "protocol",
            Self::Link(
                LinkError::Connect { .. }
                | LinkError::ConnectTimeout { .. }
                | LinkError::Timeout { .. }
                | LinkError::Broken { .. },
            ) => "link",
            Self::Handshake(_) => "handshake",
        }
    }
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    report(common, dispatch(common, &command.verb))
}

/// Prints a failure as JSON with `--json`, and returns it.
///
/// # Errors
/// The failure, or a closed output.
pub fn report(common: &Common, done: Result<ExitCode, Failure>) -> Result<ExitCode, CliError> {
    if let (true, Err(failure)) = (common.json, &done) {
        let (error, cause) = (failure.to_string(), failure.cause());
        output::json(&serde_json::json!({ "error": error, "cause": cause }))?;
    }
    Ok(done?)
}

fn dispatch(common: &Common, verb: &Verb) -> Result<ExitCode, Failure> {
    match verb {
        Verb::Check { plant } => line::check(common, &load(plant)?)?,
        Verb::Map { plant, format, language } => map(common, &load(plant)?, *format, *language)?,
        Verb::Ping { plant, count } => line::ping(common, &load(plant)?, *count)?,
        Verb::ScanUnit { plant, units } => return line::scan_units(common, &load(plant)?, units),
        Verb::Dump { plant, raw, range } => registers::dump(common, &load(plant)?, *raw, range.as_ref())?,
        Verb::Watch { plant } => registers::watch(common, &load(plant)?)?,
        Verb::ProbeOrder { plant, at, expect } => {
            return registers::probe_order(common, &load(plant)?, *at, *expect);
        }
        Verb::Test { plant, strokes, patience_s } => {
            return trial::run(common, load(plant)?, *strokes, std::time::Duration::from_secs(*patience_s));
        }
        // clap requires `--i-know`.
        Verb::WriteTest { plant, i_know: _ } => return write_test::run(common, &load(plant)?),
        Verb::Record { plant, file, for_s } => {
            recording::record(common, &load(plant)?, file, for_s.map(std::time::Duration::from_secs))?;
        }
        Verb::Replay { plant, file } => return recording::replay(common, &load(plant)?, file),
        Verb::Soak(_) => return Ok(bench::start()?),
        Verb::Reset { plant } => return reset::run(common, &PlantFile::load(plant).map_err(CliError::from)?),
    }
    Ok(ExitCode::SUCCESS)
}

fn load(plant: &Path) -> Result<Press, CliError> {
    let missing = || CliError::Usage(format!("{}: has no [press]", plant.display()));
    PlantFile::load(plant)?.press.ok_or_else(missing)
}

fn map(common: &Common, press: &Press, format: Format, language: AlarmLanguage) -> Result<(), CliError> {
    match format {
        Format::Md | Format::Csv if common.json => output::json(&map_page(press)),
        Format::Alarms if common.json => output::json(&alarms(language.into())),
        Format::Md => output::line(map_markdown(press).trim_end()),
        Format::Csv => output::line(map_csv(press).trim_end()),
        Format::Alarms => output::line(alarms_csv(language.into()).trim_end()),
    }
}

fn alarms(language: Language) -> Vec<serde_json::Value> {
    let row = |code: &Code| {
        let alarm = code.alarm();
        serde_json::json!({
            "code": code.number(), "severity": alarm.severity.name(), "text": alarm.text(language),
            "remedy": alarm.remedy(language),
        })
    };
    Code::ALL.iter().map(row).collect()
}

/// Returns a client of the press, not yet connected.
fn client(press: &Press) -> Result<Client<ModbusLink>, CliError> {
    if press.role == Role::Server {
        return Err(CliError::Usage(
            "this press is the client (role = \"server\"): there is no server to read from; run the host, or \
             platen press test"
                .into(),
        ));
    }
    Ok(Client::new(ModbusLink::new(&press.link), press))
}
