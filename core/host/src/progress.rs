//! Progress line on stderr; nothing is printed if stderr is not a terminal.

use std::io::{IsTerminal, Write as _};

/// Replaces the progress line by the name of the work in progress.
pub fn phase(what: &str) {
    show(&format!("\r\x1b[2K{what} ..."));
}

/// Replaces the progress line by a name and the share done, 0 to 1.
pub fn share(what: &str, done: f64) {
    show(&format!("\r\x1b[2K{what} ... {:.0} %", done.min(1.0) * 100.0));
}

/// Clears the progress line.
pub fn done() {
    show("\r\x1b[2K");
}

fn show(text: &str) {
    let mut stderr = std::io::stderr();
    if stderr.is_terminal() {
        // A progress line that cannot be printed is not a failure.
        let _ = write!(stderr, "{text}").and_then(|()| stderr.flush());
    }
}
