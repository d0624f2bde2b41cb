//! Progress on a terminal; silent in a pipe.

use std::io::{IsTerminal, Write as _};

/// Shows what is being done, in place of what was shown before.
pub fn phase(what: &str) {
    show(&format!("\r\x1b[2K{what} ..."));
}

/// Shows how much of it is done, 0 to 1.
pub fn share(what: &str, done: f64) {
    show(&format!("\r\x1b[2K{what} ... {:.0} %", done.min(1.0) * 100.0));
}

/// Takes the progress line away.
pub fn done() {
    show("\r\x1b[2K");
}

fn show(text: &str) {
    let mut stderr = std::io::stderr();
    if stderr.is_terminal() {
        // Progress that cannot be shown is no failure.
        let _ = write!(stderr, "{text}").and_then(|()| stderr.flush());
    }
}
