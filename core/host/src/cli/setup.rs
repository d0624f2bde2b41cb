//! Arguments of `measure` and `verify` besides the scan: plate file, plant file and overrides.

use std::path::PathBuf;

use clap::Args;
use platen_plant::{PlantFile, PlateFile, PluginUse};

use super::CliError;

#[derive(Debug, Args)]
pub(super) struct Setup {
    /// Plate file: size, target, markers, lines, templates
    #[arg(long, value_name = "PLATE.toml")]
    pub(super) plate: PathBuf,
    /// Plant file: frame, flattening, comparisons; defaults without it
    #[arg(long, value_name = "PLANT.toml")]
    plant: Option<PathBuf>,
    /// Flattening plugin, instead of the one in the plant file
    #[arg(long, value_name = "NAME")]
    flattening: Option<String>,
    /// Rough direction of increasing u in the scanner frame, instead of the one in the plant file
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = direction)]
    u_axis: Option<[f64; 3]>,
}

impl Setup {
    /// Loads both files and applies the overrides of the command line.
    pub(super) fn load(&self) -> Result<(PlantFile, PlateFile), CliError> {
        let plate = PlateFile::load(&self.plate)?;
        let mut plant = self.plant.as_deref().map_or_else(|| Ok(PlantFile::default()), PlantFile::load)?;
        if let Some(name) = &self.flattening {
            plant.flattening = PluginUse::by_default(name);
        }
        plant.frame.u_axis = self.u_axis.or(plant.frame.u_axis);
        Ok((plant, plate))
    }
}

fn direction(text: &str) -> Result<[f64; 3], String> {
    let numbers: Vec<f64> = text.split(',').filter_map(|part| part.trim().parse().ok()).collect();
    let direction: [f64; 3] =
        numbers.try_into().map_err(|_| "give three numbers, e.g. 0.84,0.54,0".to_owned())?;
    let sound = direction.iter().all(|c| c.is_finite()) && direction.iter().any(|c| *c != 0.0);
    sound.then_some(direction).ok_or_else(|| "give a direction that is not 0,0,0".to_owned())
}
