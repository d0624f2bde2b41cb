//! `platen bench` and `platen press soak`: started as the program `platen-bench`, which lies beside this one.

use std::ffi::OsString;
use std::os::unix::process::CommandExt as _;
use std::process::{Command, ExitCode};

use clap::Args;

use super::{CliError, Common};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Arguments of platen-bench; --help lists them
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARGUMENTS")]
    arguments: Vec<OsString>,
}

/// Replaces this process by `platen-bench VERB ARGUMENTS`.
pub(super) fn run(common: &Common, verb: &str, arguments: &Arguments) -> Result<ExitCode, CliError> {
    let program =
        std::env::current_exe()?.with_file_name(format!("platen-bench{}", std::env::consts::EXE_SUFFIX));
    let mut command = Command::new(&program);
    command.arg(verb).args(&arguments.arguments);
    if let Some(plugins) = &common.plugins {
        command.arg("--plugins").arg(plugins);
    }
    if common.json {
        command.arg("--json");
    }
    let error = command.exec();
    let text =
        format!("{}: cannot be started: {error}; `cargo build --release` builds it", program.display());
    Err(CliError::Failed(text))
}
