//! Strokes as a table for other programs, and two strokes side by side.

use std::collections::BTreeSet;
use std::io::Write;

use crate::archive::text;
use crate::{Error, Stroke};

/// One figure of two strokes; `None` where a stroke has none.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Difference {
    /// Name of the figure.
    pub name: String,
    /// Its value in the first stroke.
    pub first: Option<f64>,
    /// Its value in the second.
    pub second: Option<f64>,
}

/// Every figure that either stroke has, by name.
pub fn compare(first: &Stroke, second: &Stroke) -> Vec<Difference> {
    let names: BTreeSet<&String> = first.figures.keys().chain(second.figures.keys()).collect();
    let value = |stroke: &Stroke, name: &String| stroke.figures.get(name).copied();
    let row = |name: &String| Difference {
        name: name.clone(),
        first: value(first, name),
        second: value(second, name),
    };
    names.into_iter().map(row).collect()
}

/// Writes strokes as CSV (RFC 4180): one line each, then one column for every figure that any of them has.
///
/// # Errors
/// [`Error::Export`].
pub fn write_csv(strokes: &[Stroke], out: &mut impl Write) -> Result<(), Error> {
    let names: BTreeSet<&str> = strokes.iter().flat_map(|s| s.figures.keys().map(String::as_str)).collect();
    let columns = [
        "run_id", "press", "session", "stroke", "attempt", "plate", "recipe", "baseline", "dry_run",
        "accepted", "scanned", "finished", "acked", "verdict", "reason",
    ];
    line(out, columns.iter().copied().chain(names.iter().copied()).map(str::to_owned))?;
    for stroke in strokes {
        let key = stroke.key;
        let figures = names.iter().map(|name| optional(stroke.figures.get(*name)));
        let cells = [
            stroke.run_id.to_string(),
            key.press.to_string(),
            key.session.to_string(),
            key.stroke.to_string(),
            key.attempt.to_string(),
            stroke.plate.to_string(),
            optional(stroke.recipe),
            stroke.baseline.to_string(),
            stroke.dry_run.to_string(),
            text(stroke.accepted),
            optional(stroke.scanned.map(text)),
            optional(stroke.finished.map(text)),
            optional(stroke.acked.map(text)),
            optional(stroke.verdict.map(|verdict| verdict.as_str())),
            stroke.reason.clone().unwrap_or_default(),
        ];
        line(out, cells.into_iter().chain(figures))?;
    }
    Ok(())
}

fn optional(value: Option<impl ToString>) -> String {
    value.map(|value| value.to_string()).unwrap_or_default()
}

fn line(out: &mut impl Write, cells: impl Iterator<Item = String>) -> Result<(), Error> {
    let quoted = |cell: String| match cell.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", cell.replace('"', "\"\"")),
        false => cell,
    };
    write!(out, "{}\r\n", cells.map(quoted).collect::<Vec<_>>().join(","))?;
    Ok(())
}
