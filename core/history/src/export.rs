//! Export of strokes as a table, with one row for each stroke.
//!
//! It has a column for every figure of any stroke and for every value of the press (`press.` and its name).

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

use crate::Stroke;
use crate::table::{Columns, Table};

impl Table {
    /// Creates the table of `strokes`, in their order.
    pub fn of_strokes(strokes: &[Stroke]) -> Self {
        let rows: Vec<Row<'_>> = strokes.iter().map(Row::of).collect();
        let columns = Columns::of(&rows)
            .unsigned("run_id", |s| Some(s.stroke.run_id))
            .unsigned("press", |s| Some(s.stroke.key.press.into()))
            .unsigned("session", |s| Some(s.stroke.key.session.into()))
            .unsigned("stroke", |s| Some(s.stroke.key.stroke.into()))
            .unsigned("attempt", |s| Some(s.stroke.key.attempt.into()))
            .unsigned("plate", |s| Some(s.stroke.plate))
            .unsigned("recipe", |s| s.stroke.recipe.map(u32::from))
            .boolean("baseline", |s| Some(s.stroke.baseline))
            .boolean("dry_run", |s| Some(s.stroke.dry_run))
            .time("accepted", |s| Some(s.stroke.accepted))
            .time("scanned", |s| s.stroke.scanned)
            .time("finished", |s| s.stroke.finished)
            .time("acked", |s| s.stroke.acked)
            .text("verdict", |s| s.stroke.verdict.map(|verdict| verdict.as_str().to_owned()))
            .text("reason", |s| s.stroke.reason.clone());
        let mut columns = with_press(columns, &rows);
        let names: BTreeSet<&String> = strokes.iter().flat_map(|stroke| stroke.figures.keys()).collect();
        for name in names {
            columns = columns.float(name, |row| row.stroke.figures.get(name).copied());
        }
        columns.table()
    }
}

/// Stroke with the parsed data of the press.
struct Row<'a> {
    stroke: &'a Stroke,
    press: BTreeMap<String, Value>,
}

impl<'a> Row<'a> {
    fn of(stroke: &'a Stroke) -> Self {
        Self { stroke, press: serde_json::from_str(&stroke.data).unwrap_or_default() }
    }

    fn press(&self, name: &str) -> Option<&Value> {
        self.press.get(name).filter(|value| !value.is_null())
    }
}

/// Adds the values of the press that are single numbers, texts or booleans in every stroke.
fn with_press<'a, 'b>(mut columns: Columns<'a, Row<'b>>, rows: &[Row<'_>]) -> Columns<'a, Row<'b>> {
    let names: BTreeSet<&String> = rows.iter().flat_map(|row| row.press.keys()).collect();
    // The other two have a column of their own.
    for name in names.into_iter().filter(|name| !["baseline", "dry_run"].contains(&name.as_str())) {
        let values = || rows.iter().filter_map(|row| row.press(name));
        let every = |is: fn(&Value) -> bool| values().next().is_some() && values().all(is);
        let column = format!("press.{name}");
        if every(Value::is_number) {
            columns = columns.float(&column, |row| row.press(name)?.as_f64());
        } else if every(Value::is_boolean) {
            columns = columns.boolean(&column, |row| row.press(name)?.as_bool());
        } else if every(Value::is_string) {
            columns = columns.text(&column, |row| row.press(name)?.as_str().map(str::to_owned));
        }
    }
    columns
}
