//! Command `platen check`: checks everything that needs no hardware, and reports all faults at once.
//!
//! A fault does not hide others: plugins, their options and the plate files are also checked when other parts of the
//! plant file are faulty.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use platen_plant::plant::plate_files;
use platen_plant::{Document, Fault, Faults, PlateFile, PluginRole, PluginUse, Survey, check_options};

use super::{CliError, Common, output};
use platen_engine::plugin::{Catalogue, Kind};

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  platen check config/plant-north.toml\n  platen check config/plates/plate-017.toml\n\n\
                        Prints every fault with file, line and column. With --json, `faults` is a list of\n\
                        {file, line, column, key, message}; line and column are 0 for a file that cannot be read.\n\
                        Exit code 0 when there is none, 2 when there is."
)]
pub(super) struct Command {
    /// Plant or plate files; a plant file's plates are checked with it
    #[arg(required = true)]
    files: Vec<PathBuf>,
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    let catalogue = common.catalogue();
    let faults = command.files.iter().flat_map(|file| check(file, &catalogue)).collect();
    let faults = Faults::new(faults);
    match &faults {
        _ if common.json => {
            output::json(
                &serde_json::json!({ "faults": faults.as_ref().map_or(&[][..], Faults::as_slice) }),
            )?;
        }
        Some(faults) => output::line(&faults.to_string())?,
        None => output::line("no faults")?,
    }
    Ok(ExitCode::from(if faults.is_some() { 2 } else { 0 }))
}

fn check(file: &Path, catalogue: &Catalogue) -> Vec<Fault> {
    match Document::load(file) {
        Err(error) => error.into_faults(),
        Ok(document) if PlateFile::recognises(&document) => check_plate(document),
        Ok(document) => check_plant(Survey::of(document, file), catalogue),
    }
}

fn check_plate(document: Document) -> Vec<Fault> {
    PlateFile::take(document).err().into_iter().flatten().collect()
}

fn check_plant(survey: Survey, catalogue: &Catalogue) -> Vec<Fault> {
    let mut faults: Vec<Fault> = survey.plant.err().into_iter().flatten().collect();
    for (role, used) in &survey.plugins {
        faults.extend(check_plugin(*role, used, catalogue));
    }
    let Some((folder, at)) = survey.plates else { return faults };
    match plate_files(&folder) {
        Ok(plates) => faults.extend(plates.iter().flat_map(|(_, path)| match Document::load(path) {
            Ok(document) => check_plate(document),
            Err(error) => error.into_faults(),
        })),
        Err(error) if survey.has_press => faults.push(Fault { message: error.to_string(), ..at }),
        // A plant that only measures single files needs no folder of plates.
        Err(_) => {}
    }
    faults
}

fn check_plugin(role: PluginRole, used: &PluginUse, catalogue: &Catalogue) -> Vec<Fault> {
    let library = match catalogue.load(&used.plugin) {
        Ok(library) => library,
        Err(error) => return vec![used.fault(error.to_string())],
    };
    let descriptor = library.descriptor();
    let needed = match role {
        PluginRole::Scanner => Kind::Scanner,
        PluginRole::Flattening => Kind::Flattening,
        PluginRole::Comparison => Kind::Comparison,
        PluginRole::Advisor => Kind::Advisor,
    };
    if descriptor.kind != needed {
        let (found, needed) = (descriptor.kind.name(), needed.name());
        return vec![used.fault(format!("{} is a {found}, a {needed} is needed here", used.plugin))];
    }
    check_options(&used.plugin, &used.options, &descriptor.options).err().into_iter().flatten().collect()
}
