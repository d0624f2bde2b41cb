//! Command `platen plugins check`: conformance tests of a plugin library.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Args;
use platen_conformance::{LEVELS, Outcome, Settings, Subject, Verdict, digest};
use platen_plant::{Document, PluginUse, Survey};

use super::super::{CliError, Common, outcomes, output};

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  platen plugins check target/release/libmy_comparison.so\n  \
                        platen plugins check elastic --level 2 --junit elastic.xml\n  \
                        platen plugins check libmy_scanner.so --plant plant.toml --only cancel\n\n\
                        Levels: 0 the file, 1 loading, 2 the contract, 3 abuse. Each test runs in a process of its own.\n\
                        Exit code 0 when no test fails, 1 when one does, 2 when there is nothing to test.")]
pub(super) struct Command {
    /// A library file, or the name of an installed plugin
    library: PathBuf,
    /// The plugin, where the library holds several
    #[arg(long, value_name = "NAME")]
    plugin: Option<String>,
    /// Highest level
    #[arg(long, default_value_t = LEVELS, value_parser = clap::value_parser!(u8).range(0..=LEVELS as i64))]
    level: u8,
    /// Only tests whose names contain this
    #[arg(long, value_name = "TEXT")]
    only: Option<String>,
    /// Plant file that gives the plugin's options
    #[arg(long, value_name = "PLANT")]
    plant: Option<PathBuf>,
    /// Seed of random options
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Deadline of a job, seconds
    #[arg(long, default_value_t = 60, value_name = "S", value_parser = clap::value_parser!(u64).range(1..=3600))]
    limit: u64,
    /// Write the outcomes as JUnit's XML
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// Print the digest of the answers to the reference inputs alone
    #[arg(long, hide = true)]
    digest: bool,
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    let subject = subject(common, command)?;
    if command.digest {
        output::line(&digest(&subject).map_err(CliError::Failed)?)?;
        return Ok(ExitCode::SUCCESS);
    }
    let mut printed = Ok(());
    let mut outcomes = platen_conformance::run(&subject, command.level, command.only.as_deref(), |outcome| {
        if printed.is_ok() {
            printed = print(common, command, outcome);
        }
    });
    printed?;
    if command.level >= ISOLATION.1
        && command.only.as_ref().is_none_or(|only| ISOLATION.0.contains(only.as_str()))
    {
        let differs = outcomes.iter().find(|it| {
            it.test.starts_with("answer.") && matches!(it.verdict, Verdict::Failed(_) | Verdict::LeftOut(_))
        });
        let why = differs.map(|it| format!("{} has not passed", it.test));
        let outcome = in_both_isolations(common, command, &subject, why);
        print(common, command, &outcome)?;
        outcomes.push(outcome);
    }
    let name = command.library.display().to_string();
    outcomes::sum(common, ("library", &name, "boundary 2"), &outcomes, command.junit.as_deref())
}

fn subject(common: &Common, command: &Command) -> Result<Subject, CliError> {
    let catalogue = common.catalogue();
    let named = command.library.to_str().filter(|name| !name.contains(['/', '.']));
    let (path, plugin) = match named {
        Some(name) => (catalogue.load(name)?.path().to_owned(), Some(name.to_owned())),
        None => (command.library.clone(), command.plugin.clone()),
    };
    if !path.is_file() {
        return Err(CliError::Usage(format!("{}: no such file", path.display())));
    }
    let uses = command.plant.as_deref().map(plugins_of).transpose()?.unwrap_or_default();
    let names = catalogue.open(&path).map(|all| all.iter().map(|one| one.descriptor().id.clone()).collect());
    let names: Vec<String> = names.unwrap_or_default();
    let used = uses.iter().find(|used| names.contains(&used.plugin));
    if let (Some(plant), None) = (&command.plant, used) {
        return Err(CliError::Usage(format!(
            "{}: it names no plugin of {}",
            plant.display(),
            path.display()
        )));
    }
    let settings = Settings { seed: command.seed, limit: Duration::from_secs(command.limit) };
    Subject::open(&catalogue, &path, plugin.as_deref(), used, settings)
        .map_err(|error| CliError::Usage(error.to_string()))
}

/// Returns the plugins that a plant file names.
fn plugins_of(plant: &Path) -> Result<Vec<PluginUse>, CliError> {
    let document = Document::load(plant).map_err(|error| CliError::Usage(error.to_string()))?;
    Ok(Survey::of(document, plant).plugins.into_iter().map(|(_, used)| used).collect())
}

fn print(common: &Common, command: &Command, outcome: &Outcome) -> Result<(), CliError> {
    let (library, seed) = (command.library.display(), command.seed);
    let again = format!("platen plugins check {library} --only {} --seed {seed}", outcome.test);
    outcomes::print(common, outcome, &again)
}

/// Name and level of the test that needs a second process of this program.
const ISOLATION: (&str, u8) = ("answer.isolation", 2);

/// Returns the last line; the plugin may have printed others before it.
fn last_line(text: &[u8]) -> String {
    String::from_utf8_lossy(text).lines().last().unwrap_or_default().trim().to_owned()
}

/// Compares the answers of a worker with the answers of a thread in another process of this program, which the plugin
/// may crash.
fn in_both_isolations(
    common: &Common,
    command: &Command,
    subject: &Subject,
    left_out: Option<String>,
) -> Outcome {
    let start = Instant::now();
    let other = || -> Result<String, String> {
        let program = std::env::current_exe().map_err(|why| why.to_string())?;
        let mut other = std::process::Command::new(program);
        other.args(["--in-process", "plugins", "check", "--digest"]).arg(&command.library);
        other.args(common.plugins.iter().flat_map(|folder| [Path::new("--plugins"), folder]));
        other.args(command.plugin.iter().flat_map(|name| ["--plugin", name]));
        other.args(command.plant.iter().flat_map(|plant| [Path::new("--plant"), plant]));
        let output = other.stdin(std::process::Stdio::null()).output().map_err(|why| why.to_string())?;
        match output.status.success() {
            true => Ok(last_line(&output.stdout)),
            false => {
                Err(format!("in a thread of the host: {}", String::from_utf8_lossy(&output.stderr).trim()))
            }
        }
    };
    let verdict = match left_out.map_or_else(|| digest(subject), Err) {
        Err(why) => Verdict::LeftOut(why),
        Ok(here) => match other() {
            Ok(there) if there == here => Verdict::Passed,
            Ok(_) => Verdict::Failed("in a thread of the host it answers otherwise".into()),
            Err(why) => Verdict::Failed(why),
        },
    };
    let seconds = start.elapsed().as_secs_f64();
    let demands = "in a thread of the host it answers the same, to the last bit";
    Outcome { test: ISOLATION.0, level: ISOLATION.1, demands, verdict, seconds }
}
