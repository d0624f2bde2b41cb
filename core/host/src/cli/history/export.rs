//! `platen history export`: the strokes of a history as one table, CSV or Parquet.

use std::io::Write as _;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use platen_history::{Stroke, Table};
use platen_report::advice::AdviceRecord;

use super::open;
use crate::cli::selection::Selection;
use crate::cli::{CliError, Common, output};

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  platen history export config/plant-north.toml > strokes.csv\n  \
                        platen history export config/plant-north.toml --out strokes.parquet\n\n\
                        One row a stroke: identity, times, verdict, data of the press (press.die_id, press.force, ...; newtons, metres, radians) \
                        and every figure (gap.max, deviation.rms, ...; metres, radians, seconds, shares of one). advice.* is the stroke against the \
                        advice before it. Unknown values are empty.")]
pub(super) struct Command {
    /// Plant file
    plant: PathBuf,
    /// File to write; stdout by default
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Format; by default that of the file name's ending, else CSV
    #[arg(long, value_enum)]
    format: Option<Format>,
    #[command(flatten)]
    selection: Selection,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    Csv,
    Parquet,
}

pub(super) fn run(common: &Common, command: &Command) -> Result<(), CliError> {
    let (_, archive) = open(&command.plant)?;
    let mut strokes = archive.strokes(&command.selection.filter(None))?;
    strokes.iter_mut().for_each(add_advice);
    let table = Table::of_strokes(&strokes);
    let parquet = command.out.as_ref().and_then(|out| out.extension()).is_some_and(|end| end == "parquet");
    let format = command.format.unwrap_or(if parquet { Format::Parquet } else { Format::Csv });
    let mut bytes = Vec::new();
    match format {
        Format::Csv => table.write_csv(&mut bytes)?,
        Format::Parquet => table.write_parquet(&mut bytes)?,
    }
    let Some(out) = &command.out else {
        return match std::io::stdout().write_all(&bytes) {
            Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
            other => Ok(other?),
        };
    };
    std::fs::write(out, &bytes).map_err(|e| CliError::Failed(format!("{}: {e}", out.display())))?;
    let text = format!("wrote {} strokes to {}", strokes.len(), out.display());
    output::either(common, &serde_json::json!({ "file": out, "strokes": strokes.len() }), &text)
}

/// Adds the stroke's score against the advice before it to its figures, so that coverage can be counted from the table.
fn add_advice(stroke: &mut Stroke) {
    let record = stroke.document.as_ref().map(|document| AdviceRecord::beside(document));
    let score = match record {
        Some(Ok(record)) => record.and_then(|record| record.score),
        Some(Err(why)) => return tracing::warn!("{why}"),
        None => None,
    };
    let Some(score) = score else { return };
    let [low, expected, high] = score.foretold_gap;
    let figures = [
        ("off_line", Some(score.off_line)),
        ("angle", Some(score.advised_angle)),
        ("expected_angle", score.expected_angle),
        ("expected_to", score.expected_to),
        ("made_angle", Some(score.made.angle)),
        ("gap_low", Some(low)),
        ("gap_expected", Some(expected)),
        ("gap_high", Some(high)),
        ("gap_made", score.gap),
        ("followed", Some(f64::from(u8::from(score.followed)))),
    ];
    let given = figures.into_iter().filter_map(|(name, value)| Some((format!("advice.{name}"), value?)));
    stroke.figures.extend(given);
}
