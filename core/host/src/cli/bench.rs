//! Commands `platen bench` and `platen press soak`: their arguments, and the start of the program `platen-bench` that
//! runs them.
//!
//! `platen-bench` parses the same command line as `platen`, so that help, man pages and usage errors have one source.
//! It is a separate program because the computer of a plant does not need it.

use std::os::unix::process::CommandExt as _;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, ValueEnum};

use super::CliError;

/// A quarter of the finest scanner's resolution: 10,240 columns a turn.
pub const QUARTER_DEG: f64 = 360.0 / 10_240.0;

/// A part of the benchmark.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Part {
    /// Tables 1 to 4 of Masuda et al. beside this machine's figures
    Tables,
    /// Accuracy over many seeds: plates of every shape, strokes, templates
    Accuracy,
    /// Strokes to the target: the advice beside four shop strategies, on plates of a hidden steel
    Advice,
    /// Time and memory from 1.6 to 44 million cells
    Scale,
    /// All of these
    All,
}

/// A family of random scenes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum Family {
    /// Square edges, normal range errors
    #[default]
    Square,
    /// Edges with a double-V bevel of 20 to 40 degrees
    Bevel,
    /// Edges bowed by their cut: over 3 m by up to 1.7 mm
    Bowed,
    /// 5 % of the ranges with errors of four times the standard deviation of the others
    Tails,
    /// A table shows in one to two rows beyond the far edges
    Strip,
    /// A person stands before the nearest corner
    Hidden,
    /// The beam has power beyond its 1/e^2 width, to one and a half of it
    Wings,
    /// The beam consists of 13 rays, so that the mixing goes in steps
    Rays,
}

/// A lattice of the part `scale`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Cells {
    /// 1.6 million cells: the plate and its surroundings at a quarter of the finest resolution
    Quarter,
    /// 6.4 million cells: the same at half the step
    Half,
    /// 44 million cells: the scanner's whole field of view at quarter resolution
    Dome,
}

/// Arguments of `platen bench`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  platen bench\n  platen bench --flattening harmonic --repeat 11\n  \
                        platen bench --json | jq .tables.table_2\n  platen bench accuracy --seeds 50 --noise-mm 0.5,2 --threads 2\n  \
                        platen bench accuracy --random 40 --flattening harmonic --threads 2\n  \
                        platen bench accuracy --random 1 --seed 18026 --scans 24\n  platen bench advice --plates 100 --threads 2\n  platen bench scale --cells dome\n\n\
                        Scans come from the `simulated` driver library; the true shape is written beside them into --out. \
                        Times are processor time of one measurement, of both its threads, whatever --threads is.")]
pub struct BenchArguments {
    /// Parts to run
    #[arg(value_enum, default_value = "tables")]
    pub parts: Vec<Part>,
    /// Flattening plugins to compare
    #[arg(long, value_name = "NAME", value_delimiter = ',', default_value = "elastic,abf,harmonic")]
    pub flattening: Vec<String>,
    /// Seed of the scan's errors
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Repetitions of each timing; the median is reported
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = at_least_one)]
    pub repeat: usize,
    /// Seeds of `accuracy`, counted up from --seed
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = at_least_one)]
    pub seeds: usize,
    /// Random scenes of `accuracy` instead of the plates of a shop; seeds count up from --seed
    #[arg(long, value_name = "N", value_parser = at_least_one)]
    pub random: Option<usize>,
    /// Family of the random scenes: edges of the plate and errors of the scanner
    #[arg(long, value_enum, default_value_t, requires = "random")]
    pub family: Family,
    /// Scans of each random scene, with other noise and the plate moved by up to 30 mm and half a degree: their mean error is a bias
    #[arg(long, value_name = "N", default_value_t = 1, requires = "random", value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub scans: u64,
    /// Amplitude of the cyclic range error in every random scene, millimetres, instead of up to 0.3 mm in a third of them
    #[arg(long, value_name = "MM", requires = "random")]
    pub cyclic_mm: Option<f64>,
    /// Reflectivity of the plate in every random scene, 0.01 to 1, instead of 0.1 to 0.6
    #[arg(long, value_name = "SHARE", requires = "random", value_parser = reflectivity)]
    pub reflectivity: Option<f64>,
    /// File of `platen calibrate`: the scanner's error in the stated uncertainties, instead of the simulated instrument's own figure
    #[arg(long, value_name = "FILE", requires = "random")]
    pub calibration: Option<PathBuf>,
    /// Plates of `advice`, two fifths of them where a part or a press is varied; seeds count up from --seed
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    pub plates: u64,
    /// Threads that cast rays; those of `accuracy` also measure plates side by side
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = at_least_one)]
    pub threads: usize,
    /// Lattices of `scale`
    #[arg(long, value_enum, value_delimiter = ',', default_value = "quarter,half,dome")]
    pub cells: Vec<Cells>,
    /// Standard deviation of the range at 10 m, millimetres; `accuracy` takes several
    #[arg(long, value_name = "MM", value_delimiter = ',', default_value = "0.5")]
    pub noise_mm: Vec<f64>,
    /// Angle between cells of the scan of the tables, degrees; the default gives as many points as Masuda et al. have
    #[arg(long, value_name = "DEG", default_value_t = QUARTER_DEG)]
    pub step_deg: f64,
    /// Vertices of the meshes of table 3
    #[arg(long, value_name = "N", value_delimiter = ',', default_value = "1000,5000,10000,50000,100000")]
    pub meshes: Vec<usize>,
    /// Folder for descriptions and true shapes; an earlier benchmark there is replaced
    #[arg(long, value_name = "DIR", default_value = "platen-bench")]
    pub out: PathBuf,
}

/// Arguments of `platen press soak`.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  platen press soak -n 10000\n  platen press soak --line rtu --late 2% --reset 1%\n\n\
                        The exit code is 0 when no result is wrong, doubled or silently lost."
)]
pub struct SoakArguments {
    /// Number of strokes, rounded up to whole plates of 50
    #[arg(short = 'n', long, default_value_t = 300, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    pub strokes: u64,
    /// Share of requests that are answered late
    #[arg(long, default_value = "1%", value_parser = share)]
    pub late: f64,
    /// Share of requests at which the connection is reset; on a serial line the adapter is pulled
    #[arg(long, default_value = "0.5%", value_parser = share)]
    pub reset: f64,
    /// Transport of the Modbus frames
    #[arg(long, value_enum, default_value = "tcp")]
    pub line: Line,
    /// Time from one poll to the next, milliseconds
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub poll_ms: u64,
    /// Seed of faults and sessions
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

/// A transport of Modbus frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Line {
    /// Modbus TCP
    Tcp,
    /// RTU on a pseudo terminal
    Rtu,
    /// RTU frames through TCP
    RtuOverTcp,
}

fn at_least_one(text: &str) -> Result<usize, String> {
    text.parse().ok().filter(|n| *n >= 1).ok_or_else(|| "give a whole number of at least 1".to_owned())
}

/// Reads `1%` or `0.01`.
fn share(text: &str) -> Result<f64, String> {
    let (number, unit) = text.strip_suffix('%').map_or((text, 1.0), |number| (number, 0.01));
    let share = number.trim().parse::<f64>().map(|number| number * unit).map_err(|e| e.to_string())?;
    if (0.0..=0.2).contains(&share) { Ok(share) } else { Err("must lie between 0 and 20%".into()) }
}

fn reflectivity(text: &str) -> Result<f64, String> {
    let reflectivity = text.parse().ok().filter(|it| (0.01..=1.0).contains(it));
    reflectivity.ok_or_else(|| "give a number of 0.01 to 1".to_owned())
}

/// Replaces this process by `platen-bench` from the same folder, with the same arguments.
pub(super) fn start() -> Result<ExitCode, CliError> {
    let program =
        std::env::current_exe()?.with_file_name(format!("platen-bench{}", std::env::consts::EXE_SUFFIX));
    let error = std::process::Command::new(&program).args(std::env::args_os().skip(1)).exec();
    let text =
        format!("{}: cannot be started: {error}; `cargo build --release` builds it", program.display());
    Err(CliError::Failed(text))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_numbers_or_percentages() {
        assert_eq!(share("1%"), Ok(0.01));
        assert_eq!(share("0.005"), Ok(0.005));
        assert_eq!(reflectivity("0.35"), Ok(0.35));
        assert!(reflectivity("5").is_err() && reflectivity("NaN").is_err() && reflectivity("0").is_err());
        assert!(share("50%").is_err() && share("-1%").is_err() && share("x").is_err());
    }
}
