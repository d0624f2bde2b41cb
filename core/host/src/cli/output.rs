//! Output of the commands: lines, JSON and tables on stdout, errors on stderr.

use std::io::Write as _;
use std::path::Path;

use super::{CliError, Common};

/// Prints one line to stdout; a closed pipe ends the output quietly.
pub fn line(text: &str) -> Result<(), CliError> {
    match writeln!(std::io::stdout(), "{text}") {
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        other => Ok(other?),
    }
}

/// Prints a document as JSON.
pub fn json(document: &impl serde::Serialize) -> Result<(), CliError> {
    let text = serde_json::to_string_pretty(document).map_err(|e| CliError::Failed(e.to_string()))?;
    line(&text)
}

/// Prints the document with `--json`, else the line.
pub fn either(common: &Common, document: &impl serde::Serialize, text: &str) -> Result<(), CliError> {
    if common.json { json(document) } else { line(text) }
}

/// Formats a number; an unknown one gives an empty cell.
pub fn number(value: Option<f64>, digits: usize) -> String {
    value.map(|value| format!("{value:.digits$}")).unwrap_or_default()
}

/// Prints a table with this head, whose cells are separated by ` | `.
pub fn titled(head: &str, rows: impl IntoIterator<Item = Vec<String>>) -> Result<(), CliError> {
    let head = head.split(" | ").map(str::to_owned).collect();
    table(&std::iter::once(head).chain(rows).collect::<Vec<_>>())
}

/// Prints a table: columns as wide as their widest cell; the first row is the head.
pub fn table(rows: &[Vec<String>]) -> Result<(), CliError> {
    let n_columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |k: usize| {
        rows.iter().filter_map(|row| row.get(k)).map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..n_columns).map(width).collect();
    for row in rows {
        let cells: Vec<String> =
            row.iter().zip(&widths).map(|(cell, width)| format!("{cell:<width$}")).collect();
        line(cells.join("  ").trim_end())?;
    }
    Ok(())
}

/// Prints one error line to stderr.
pub fn error(text: &str) {
    // A failing stderr cannot be reported anywhere.
    let _ = writeln!(std::io::stderr(), "platen: {text}");
}

/// Creates an empty folder for the files of a command; it replaces only a folder that an earlier run of the command
/// made.
///
/// # Errors
/// The folder exists and is not marked with `.platen-VERB`, or the system refuses.
pub fn fresh_folder(folder: &Path, verb: &str) -> Result<(), CliError> {
    let mark = folder.join(format!(".platen-{verb}"));
    let failed = |error: std::io::Error| {
        CliError::Failed(format!(
            "{}: {error}; if another `platen {verb}` is writing there, give another --out",
            folder.display()
        ))
    };
    if folder.exists() {
        if !mark.is_file() {
            let text = format!(
                "{}: exists and was not made by `platen {verb}`; give another --out",
                folder.display()
            );
            return Err(CliError::Usage(text));
        }
        std::fs::remove_dir_all(folder).map_err(failed)?;
    }
    std::fs::create_dir_all(folder).map_err(failed)?;
    std::fs::write(mark, format!("made by `platen {verb}`, which may replace this folder\n")).map_err(failed)
}
