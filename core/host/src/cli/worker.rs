//! Command `platen worker`: the process of one plugin, which the host starts with a socket as its standard input.

use std::process::ExitCode;

use clap::Args;

use super::CliError;

#[derive(Debug, Args)]
pub(super) struct Command {
    /// Name of the plugin, for lists of processes
    _plugin: String,
}

pub(super) fn run() -> Result<ExitCode, CliError> {
    platen_engine::plugin::serve_stdin().map_err(|why| CliError::Usage(why.to_string()))?;
    Ok(ExitCode::SUCCESS)
}
