//! Command `platen history`: queries of the record, and its backup.
//!
//! All subcommands but `restore` only read.

mod advice;
mod backup;
mod compare;
mod export;
mod pick;
mod sequence;
mod skill;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Subcommand};
use platen_history::{Archive, Stroke};
use platen_model::units::mm;
use platen_plant::PlantFile;
use platen_report::plate_report;

use super::selection::Selection;
use super::{CliError, Common, output};

use pick::RunRef;

/// Strokes that `history list` shows without `--newest`.
const LISTED: u32 = 50;

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  platen history list config/plant-north.toml --newest 20\n  \
                        platen history show config/plant-north.toml 1042\n  \
                        platen history compare config/plant-north.toml 12:3 14:3 --out compared\n  \
                        platen history sequence config/plant-north.toml 12\n  \
                        platen history advice config/plant-north.toml --json\n  \
                        platen history export config/plant-north.toml --out strokes.parquet\n  \
                        platen history report config/plant-north.toml 12\n  \
                        platen history backup config/plant-north.toml /backup/press-3-monday\n  \
                        platen history restore /backup/press-3-monday config/plant-north.toml\n\n\
                        A stroke is named by its run id (1042) or as plate:stroke (12:3, 12:blank); plates have the numbers of the list. \
                        All verbs but restore only read and may run beside a host.")]
pub(super) struct Command {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// List strokes, oldest first, one line each: the newest 50 without --newest
    List {
        /// Plant file
        plant: PathBuf,
        #[command(flatten)]
        selection: Selection,
    },
    /// Show the whole record of one stroke
    Show {
        /// Plant file
        plant: PathBuf,
        /// Run id, as in the list and in the press's registers, or plate:stroke
        run: RunRef,
    },
    /// Compare two strokes, of the same plate or of two
    Compare(compare::Command),
    /// Print the bending sequence of a plate: bends, overshoot, re-hits, energy left
    Sequence(sequence::Command),
    /// Compare strokes with the advice before them: angles and gaps inside their intervals
    Advice(advice::Command),
    /// Compare crews, by codes, with the hardness of their plates taken out
    Skill(skill::Command),
    /// Copy the record and its documents into a folder, also while the host runs
    Backup(backup::Backup),
    /// Check a backup: every file, the database, a document for each stroke
    Verify(backup::Verify),
    /// Begin a record from a backup, on this machine or another
    Restore(backup::Restore),
    /// Export all strokes as a table, CSV or Parquet
    Export(export::Command),
    /// Write the report of one plate as HTML that prints on A4
    Report {
        /// Plant file
        plant: PathBuf,
        /// The plate's number in the history
        plate: u32,
        /// Folder for plate-N.html, instead of the plant's output folder
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
    },
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    match &command.verb {
        Verb::List { plant, selection } => {
            let (_, archive) = open(plant)?;
            let strokes = archive.strokes(&selection.filter(Some(LISTED)))?;
            if common.json { output::json(&strokes)? } else { list(&strokes)? }
        }
        Verb::Show { plant, run } => {
            let (_, archive) = open(plant)?;
            let stroke = run.find(&archive)?;
            if common.json { output::json(&stroke)? } else { show(&stroke)? }
        }
        Verb::Compare(command) => compare::run(common, command)?,
        Verb::Sequence(command) => sequence::run(common, command)?,
        Verb::Advice(command) => advice::run(common, command)?,
        Verb::Skill(command) => skill::run(common, command)?,
        Verb::Backup(command) => backup::backup(common, command)?,
        Verb::Verify(command) => backup::verify(common, command)?,
        Verb::Restore(command) => backup::restore(common, command)?,
        Verb::Export(command) => export::run(common, command)?,
        Verb::Report { plant, plate, out } => {
            let (plant, archive) = open(plant)?;
            let folder = out.as_ref().unwrap_or(&plant.output.folder);
            std::fs::create_dir_all(folder)?;
            let path = plate_report::write(&archive, &plant.name, *plate, folder)?;
            let text = format!("wrote {}", path.display());
            output::either(common, &serde_json::json!({ "report": path }), &text)?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn open(plant: &std::path::Path) -> Result<(PlantFile, Archive), CliError> {
    let plant = PlantFile::load(plant)?;
    let archive = Archive::open(&plant.output.history)?;
    Ok((plant, archive))
}

fn verdict(stroke: &Stroke) -> String {
    match (stroke.verdict, &stroke.reason) {
        (Some(verdict), Some(reason)) => format!("{} ({reason})", verdict.as_str()),
        (Some(verdict), None) => verdict.as_str().to_owned(),
        (None, _) => format!("{:?}", stroke.stage()).to_lowercase(),
    }
}

fn list(strokes: &[Stroke]) -> Result<(), CliError> {
    let row = |stroke: &Stroke| {
        let length = |name: &str| stroke.figures.get(name).copied().map(mm);
        vec![
            stroke.run_id.to_string(),
            stroke.accepted.strftime("%F %T").to_string(),
            stroke.plate.to_string(),
            stroke.key.session.to_string(),
            format!("{}{}", stroke.key.stroke, if stroke.baseline { " baseline" } else { "" }),
            stroke.key.attempt.to_string(),
            verdict(stroke),
            output::number(length("gap.max"), 1),
            output::number(length("gap.uncertainty"), 2),
            stroke.ack.clone().unwrap_or_default(),
        ]
    };
    output::titled(
        "run | accepted | plate | session | stroke | attempt | verdict | gap mm | +- mm | acknowledged",
        strokes.iter().map(row),
    )
}

fn show(stroke: &Stroke) -> Result<(), CliError> {
    output::line(&format!("run {}: {}: {}", stroke.run_id, stroke.key, verdict(stroke)))?;
    let time = |at: Option<jiff::Timestamp>| at.map_or_else(|| "-".to_owned(), |at| at.to_string());
    output::line(&format!(
        "accepted {}, scanned {}, judged {}, acknowledged {}",
        stroke.accepted,
        time(stroke.scanned),
        time(stroke.finished),
        time(stroke.acked)
    ))?;
    for (name, value) in &stroke.figures {
        output::line(&format!("  {name} = {value}"))?;
    }
    for (what, path) in [("result", &stroke.document), ("scan", &stroke.scan)] {
        if let Some(path) = path {
            output::line(&format!("{what}: {}", path.display()))?;
        }
    }
    Ok(())
}
