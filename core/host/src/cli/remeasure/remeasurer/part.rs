//! Table of a shard: one row for each result, with the same columns in every shard.

use platen_history::{Columns, Stroke, Table};
use platen_model::Measure;

use super::Remeasured;
use super::comparison::{Difference, WithUncertainty};

/// Stroke with its result, and the difference from the first one if it was requested.
#[derive(Debug)]
pub(crate) struct Row {
    pub(crate) stroke: Stroke,
    pub(crate) now: Remeasured,
    pub(crate) difference: Option<Difference>,
}

/// Makes the table; `compared` adds the columns `first.` and `difference.`.
pub(crate) fn table(rows: &[Row], compared: bool) -> Table {
    let mut columns = Columns::of(rows)
        .unsigned("run_id", |row| Some(row.stroke.run_id))
        .unsigned("press", |row| Some(row.stroke.key.press.into()))
        .unsigned("session", |row| Some(row.stroke.key.session.into()))
        .unsigned("stroke", |row| Some(row.stroke.key.stroke.into()))
        .unsigned("attempt", |row| Some(row.stroke.key.attempt.into()))
        .unsigned("plate", |row| Some(row.stroke.plate))
        .unsigned("recipe", |row| row.stroke.recipe.map(u32::from))
        .boolean("baseline", |row| Some(row.stroke.baseline))
        .boolean("dry_run", |row| Some(row.stroke.dry_run))
        .time("accepted", |row| Some(row.stroke.accepted))
        .text("software", |row| Some(row.now.software.clone()))
        .text("program_sha256", |row| Some(row.now.inputs.setup.program.clone()))
        .text("plate_file_sha256", |row| Some(row.now.inputs.plate_file.clone()))
        .text("scan_sha256", |row| Some(row.now.inputs.scan.clone()))
        .text("verdict", |row| Some(row.now.verdict.as_str().to_owned()))
        .text("reason", |row| row.now.reason.clone());
    // Times of the stroke, and the clock that gave them, are left out.
    let times = [Measure::ScanTime, Measure::EvaluateTime, Measure::StrokeToResultTime, Measure::ClockError];
    for measure in Measure::ALL.iter().filter(|measure| !times.contains(measure)) {
        columns = columns.float(measure.name(), |row| row.now.figures.get(measure.name()).copied());
    }
    if !compared {
        return columns.table();
    }
    columns = columns
        .text("first.software", |row| row.difference.as_ref()?.software.clone())
        .text("first.verdict", |row| row.stroke.verdict.map(|verdict| verdict.as_str().to_owned()));
    columns = difference(columns, "gap.max", |difference| difference.gap);
    columns = difference(columns, "corners", |difference| difference.corners);
    difference(columns, "markers", |difference| difference.markers).table()
}

/// Adds a difference and its uncertainty.
fn difference<'a>(
    columns: Columns<'a, Row>,
    name: &str,
    take: fn(&Difference) -> Option<WithUncertainty>,
) -> Columns<'a, Row> {
    let of = move |row: &Row| row.difference.as_ref().and_then(take);
    columns
        .float(&format!("difference.{name}"), move |row| of(row).map(|it| it.value))
        .float(&format!("difference.{name}.uncertainty"), move |row| of(row).map(|it| it.uncertainty))
}
