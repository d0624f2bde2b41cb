//! Command `platen screen`: creates the access token of the browser pages.

use std::fs::OpenOptions;
use std::io::Write as _;
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::PathBuf;
use std::process::ExitCode;

use base64::Engine as _;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use clap::{Args, Subcommand};

use super::{CliError, Common, output};

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  platen screen token /etc/platen/screen.token\n\n\
                        Pages on any address but loopback need a token. A browser gives it once, as ?token=... at the end of the address, \
                        and keeps it for 90 days.")]
pub(super) struct Command {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Make a token and write it to a new file that only its owner can read
    Token {
        /// File to make; name it as token_file in [screen]
        file: PathBuf,
    },
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    let Verb::Token { file } = &command.verb;
    let mut bytes = [0; 32];
    getrandom::fill(&mut bytes).map_err(|e| CliError::Failed(format!("no random numbers: {e}")))?;
    let token = URL_SAFE_NO_PAD.encode(bytes);
    let failed = |why: std::io::Error| match why.kind() {
        std::io::ErrorKind::AlreadyExists => CliError::Failed(format!(
            "{}: exists already and is not replaced; remove it first",
            file.display()
        )),
        _ => CliError::Failed(format!("{}: {why}", file.display())),
    };
    let mut out = OpenOptions::new().write(true).create_new(true).mode(0o600).open(file).map_err(failed)?;
    writeln!(out, "{token}").and_then(|()| out.sync_all()).map_err(failed)?;
    let text = format!(
        "wrote {}; in the plant file: [screen] token_file = {:?}; in the browser, once: http://HOST:8380/?token={token}",
        file.display(),
        file.display().to_string()
    );
    output::either(common, &serde_json::json!({ "file": file, "token": token }), &text)?;
    Ok(ExitCode::SUCCESS)
}
