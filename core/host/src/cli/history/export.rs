//! Command `platen history export`: the strokes of a history as one table (CSV or Parquet), or as one Parquet file for
//! each month.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use jiff::tz::TimeZone;
use platen_history::{Filter, Stroke, Table};
use platen_report::advice::AdviceRecord;
use platen_report::output_folder;

use super::open;
use crate::cli::selection::Selection;
use crate::cli::{CliError, Common, output};

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  platen history export config/plant-north.toml > strokes.csv\n  \
                        platen history export config/plant-north.toml --out strokes.parquet\n  \
                        platen history export config/plant-north.toml --by month --out lake --site north\n\n\
                        One row a stroke: identity, times, verdict, data of the press (press.die_id, press.force, ...; newtons, metres, radians) \
                        and every figure (gap.max, deviation.rms, ...; metres, radians, seconds, shares of one). advice.* is the stroke against the \
                        advice before it. Unknown values are empty.\n\
                        --by month writes DIR/site=SITE/year=YYYY/month=MM/press-N.parquet, months in UTC, and replaces each file by one rename: \
                        SELECT * FROM read_parquet('lake/**/*.parquet', hive_partitioning = true, union_by_name = true) in DuckDB.")]
pub(super) struct Command {
    /// Plant file
    plant: PathBuf,
    /// File to write, stdout by default; with --by the folder
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Format; by default that of the file name's ending, else CSV
    #[arg(long, value_enum, conflicts_with = "by")]
    format: Option<Format>,
    /// Write one Parquet file for each month, of the whole record
    #[arg(long, value_enum, requires = "out", conflicts_with = "Selection")]
    by: Option<Period>,
    /// Name of the site in the folders of --by; by default the plant's
    #[arg(long, requires = "by")]
    site: Option<String>,
    #[command(flatten)]
    selection: Selection,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    Csv,
    Parquet,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Period {
    Month,
}

pub(super) fn run(common: &Common, command: &Command) -> Result<(), CliError> {
    let (plant, archive) = open(&command.plant)?;
    if let (Some(Period::Month), Some(folder)) = (command.by, &command.out) {
        let site = command.site.as_deref().unwrap_or(&plant.name);
        let mut strokes = archive.strokes(&Filter::default())?;
        strokes.iter_mut().for_each(add_advice);
        return by_month(common, folder, site, &strokes);
    }
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

/// Adds the stroke's score against the advice before it to its figures, so that the coverage of the intervals can be
/// computed from the table.
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

/// Writes a file for each press and month; all have the same columns.
fn by_month(common: &Common, folder: &Path, site: &str, strokes: &[Stroke]) -> Result<(), CliError> {
    let table = Table::of_strokes(strokes);
    let mut months: BTreeMap<(i16, i8, u16), Vec<usize>> = BTreeMap::new();
    for (row, stroke) in strokes.iter().enumerate() {
        let day = stroke.accepted.to_zoned(TimeZone::UTC).date();
        months.entry((day.year(), day.month(), stroke.key.press)).or_default().push(row);
    }
    let mut files = Vec::new();
    for ((year, month, press), rows) in &months {
        let place = folder.join(format!("site={}/year={year:04}/month={month:02}", escaped(site)));
        std::fs::create_dir_all(&place)
            .map_err(|e| CliError::Failed(format!("{}: {e}; choose another --out", place.display())))?;
        let mut bytes = Vec::new();
        table.of_rows(rows).write_parquet(&mut bytes)?;
        files.push(output_folder::put(&place, &format!("press-{press}.parquet"), &bytes)?);
    }
    let text = format!("wrote {} strokes to {} files in {}", strokes.len(), files.len(), folder.display());
    output::either(common, &serde_json::json!({ "files": files, "strokes": strokes.len() }), &text)
}

/// Escapes a name for a folder in Hive's layout: percent encoding, which DuckDB and pyarrow decode.
fn escaped(name: &str) -> String {
    name.bytes().fold(String::new(), |mut text, byte| {
        if byte.is_ascii_alphanumeric() || b"-_.".contains(&byte) {
            text.push(byte.into());
        } else {
            // Writing to a String cannot fail.
            let _ = write!(text, "%{byte:02X}");
        }
        text
    })
}

#[cfg(test)]
mod tests {
    use super::escaped;

    #[test]
    fn a_site_is_one_folder_whatever_its_name() {
        assert_eq!(escaped("North hall, press 3"), "North%20hall%2C%20press%203");
        assert_eq!(escaped("a/../b=\u{c4}"), "a%2F..%2Fb%3D%C3%84");
    }
}
