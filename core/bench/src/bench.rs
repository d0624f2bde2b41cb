//! `platen bench`: accuracy, time and memory of the method on simulated scans, and the tables of Masuda et al.

use std::process::ExitCode;
use std::time::Duration;

use platen_plant::PluginUse;
use serde_json::json;

use platen_host::cli::bench::{BenchArguments, Part};
use platen_host::cli::{CliError, Common, output};

use crate::machine::Machine;
use crate::{scale, seeds, tables};
use platen_engine::pipeline;
use platen_engine::plugin::{Catalogue, Flattening};

/// Time limit of flattening one mesh, far beyond a press's, for slow plugins and large meshes.
const FLATTENING_LIMIT: Duration = Duration::from_secs(120);

pub(crate) fn run(common: &Common, arguments: &BenchArguments) -> Result<ExitCode, CliError> {
    output::fresh_folder(&arguments.out, "bench")?;
    let catalogue = common.catalogue();
    let machine = Machine::here();
    if !common.json {
        output::line(&machine.words())?;
    }
    let mut document = json!({ "machine": machine });
    let wanted = |part: Part| arguments.parts.iter().any(|p| [part, Part::All].contains(p));
    if wanted(Part::Tables) {
        document["tables"] = tables::tables(&catalogue, &arguments.out, arguments, common.json)?;
    }
    if wanted(Part::Accuracy) {
        document["accuracy"] = seeds::accuracy(&catalogue, &arguments.out, arguments, common.json)?;
    }
    if wanted(Part::Scale) {
        document["scale"] = scale::scale(common, arguments)?;
    }
    if common.json {
        output::json(&document)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Loads the flattening plugins of these names with their default options.
pub(crate) fn flattenings(catalogue: &Catalogue, names: &[String]) -> Result<Vec<Flattening>, CliError> {
    let load = |name: &String| {
        let (library, values) = pipeline::load(catalogue, &PluginUse::by_default(name))?;
        Ok(Flattening::create(&library, &values, FLATTENING_LIMIT)?)
    };
    names.iter().map(load).collect()
}
