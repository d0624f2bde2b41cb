//! `platen history export`: the strokes of a history as one table, CSV or Parquet.

use std::io::Write as _;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use platen_history::{Filter, StrokeTable};

use super::open;
use crate::cli::{CliError, Common, output};

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  platen history export config/plant-north.toml > strokes.csv\n  \
                        platen history export config/plant-north.toml --out strokes.parquet\n\n\
                        One row a stroke: identity, times, verdict, data of the press (press.die_id, press.force, ...; newtons, metres, radians) \
                        and every figure (gap.max, deviation.rms, ...; metres, radians, seconds, shares of one). Unknown values are empty.")]
pub(super) struct Command {
    /// Plant file
    plant: PathBuf,
    /// File to write; stdout by default
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Format; by default that of the file name's ending, else CSV
    #[arg(long, value_enum)]
    format: Option<Format>,
    /// Only strokes of this plate, by its number in the history
    #[arg(long)]
    plate: Option<u32>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    Csv,
    Parquet,
}

pub(super) fn run(common: &Common, command: &Command) -> Result<(), CliError> {
    let (_, archive) = open(&command.plant)?;
    let strokes = archive.strokes(&Filter { plate: command.plate, ..Filter::default() })?;
    let table = StrokeTable::new(&strokes);
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
