//! `platen press`: the register map in force, what stands in the registers, and trials of link and handshake.
//!
//! All but `test`, `write-test` and `soak` only read, and `soak` has a simulated press of its own.

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

use super::{CliError, Common, output};

#[derive(Debug, Args)]
#[command(after_help = "Examples, in the order of a first day:\n  \
                        platen press check plant.toml             what the host will ask and write; no connection\n  \
                        platen press map plant.toml > map.md      for the programmer of the press\n  \
                        platen press ping plant.toml              is it there, how fast\n  \
                        platen press scan-unit plant.toml 1..10   which unit ids answer\n  \
                        platen press dump plant.toml              what stands in the registers; watch: what changes\n  \
                        platen press probe-order plant.toml --at 120 --expect -12.5\n  \
                        platen press write-test plant.toml --i-know\n  \
                        platen press test plant.toml --strokes 5  the handshake, step by step, with simulated results\n  \
                        platen press soak -n 10000                against a simulated press; needs no plant file\n\n\
                        check, map, ping, dump, watch, probe-order, scan-unit and record only read; they may run beside the\n\
                        host where the press allows two connections. With --json an error has a cause: config, link, protocol,\n\
                        handshake or system.")]
pub(super) struct Command {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Format {
    /// Markdown with the reference program
    Md,
    /// Comma-separated values
    Csv,
    /// The alarm table for the screen of the press, CSV
    Alarms,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Tongue {
    /// English
    En,
    /// Japanese
    Ja,
}

impl From<Tongue> for Language {
    fn from(tongue: Tongue) -> Self {
        match tongue {
            Tongue::En => Self::En,
            Tongue::Ja => Self::Ja,
        }
    }
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// What the host will read and write, and the time it takes; no connection
    Check {
        /// Plant file
        plant: PathBuf,
    },
    /// The register map of a plant file, for the programmer of the press
    Map {
        /// Plant file
        plant: PathBuf,
        /// What to print
        #[arg(long, value_enum, default_value = "md")]
        format: Format,
        /// Language of the alarm table
        #[arg(long, value_enum, default_value = "en")]
        language: Tongue,
    },
    /// Connect, read one register many times, tell the round trips
    Ping {
        /// Plant file
        plant: PathBuf,
        /// How many reads
        #[arg(short = 'n', long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..))]
        count: u32,
    },
    /// Which unit ids answer at this address; slow, reads one register of each
    ScanUnit {
        /// Plant file
        plant: PathBuf,
        /// Unit ids, e.g. 1..10
        #[arg(value_parser = line::units, default_value = "1..10")]
        units: line::Units,
    },
    /// What stands in both blocks now, or in any registers
    Dump {
        /// Plant file
        plant: PathBuf,
        /// Words with their addresses instead of named fields
        #[arg(long)]
        raw: bool,
        /// Any holding registers, zero-based, e.g. 0..200; those that the press refuses are left out
        #[arg(long, value_parser = registers::range)]
        range: Option<registers::Range>,
    },
    /// Fields as they change, until Ctrl-C
    Watch {
        /// Plant file
        plant: PathBuf,
    },
    /// In which order and at which address a known 32-bit number stands
    ProbeOrder {
        /// Plant file
        plant: PathBuf,
        /// Zero-based address of the first of both registers
        #[arg(long)]
        at: u16,
        /// The number that the press shows there
        #[arg(long, allow_negative_numbers = true)]
        expect: f64,
    },
    /// The handshake at the real press with results marked as simulated: each step with its limit
    Test {
        /// Plant file
        plant: PathBuf,
        /// How many strokes to make at the press
        #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..))]
        strokes: u32,
        /// Give up when no stroke comes for so long
        #[arg(long, value_name = "SECONDS", default_value_t = 300)]
        patience_s: u64,
    },
    /// Writes a pattern into each figure of the host's block for comparison with the press's screen
    WriteTest {
        /// Plant file
        plant: PathBuf,
        /// The press is safe and nobody relies on its registers now
        #[arg(long, required = true)]
        i_know: bool,
    },
    /// Both blocks as they change into a file, until Ctrl-C
    Record {
        /// Plant file
        plant: PathBuf,
        /// File to write, JSON lines
        file: PathBuf,
        /// End after so long
        #[arg(long, value_name = "SECONDS")]
        for_s: Option<u64>,
    },
    /// Plays a recording to the handshake: which strokes it takes now, and whether that is what the host did then
    Replay {
        /// Plant file
        plant: PathBuf,
        /// A file of `record`
        file: PathBuf,
    },
    /// Strokes without end against a simulated press with a bad line: nothing wrong, doubled or lost
    #[command(disable_help_flag = true)]
    Soak(super::bench::Arguments),
    /// Clears the latched faults of the running host
    Reset {
        /// Plant file of the host
        plant: PathBuf,
    },
}

/// Why a verb failed, by who must act.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The plant file, the command line or the system.
    #[error(transparent)]
    Cli(#[from] CliError),
    /// The press does not answer, or not as it should.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The press answers, but the handshake does not work.
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

/// Prints a failure as JSON where JSON is asked for, and passes it on.
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
        // clap has seen to `--i-know`.
        Verb::WriteTest { plant, i_know: _ } => return write_test::run(common, &load(plant)?),
        Verb::Record { plant, file, for_s } => {
            recording::record(common, &load(plant)?, file, for_s.map(std::time::Duration::from_secs))?;
        }
        Verb::Replay { plant, file } => return recording::replay(common, &load(plant)?, file),
        Verb::Soak(arguments) => return Ok(super::bench::run(common, "soak", arguments)?),
        Verb::Reset { plant } => return reset::run(common, &PlantFile::load(plant).map_err(CliError::from)?),
    }
    Ok(ExitCode::SUCCESS)
}

fn load(plant: &Path) -> Result<Press, CliError> {
    let missing = || CliError::Usage(format!("{}: has no [press]", plant.display()));
    PlantFile::load(plant)?.press.ok_or_else(missing)
}

fn map(common: &Common, press: &Press, format: Format, language: Tongue) -> Result<(), CliError> {
    match format {
        Format::Md | Format::Csv if common.json => output::json(&map_page(press)),
        Format::Alarms if common.json => output::json(&alarms(language.into())),
        Format::Md => output::line(map_markdown(press).trim_end()),
        Format::Csv => output::line(map_csv(press).trim_end()),
        Format::Alarms => output::line(alarms_csv(language.into()).trim_end()),
    }
}

/// The alarm table as data.
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

/// Someone who asks the press; not connected yet.
fn client(press: &Press) -> Result<Client<ModbusLink>, CliError> {
    if press.role == Role::Server {
        return Err(CliError::Usage(
            "this press asks the host (role = \"server\"): there is nothing to read from; run the host, or \
             platen press test"
                .into(),
        ));
    }
    Ok(Client::new(ModbusLink::new(&press.link), press))
}
