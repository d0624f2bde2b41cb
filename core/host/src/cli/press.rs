//! `platen press`: the register map in force, and what stands in the registers. Nothing here ever writes.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use clap::{Args, Subcommand, ValueEnum};
use platen_plant::PlantFile;
use platen_plant::press::{Block, Press, Role};
use platen_press::{
    Client, Language, LinkError, ModbusLink, alarms_csv, describe_inputs, describe_outputs, map_csv,
    map_markdown, reference_program,
};
use serde_json::{Map, Value as Json, json};

use super::run::{runtime, stop_signal};
use super::{CliError, Common, output};

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  platen press map config/plant-north.toml > registers.md\n  \
                        platen press dump config/plant-north.toml --raw\n  platen press watch config/plant-north.toml\n\n\
                        dump and watch read only; they may run beside the host where the press allows two connections.")]
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
    /// What stands in both blocks now
    Dump {
        /// Plant file
        plant: PathBuf,
        /// Words with their addresses instead of named fields
        #[arg(long)]
        raw: bool,
    },
    /// Fields as they change, until Ctrl-C
    Watch {
        /// Plant file
        plant: PathBuf,
    },
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    match &command.verb {
        Verb::Map { plant, format, language } => {
            let press = load(plant)?;
            match format {
                Format::Md => {
                    output::line(&format!("{}\n{}", map_markdown(&press), reference_program(&press)))?
                }
                Format::Csv => output::line(map_csv(&press).trim_end())?,
                Format::Alarms => output::line(alarms_csv((*language).into()).trim_end())?,
            }
        }
        Verb::Dump { plant, raw } => dump(common, &load(plant)?, *raw)?,
        Verb::Watch { plant } => watch(common, &load(plant)?)?,
    }
    Ok(ExitCode::SUCCESS)
}

fn load(plant: &Path) -> Result<Press, CliError> {
    let missing = || CliError::Usage(format!("{}: has no [press]", plant.display()));
    PlantFile::load(plant)?.press.ok_or_else(missing)
}

impl From<LinkError> for CliError {
    fn from(error: LinkError) -> Self {
        Self::Failed(error.to_string())
    }
}

/// Both blocks, by name.
struct Blocks {
    press: Vec<u16>,
    host: Vec<u16>,
}

async fn read(press: &Press, client: &mut Client<ModbusLink>) -> Result<Blocks, LinkError> {
    if !client.connected() {
        client.connect().await?;
    }
    let (p, h) = (&press.map.read, &press.map.write);
    Ok(Blocks { press: client.read(p, p.count).await?, host: client.read(h, h.count).await? })
}

fn client(press: &Press) -> Result<Client<ModbusLink>, CliError> {
    if press.role == Role::Server {
        return Err(CliError::Usage(
            "this press asks the host (role = \"server\"): there is nothing to read from".into(),
        ));
    }
    Ok(Client::new(ModbusLink::new(&press.link), press))
}

/// Named fields of both blocks, press first.
fn fields(press: &Press, blocks: &Blocks) -> Vec<(&'static str, String, String)> {
    let inputs = describe_inputs(&press.map, &blocks.press).into_iter();
    let outputs = describe_outputs(&press.map, &blocks.host).into_iter();
    let inputs = inputs.map(|(name, value)| ("press", name.to_string(), value));
    inputs.chain(outputs.map(|(name, value)| ("host", name.to_string(), value))).collect()
}

fn raw(block: &Block, words: &[u16]) -> Vec<(u16, u16)> {
    (block.start..).zip(words.iter().copied()).collect()
}

fn dump(common: &Common, press: &Press, as_words: bool) -> Result<(), CliError> {
    let mut client = client(press)?;
    let blocks = runtime()?.block_on(read(press, &mut client))?;
    if common.json {
        let mut named = Map::new();
        for (side, name, value) in fields(press, &blocks) {
            let side = named.entry(side).or_insert_with(|| json!({}));
            side[name] = Json::String(value);
        }
        return output::json(&json!({
            "fields": named,
            "words": { "press": raw(&press.map.read, &blocks.press), "host": raw(&press.map.write, &blocks.host) },
        }));
    }
    let mut rows = Vec::new();
    if as_words {
        rows.push(["block", "address", "word", "hex"].map(str::to_owned).to_vec());
        for (side, block, words) in
            [("press", &press.map.read, &blocks.press), ("host", &press.map.write, &blocks.host)]
        {
            let row = |(address, word): (u16, u16)| {
                vec![side.to_owned(), address.to_string(), word.to_string(), format!("{word:04X}")]
            };
            rows.extend(raw(block, words).into_iter().map(row));
        }
    } else {
        rows.push(["block", "field", "value"].map(str::to_owned).to_vec());
        rows.extend(
            fields(press, &blocks).into_iter().map(|(side, name, value)| vec![side.to_owned(), name, value]),
        );
    }
    output::table(&rows)
}

fn watch(common: &Common, press: &Press) -> Result<(), CliError> {
    let mut client = client(press)?;
    let start = Instant::now();
    let mut shown: Vec<(&str, String, String)> = Vec::new();
    runtime()?.block_on(async {
        let mut stop = stop_signal()?;
        loop {
            match read(press, &mut client).await {
                Ok(blocks) => {
                    let now = fields(press, &blocks);
                    for (side, name, value) in now.iter().filter(|field| !shown.contains(field)) {
                        let at_s = start.elapsed().as_secs_f64();
                        let line = if common.json {
                            json!({ "at_s": at_s, "block": side, "field": name, "value": value }).to_string()
                        } else {
                            format!("{at_s:9.3} s  {side:5}  {name} = {value}")
                        };
                        output::line(&line)?;
                    }
                    shown = now;
                }
                Err(error) => output::error(&error.to_string()),
            }
            tokio::select! {
                () = tokio::time::sleep(press.link.poll) => {}
                _ = stop.changed() => return Ok(()),
            }
        }
    })
}
