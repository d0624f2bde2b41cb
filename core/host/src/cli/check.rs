//! `platen check`: everything that can be checked without hardware.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use platen_plant::{Error as PlantError, PlantFile, PlateFile, PluginUse, check_options};

use super::{CliError, Common, output};
use platen_engine::plugin::{Catalogue, Kind};

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  platen check config/plant-north.toml\n  platen check config/plates/plate-017.toml\n\n\
                        Prints every fault with file, line and column. Exit code 0 when there is none, 2 when there is."
)]
pub(super) struct Command {
    /// Plant or plate files; a plant file's plates are checked with it
    #[arg(required = true)]
    files: Vec<PathBuf>,
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    let catalogue = common.catalogue();
    let mut faults = Vec::new();
    for file in &command.files {
        if is_plate(file) {
            faults.extend(PlateFile::load(file).err().map(|e| e.to_string()));
        } else {
            check_plant(file, &catalogue, &mut faults);
        }
    }
    if common.json {
        output::json(&serde_json::json!({ "faults": faults }))?;
    } else if faults.is_empty() {
        output::line("no faults")?;
    } else {
        output::line(&faults.join("\n"))?;
    }
    Ok(ExitCode::from(if faults.is_empty() { 0 } else { 2 }))
}

/// A plate file has a table `[plate]`; what cannot be read is checked as a plant file, which says why.
fn is_plate(file: &Path) -> bool {
    std::fs::read_to_string(file)
        .is_ok_and(|text| text.lines().any(|line| line.trim_start().starts_with("[plate]")))
}

fn check_plant(file: &Path, catalogue: &Catalogue, faults: &mut Vec<String>) {
    let plant = match PlantFile::load(file) {
        Ok(plant) => plant,
        Err(error) => return faults.push(error.to_string()),
    };
    let scanner = plant.scanner.iter().map(|used| (used, Kind::Scanner));
    let comparisons = plant.comparisons.iter().map(|used| (used, Kind::Comparison));
    for (used, kind) in scanner.chain([(&plant.flattening, Kind::Flattening)]).chain(comparisons) {
        check_plugin(used, kind, catalogue, faults);
    }
    match plant.plate_files() {
        Ok(plates) => {
            faults.extend(
                plates.iter().filter_map(|(_, path)| PlateFile::load(path).err()).map(|e| e.to_string()),
            );
        }
        // A plant that measures single files needs no folder of plates.
        Err(PlantError::Unreadable { .. }) if plant.press.is_none() => {}
        Err(error) => faults.push(error.to_string()),
    }
}

fn check_plugin(used: &PluginUse, kind: Kind, catalogue: &Catalogue, faults: &mut Vec<String>) {
    match catalogue.load(&used.plugin) {
        Err(error) => faults.push(used.fault(error.to_string()).to_string()),
        Ok(library) => {
            let descriptor = library.descriptor();
            if descriptor.kind != kind {
                let message = format!(
                    "{} is a {}, a {} is needed here",
                    used.plugin,
                    descriptor.kind.name(),
                    kind.name()
                );
                faults.push(used.fault(message).to_string());
            }
            let wrong = check_options(&used.plugin, &used.options, &descriptor.options).err();
            faults.extend(wrong.map(|faults| faults.to_string()));
        }
    }
}
