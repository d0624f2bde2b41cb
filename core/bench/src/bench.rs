//! Command `platen bench`: accuracy, time and memory of the method on simulated scans, and the tables of Masuda et al.

use std::process::ExitCode;

use platen_host::cli::bench::{BenchArguments, Part};
use platen_host::cli::{CliError, Common, output};

use crate::machine::Machine;
use crate::{advice, random, scale, seeds, tables};

use serde_json::json;

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
        document["accuracy"] = match arguments.random {
            Some(n) => random::random(&catalogue, &arguments.out, arguments, n, common.json)?,
            None => seeds::accuracy(&catalogue, &arguments.out, arguments, common.json)?,
        };
    }
    if wanted(Part::Advice) {
        document["advice"] = advice::study(arguments, common.json)?;
    }
    if wanted(Part::Scale) {
        document["scale"] = scale::scale(common, arguments)?;
    }
    if common.json {
        output::json(&document)?;
    }
    Ok(ExitCode::SUCCESS)
}
