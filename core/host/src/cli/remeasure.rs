//! Command `platen remeasure`: measures the strokes of a record again from their kept scans.

mod remeasurer;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::str::FromStr;

use clap::Args;
use platen_history::{Archive, Stroke, run_ids};
use platen_model::units::mm;
use platen_plant::PlantFile;
use platen_report::output_folder;
use serde_json::json;

use super::selection::Selection;
use super::{CliError, Common, output};
use crate::progress;
use remeasurer::{Difference, Outcome, Remeasured, Remeasurer, Row, result_folder, table};

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  platen remeasure config/plant-north.toml --out again --since 2026-05-01\n  \
                        platen remeasure config/plant-north.toml --out again --list strokes.parquet --compare\n  \
                        seq 3 | parallel --joblog J --resume-failed --retries 2 platen remeasure config/plant-north.toml --out again --shard {}/3\n  \
                        sbatch --array=1-200 --wrap 'platen remeasure config/plant-north.toml --out again --shard $SLURM_ARRAY_TASK_ID/200'\n\n\
                        Every stroke whose raw scan is kept is measured as platen measure does, one after the other. DIR gets a folder a \
                        stroke and one Parquet file a shard. A shard has whole plates. Started again it goes on: a result with the same scan, plate \
                        file, plugins, options and program is not made again. Lengths in the table are metres.\n\
                        The exit code is 1 when a file or a plugin failed; the others are measured all the same. A stroke that cannot be measured is a row with \
                        its reason."
)]
pub(super) struct Command {
    /// Plant file
    plant: PathBuf,
    /// Folder of the results, made if missing
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Only strokes of this file: Parquet or CSV with a column run_id, as `platen history export` writes it
    #[arg(long, value_name = "FILE")]
    list: Option<PathBuf>,
    #[command(flatten)]
    selection: Selection,
    /// Only part K of N, by whole plates, K from 1
    #[arg(long, value_name = "K/N", default_value = "1/1")]
    shard: Shard,
    /// Add the difference to the first result, with its uncertainty
    #[arg(long)]
    compare: bool,
}

/// Part `k` of `n`, from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Shard {
    k: usize,
    n: usize,
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('/').and_then(|(k, n)| Some((k.parse().ok()?, n.parse().ok()?)));
        let shard = parts.filter(|(k, n)| (1..=*n).contains(k)).map(|(k, n)| Self { k, n });
        shard.ok_or_else(|| "give K/N with K from 1 to N, e.g. 1/3".to_owned())
    }
}

impl Shard {
    /// Returns the strokes of this part: every n-th plate, with its strokes in their order.
    fn of(self, strokes: Vec<Stroke>) -> Vec<Stroke> {
        let mut plates: BTreeMap<u32, Vec<Stroke>> = BTreeMap::new();
        for stroke in strokes {
            plates.entry(stroke.plate).or_default().push(stroke);
        }
        plates.into_values().skip(self.k - 1).step_by(self.n).flatten().collect()
    }

    fn file(self) -> String {
        format!("part-{}-of-{}.parquet", self.k, self.n)
    }
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    let plant = PlantFile::load(&command.plant)?;
    let archive = Archive::open(&plant.output.history)?;
    let strokes = command.shard.of(selected(&archive, command)?);
    let folder = &command.out;
    std::fs::create_dir_all(folder)
        .map_err(|e| CliError::Failed(format!("{}: {e}; choose another --out", folder.display())))?;
    if same(folder, &plant.output.folder) {
        return Err(CliError::Usage(format!(
            "{}: holds the first results, which stay; choose another --out",
            folder.display()
        )));
    }
    let catalogue = common.catalogue();
    let mut remeasurer = Remeasurer::new(&plant, &catalogue, &archive, folder)?;
    let mut counts = Counts::default();
    let mut rows = Vec::new();
    let n_strokes = strokes.len();
    for (k, stroke) in strokes.into_iter().enumerate() {
        progress::share("remeasure", k as f64 / n_strokes as f64);
        let now = match remeasurer.measure(&stroke) {
            Ok(Outcome::Measured(now)) => counts.add(now, |counts| &mut counts.measured),
            Ok(Outcome::Skipped(now)) => counts.add(now, |counts| &mut counts.skipped),
            Ok(Outcome::NoScan) => {
                counts.without_scan += 1;
                continue;
            }
            Err(CliError::Failed(why) | CliError::Usage(why)) => {
                progress::done();
                tracing::error!("run {}: {why}", stroke.run_id);
                counts.failed.push((stroke.run_id, why));
                continue;
            }
        };
        let document = result_folder(folder, stroke.run_id).join("result.json");
        let difference = command.compare.then(|| Difference::of(&stroke, &now, &document));
        rows.push(Row { stroke, now, difference });
    }
    progress::done();
    let part = folder.join(command.shard.file());
    let mut bytes = Vec::new();
    table(&rows, command.compare).write_parquet(&mut bytes)?;
    output_folder::replace(&part, &bytes)?;
    print(common, command, &rows, &counts, &part)?;
    Ok(ExitCode::from(u8::from(!counts.failed.is_empty())))
}

/// Returns whether two paths denote the same folder.
fn same(a: &Path, b: &Path) -> bool {
    a.canonicalize().ok().zip(b.canonicalize().ok()).is_some_and(|(a, b)| a == b)
}

fn selected(archive: &Archive, command: &Command) -> Result<Vec<Stroke>, CliError> {
    let mut strokes = archive.strokes(&command.selection.filter(None))?;
    if let Some(list) = &command.list {
        let wanted: BTreeSet<u32> =
            run_ids(list).map_err(|e| CliError::Usage(e.to_string()))?.into_iter().collect();
        strokes.retain(|stroke| wanted.contains(&stroke.run_id));
    }
    Ok(strokes)
}

/// Numbers of strokes by outcome.
#[derive(Debug, Default)]
struct Counts {
    measured: usize,
    skipped: usize,
    without_scan: usize,
    /// Run id and reason.
    failed: Vec<(u32, String)>,
}

impl Counts {
    fn add(&mut self, now: Remeasured, count: fn(&mut Self) -> &mut usize) -> Remeasured {
        *count(self) += 1;
        now
    }
}

fn print(
    common: &Common,
    command: &Command,
    rows: &[Row],
    counts: &Counts,
    part: &Path,
) -> Result<(), CliError> {
    let changed = rows.iter().filter(|row| row.stroke.verdict.is_some_and(|first| first != row.now.verdict));
    let changed: Vec<u32> = changed.map(|row| row.stroke.run_id).collect();
    let Counts { measured, skipped, without_scan, failed } = counts;
    if common.json {
        let row = |row: &Row| {
            json!({ "run_id": row.stroke.run_id, "verdict": row.now.verdict, "reason": row.now.reason,
            "first": row.stroke.verdict, "difference": row.difference })
        };
        let failed = |(run_id, why): &(u32, String)| json!({ "run_id": run_id, "reason": why });
        return output::json(&json!({
            "part": part, "measured": measured, "skipped": skipped, "without_scan": without_scan,
            "failed": counts.failed.iter().map(failed).collect::<Vec<_>>(), "verdict_changed": changed,
            "strokes": rows.iter().map(row).collect::<Vec<_>>(),
        }));
    }
    if command.compare {
        let number = |value: Option<f64>| output::number(value.map(mm), 3);
        let cells = |row: &Row| {
            let difference = row.difference.as_ref();
            let gap = difference.and_then(|it| it.gap);
            let corners = difference.and_then(|it| it.corners);
            let first = row.stroke.verdict.map(|verdict| verdict.as_str().to_owned());
            vec![
                row.stroke.run_id.to_string(),
                first.unwrap_or_default(),
                row.now.verdict.as_str().to_owned(),
                number(gap.map(|it| it.value)),
                number(gap.map(|it| it.uncertainty)),
                number(corners.map(|it| it.value)),
                number(corners.map(|it| it.uncertainty)),
            ]
        };
        let head = "run | first | now | gap differs mm | +- mm | corners differ mm | +- mm";
        output::titled(head, rows.iter().map(cells))?;
    }
    let text = format!(
        "{measured} measured, {skipped} there already, {without_scan} without a scan, {} failed; {} with another verdict; wrote {}",
        failed.len(),
        changed.len(),
        part.display()
    );
    output::line(&text)
}

#[cfg(test)]
mod tests {
    use super::Shard;

    #[test]
    fn a_shard_is_k_of_n() {
        assert_eq!("2/3".parse(), Ok(Shard { k: 2, n: 3 }));
        for wrong in ["0/3", "4/3", "3", "a/3", "1/0", "-1/2", ""] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }
}
