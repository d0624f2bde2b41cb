//! Output of the verbs: lines, JSON and tables on stdout, errors on stderr.

use std::io::Write as _;

use super::CliError;

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

/// Prints a table: columns as wide as their widest cell, the first row is the head.
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
    // Nowhere is left to report a failing stderr.
    let _ = writeln!(std::io::stderr(), "platen: {text}");
}
