//! Command `platen convert`: writes a scan file in another format.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;

use super::scan_source::{self, READ_LIMIT};
use super::{CliError, Common, scan};
use platen_formats::ScanFile;

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  platen convert scan.ptx scan.e57\n  platen convert two-scans.e57 second.xyb --cloud 2\n\n\
                        The lattice is written as it was oriented: row 0 at the top, columns by growing azimuth, \
                        right-handed, metres, in the scanner's own frame."
)]
pub(super) struct Command {
    /// Scan file: structured E57, PTX, XYZ with row and column, XYB
    input: PathBuf,
    /// New file; its ending selects the format: .e57, .ptx, .xyz or .xyb
    output: PathBuf,
    /// Which scan of a file that holds several, from 1
    #[arg(long, value_name = "N")]
    cloud: Option<u32>,
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    let (input, output) = (&command.input, &command.output);
    scan::check_output(output)?;
    let scanner = scan_source::open(&common.catalogue(), input, command.cloud)?;
    let what = format!("converting {}", input.display());
    let file = ScanFile::create(output)?;
    let written = scan_source::follow(&scanner, READ_LIMIT, None, &what, Some(input))?.write(file)?;
    scan::say(common, output, &written)
}
