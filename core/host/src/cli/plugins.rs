//! `platen plugins`: the installed plugins and their options.

use std::process::ExitCode;

use clap::{Args, Subcommand};
use platen_engine::plugin::{Descriptor, Listed};
use platen_plant::OptionDecl;

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
    List,
    /// Describe a plugin and its options
    Describe {
        /// Name as in plant files
        name: String,
        /// Print its options as TOML, commented out, to paste into a plant file
        #[arg(long)]
        toml: bool,
    },
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    let catalogue = common.catalogue();
    match &command.verb {
        Verb::List => {
            let listed = catalogue.list();
            if common.json {
                output::json(&listed.iter().map(listed_json).collect::<Vec<_>>())?;
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
    }
    Ok(ExitCode::SUCCESS)
}

fn list(listed: &[Listed]) -> Result<(), CliError> {
    let row = |Listed { path, plugin }: &Listed| match plugin {
        Ok(p) => vec![p.id.clone(), p.kind.name().into(), p.version.clone(), "ready".into()],
        Err(error) => {
            let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            vec![file, "-".into(), "-".into(), format!("refused: {error}")]
        }
    };
    output::titled("plugin | kind | version | state", listed.iter().map(row))
}

fn listed_json(listed: &Listed) -> Json {
    match &listed.plugin {
        Ok(p) => {
            json!({ "path": listed.path, "state": "ready", "id": p.id, "kind": p.kind.name(), "version": p.version })
        }
        Err(error) => json!({ "path": listed.path, "state": "refused", "reason": error.to_string() }),
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
