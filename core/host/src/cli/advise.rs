//! Command `platen advise`: computes again the advice after a recorded stroke.
//!
//! Equal inputs give equal bytes.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use platen_engine::pipeline;
use platen_engine::plugin::{Advisor, CancelToken};
use platen_history::{Archive, Filter, Stroke};
use platen_plant::PlantFile;
use platen_report::advice::{AdviceRecord, words};
use platen_report::{history_view, output_folder};

use super::{CliError, Common, output};
use crate::plate_history;

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  platen advise config/plant-north.toml 12\n  platen advise config/plant-north.toml 12 --stroke 3 --json\n\n\
                  Needs a plate that was measured with [advice] in the plant file: the input of the advisor lies in advice.json beside each \
                  result. Nothing is written, and the press is not asked."
)]
pub(super) struct Command {
    /// Plant file
    plant: PathBuf,
    /// The plate's number in the history
    plate: u32,
    /// Stroke that the advice follows, as in the list (3, blank); the last one without
    #[arg(long, value_name = "N")]
    stroke: Option<String>,
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    let plant = PlantFile::load(&command.plant)?;
    let Some(wanted) = &plant.advice else {
        return Err(CliError::Usage(format!(
            "{}: has no [advice]; add it to have the next stroke advised",
            command.plant.display()
        )));
    };
    let archive = Archive::open(&plant.output.history)?;
    let stroke = find(&archive, command)?;
    let failed = |why: String| CliError::Failed(why);
    let document = stroke.document.as_ref();
    let document = document.ok_or_else(|| failed(format!("run {}: was not measured", stroke.run_id)))?;
    let record = AdviceRecord::beside(document).map_err(failed)?.ok_or_else(|| {
        CliError::Usage(format!("run {}: was measured without [advice] in the plant file", stroke.run_id))
    })?;
    let surface = output_folder::surface_beside(document).map_err(failed)?;
    let origin = plate_history::origin(&archive, stroke.run_id);
    let (library, values) = pipeline::load(&common.catalogue(), &wanted.plugin)?;
    let advisor = Advisor::create(&library, &values, wanted.deadline)?;
    let advice = advisor.advise(&record.history, &surface, origin.as_ref(), CancelToken::default())?;
    if common.json {
        output::json(&advice)?;
    } else {
        words(&advice).iter().try_for_each(|line| output::line(line))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn find(archive: &Archive, command: &Command) -> Result<Stroke, CliError> {
    let filter = Filter { plate: Some(command.plate), ..Filter::default() };
    let strokes = archive.strokes(&filter)?;
    let names: Vec<String> = strokes.iter().map(history_view::label).collect();
    let wanted = |stroke: &Stroke| match &command.stroke {
        Some(name) => history_view::label(stroke) == *name,
        None => stroke.document.is_some(),
    };
    strokes.into_iter().rev().find(wanted).ok_or_else(|| {
        let known = if names.is_empty() { "no strokes".to_owned() } else { names.join(", ") };
        let stroke = command.stroke.as_deref().unwrap_or("that was measured");
        CliError::Usage(format!("plate {} has no stroke {stroke}; it has {known}", command.plate))
    })
}
