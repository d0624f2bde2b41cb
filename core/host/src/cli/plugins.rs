//! Command `platen plugins`: the installed plugins and their options.

mod check;
mod new;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Subcommand};
use platen_engine::plugin::{Descriptor, Device, Listed, Quarantine, Quarantined};
use platen_plant::OptionDecl;
use platen_plant::PlantFile;

use super::{CliError, Common, output};

use serde_json::{Value as Json, json};

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  platen plugins list\n  platen plugins describe faro-file\n  \
                        platen plugins describe elastic --toml >> config/plant-north.toml")]
pub(super) struct Command {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// List every library file in the plugin folders
    #[command(
        after_help = "Examples:\n  platen plugins list\n  platen --plugins target/release plugins list --json"
    )]
    List,
    /// Describe a plugin and its options
    #[command(
        after_help = "Examples:\n  platen plugins describe elastic\n  platen plugins describe faro-stream --toml >> plant.toml"
    )]
    Describe {
        /// Name as in plant files
        name: String,
        /// Print its options as TOML, commented out, to paste into a plant file
        #[arg(long)]
        toml: bool,
    },
    /// List the devices that a scanner driver finds in reach
    #[command(
        after_help = "Examples:\n  platen plugins find faro-stream --option address=192.168.43.255:7040\n\n\
                            Exit code 1 when none is found."
    )]
    Find {
        /// Name of the driver
        name: String,
        /// Option of the driver that it needs to look: a text
        #[arg(long = "option", value_name = "NAME=TEXT", value_parser = pair)]
        options: Vec<(String, String)>,
    },
    /// Make a plugin of one's own that builds and works, in Rust, C or C++
    New(new::Command),
    /// Test a plugin library against the contract of the boundary
    Check(check::Command),
    /// Show or release the plugins that a plant has given up after too many faults
    #[command(after_help = "Examples:\n  platen plugins quarantine list config/plant-north.toml\n  \
                            platen plugins quarantine clear config/plant-north.toml my-comparison\n\n\
                            Another build of a plugin's library releases it as well. A running host sees both within seconds.")]
    Quarantine {
        #[command(subcommand)]
        action: Action,
    },
}

#[derive(Debug, Subcommand)]
enum Action {
    /// List them, with the reasons
    List {
        /// Plant file
        plant: PathBuf,
    },
    /// Release one plugin, or all
    Clear {
        /// Plant file
        plant: PathBuf,
        /// Name of the plugin; all without
        plugin: Option<String>,
    },
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    let catalogue = common.catalogue();
    match &command.verb {
        Verb::List => {
            let listed = catalogue.list();
            if common.json {
                output::json(&listed.iter().flat_map(listed_json).collect::<Vec<_>>())?;
            } else {
                list(&listed)?;
                let folders: Vec<String> =
                    catalogue.folders().iter().map(|f| f.display().to_string()).collect();
                output::line(&format!("looked in {}", folders.join(", ")))?;
            }
        }
        Verb::Describe { name, toml } => {
            let library = catalogue.load(name)?;
            let descriptor = library.descriptor();
            match (common.json, toml) {
                (true, _) => output::json(&describe_json(descriptor))?,
                (_, true) => output::line(&toml_block(descriptor))?,
                _ => describe(descriptor)?,
            }
        }
        Verb::Find { name, options } => return find(common, name, options),
        Verb::New(command) => return new::run(common, command),
        Verb::Check(command) => return check::run(common, command),
        Verb::Quarantine { action } => quarantine(common, action)?,
    }
    Ok(ExitCode::SUCCESS)
}

/// Splits an option of the command line.
fn pair(text: &str) -> Result<(String, String), String> {
    let (name, value) =
        text.split_once('=').ok_or("an option is NAME=TEXT, such as address=192.168.43.255:7040")?;
    Ok((name.trim().to_owned(), value.trim().to_owned()))
}

fn find(common: &Common, name: &str, options: &[(String, String)]) -> Result<ExitCode, CliError> {
    let values = options.iter().map(|(name, value)| format!("{name} = {}\n", Json::from(value.as_str())));
    let options: String = values.collect();
    // Written as in a plant file, so that its options are checked.
    let text = format!(
        "[plant]\nname = \"find\"\n[scanner]\nplugin = {}\n[scanner.options]\n{options}",
        Json::from(name)
    );
    let plant = PlantFile::parse("--option", &text).map_err(|faults| CliError::Usage(faults.to_string()))?;
    let scanner = platen_engine::pipeline::scanner(&plant, &common.catalogue())?;
    let found = scanner.instance().discover()?;
    if common.json {
        let json = |it: &Device| json!({"option": it.option, "value": it.value, "about": it.about});
        output::json(&found.iter().map(json).collect::<Vec<_>>())?;
    } else if found.is_empty() {
        output::line("none found: is it switched on, and on this network? is a firewall in the way?")?;
    } else {
        for Device { option, value, about } in &found {
            output::line(&format!("{option} = {:<24} # {about}", Json::from(value.as_str()).to_string()))?;
        }
    }
    Ok(ExitCode::from(u8::from(found.is_empty())))
}

fn quarantine(common: &Common, action: &Action) -> Result<(), CliError> {
    let of = |plant: &PathBuf| Ok::<_, CliError>(Quarantine::beside(&PlantFile::load(plant)?.output.history));
    let failed = |why: std::io::Error| CliError::Failed(why.to_string());
    let (entries, none) = match action {
        Action::List { plant } => (of(plant)?.list().map_err(failed)?, "no plugin is in quarantine"),
        Action::Clear { plant, plugin } => {
            let released = of(plant)?.clear(plugin.as_deref()).map_err(failed)?;
            (released, "none was in quarantine: nothing released")
        }
    };
    if common.json {
        return output::json(&entries);
    }
    for Quarantined { plugin, library, sha256, why, faults, since } in &entries {
        output::line(&format!("{plugin}: since {since:.0} after {faults} faults: {why}"))?;
        output::line(&format!("  {} (sha256 {sha256})", library.display()))?;
    }
    match (action, entries.len()) {
        (_, 0) => output::line(none),
        (Action::List { .. }, _) => Ok(()),
        (Action::Clear { .. }, n) => output::line(&format!("{n} released")),
    }
}

fn list(listed: &[Listed]) -> Result<(), CliError> {
    let rows = |Listed { path, plugins }: &Listed| match plugins {
        Ok(all) => all
            .iter()
            .map(|p| vec![p.id.clone(), p.kind.name().into(), p.version.clone(), "ready".into()])
            .collect(),
        Err(error) => {
            let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            vec![vec![file, "-".into(), "-".into(), format!("refused: {error}")]]
        }
    };
    output::titled("plugin | kind | version | state", listed.iter().flat_map(rows))
}

fn listed_json(listed: &Listed) -> Vec<Json> {
    let path = &listed.path;
    let ready = |p: &Descriptor| json!({ "path": path, "state": "ready", "id": p.id, "kind": p.kind.name(), "version": p.version });
    match &listed.plugins {
        Ok(all) => all.iter().map(ready).collect(),
        Err(error) => vec![json!({ "path": path, "state": "refused", "reason": error.to_string() })],
    }
}

/// Returns type, unit, range and default of an option in one line.
fn rules(option: &OptionDecl) -> String {
    let mut rules = match option.choices.as_slice() {
        [] => option.kind.name().to_owned(),
        choices => choices.join(" | "),
    };
    if let Some(unit) = &option.unit {
        rules += &format!(", {unit}");
    }
    match (option.min, option.max) {
        (Some(min), Some(max)) => rules += &format!(", {min} to {max}"),
        (Some(min), None) => rules += &format!(", at least {min}"),
        (None, Some(max)) => rules += &format!(", at most {max}"),
        (None, None) => {}
    }
    match (&option.default, option.required) {
        (Some(default), _) => rules += &format!(", default {default}"),
        (None, true) => rules += ", required",
        (None, false) => rules += ", optional",
    }
    rules
}

fn describe(p: &Descriptor) -> Result<(), CliError> {
    output::line(&format!("{} {} ({}), by {}, {}", p.id, p.version, p.kind.name(), p.vendor, p.license))?;
    output::line(&format!("\n{}", p.doc))?;
    output::line(&format!("\nreads {}, writes {}", p.inputs.join(", "), p.outputs.join(", ")))?;
    output::line(if p.options.is_empty() { "\nno options" } else { "\noptions:" })?;
    for option in &p.options {
        output::line(&format!("  {} ({})\n      {}", option.name, rules(option), option.doc))?;
    }
    Ok(())
}

fn describe_json(p: &Descriptor) -> Json {
    let option = |o: &OptionDecl| {
        json!({ "name": o.name, "type": o.kind.name(), "unit": o.unit, "min": o.min, "max": o.max, "choices": o.choices,
                "default": o.default, "required": o.required, "secret": o.secret, "doc": o.doc })
    };
    json!({ "id": p.id, "kind": p.kind.name(), "name": p.name, "vendor": p.vendor, "version": p.version, "doc": p.doc,
            "license": p.license, "inputs": p.inputs, "outputs": p.outputs,
            "options": p.options.iter().map(option).collect::<Vec<_>>() })
}

fn toml_block(p: &Descriptor) -> String {
    let table = p.kind.name();
    let head = if table == "comparison" { format!("[[{table}]]") } else { format!("[{table}]") };
    let mut text = format!("{head}\nplugin = \"{}\"\n[{table}.options]", p.id);
    for option in &p.options {
        let default = option.default.clone().unwrap_or_else(|| "...".into());
        text += &format!("\n# {} ({})\n# {} = {default}", option.doc, rules(option), option.name);
    }
    text
}
