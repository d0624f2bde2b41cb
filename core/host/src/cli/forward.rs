//! Command `platen forward`: sends the record to the sinks of the plant file, in a process of its own beside the host.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Subcommand};
use jiff::Timestamp;
use platen_forward::{ForwardError, Start, forward, schema};
use platen_plant::{PlantFile, SinkKind, SinkUse};
use sd_notify::NotifyState;

use super::run::stop_signal;
use super::{CliError, Common, output};

#[derive(Debug, Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "Examples:\n  platen forward config/plant-north.toml\n  \
                  platen forward config/plant-north.toml --until-sent      # what is not sent yet, then end\n  \
                  platen forward config/plant-north.toml --from 2026-11-01 # send again from this day on\n  \
                  platen forward schema | psql -1 platen                   # tables, by the owner of the database\n\n\
                  Sending twice changes nothing at the sinks. `platen status` shows how far each sink is.\n\
                  SIGTERM and Ctrl-C end it with exit code 0; where a sink stood still, the next start goes on."
)]
pub(super) struct Command {
    /// Plant file with [forward]
    #[arg(required = true)]
    plant: Option<PathBuf>,
    /// Send again from this stroke (run id) or time on
    #[arg(long, value_name = "RUN|DATE", value_parser = start)]
    from: Option<Start>,
    /// End when every sink has everything
    #[arg(long)]
    until_sent: bool,
    #[command(subcommand)]
    verb: Option<Verb>,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Print the tables of the database as SQL, or apply what is missing
    Schema(SchemaCommand),
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  platen forward schema > platen.sql\n  \
                        platen forward schema --apply config/plant-north.toml --user postgres --password-file owner.txt\n\n\
                        Each press needs a role of its own: CREATE ROLE \"SITE/PRESS\" LOGIN PASSWORD '...' IN ROLE platen_writer;")]
struct SchemaCommand {
    /// Apply what is missing to the server of this plant file's sink
    #[arg(long, value_name = "PLANT")]
    apply: Option<PathBuf>,
    /// Sink, where the plant file has several of type postgresql
    #[arg(long, requires = "apply")]
    sink: Option<String>,
    /// Owner of the database
    #[arg(long, requires = "apply")]
    user: Option<String>,
    /// File with the owner's password on its first line
    #[arg(long, requires = "apply")]
    password_file: Option<PathBuf>,
}

fn start(text: &str) -> Result<Start, String> {
    if let Ok(run_id) = text.parse() {
        return Ok(Start::Run(run_id));
    }
    let day = || {
        text.parse::<jiff::civil::DateTime>()
            .ok()?
            .to_zoned(jiff::tz::TimeZone::UTC)
            .ok()
            .map(|it| it.timestamp())
    };
    let at: Option<Timestamp> = text.parse().ok().or_else(day);
    at.map(Start::Time)
        .ok_or_else(|| "expected a run id, a day like 2026-11-01, or a time like 2026-11-01T06:00:00Z".into())
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    match (&command.verb, &command.plant) {
        (Some(Verb::Schema(command)), _) => print_or_apply(common, command).map(|()| ExitCode::SUCCESS),
        (None, Some(plant)) => send(common, command, &PlantFile::load(plant)?),
        (None, None) => Err(CliError::Usage("name a plant file".into())),
    }
}

fn send(common: &Common, command: &Command, plant: &PlantFile) -> Result<ExitCode, CliError> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let status = runtime.block_on(async {
        let stop = stop_signal()?;
        // Fails without systemd, which does not matter.
        let _ = sd_notify::notify(&[NotifyState::Ready]);
        let start = command.from.unwrap_or(Start::Cursor);
        Ok::<_, CliError>(forward(plant, start, command.until_sent, stop).await?)
    })?;
    if common.json {
        output::json(&status)?;
    } else {
        for sink in &status.sinks {
            output::line(&format!("{}: {} sent; {}", sink.name, sink.sent, sink.line()))?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn print_or_apply(common: &Common, command: &SchemaCommand) -> Result<(), CliError> {
    let Some(file) = &command.apply else { return output::line(schema::script().trim_end()) };
    let plant = PlantFile::load(file)?;
    let sinks = plant.forward.as_ref().map(|forward| forward.sinks.as_slice()).unwrap_or_default();
    let is_named = |sink: &SinkUse| command.sink.as_ref().is_none_or(|name| *name == sink.name);
    let mut found = sinks.iter().filter(|sink| sink.kind == SinkKind::Postgresql && is_named(sink));
    let (Some(sink), None) = (found.next(), found.next()) else {
        let message = "needs one [[forward.sink]] of type postgresql; name it with --sink";
        return Err(CliError::Usage(format!("{}: {message}", file.display())));
    };
    let mut sink = sink.clone();
    sink.user = command.user.clone().unwrap_or(sink.user);
    sink.password_file = command.password_file.clone().or(sink.password_file);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let applied = runtime.block_on(schema::apply(&sink)).map_err(|e| CliError::Failed(e.to_string()))?;
    let names: Vec<_> = applied.iter().map(|it| it.name).collect();
    let text = if names.is_empty() {
        "nothing is missing".to_owned()
    } else {
        format!("applied {}", names.join(", "))
    };
    output::either(common, &serde_json::json!({ "applied": names }), &text)
}

impl From<ForwardError> for CliError {
    fn from(error: ForwardError) -> Self {
        match error {
            ForwardError::NotConfigured(_) | ForwardError::File(_) => Self::Usage(error.to_string()),
            other => Self::Failed(other.to_string()),
        }
    }
}
