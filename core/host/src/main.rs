//! Program `platen`.

use std::process::ExitCode;

fn main() -> ExitCode {
    platen_host::cli::main()
}
