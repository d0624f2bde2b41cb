//! `platen bench`: the paper's tables, and how accurate, fast and frugal the method is on simulated scans.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use clap::{Args, ValueEnum};
use platen_plant::PluginUse;
use serde_json::json;

use platen_host::cli::{CliError, Common, output};

use crate::machine::Machine;
use crate::{scale, seeds, tables};
use platen_engine::pipeline;
use platen_engine::plugin::{Catalogue, Flattening};

/// Time for one mesh: far beyond what a press would wait, for peers and large meshes.
const FLATTENING_LIMIT: Duration = Duration::from_secs(120);

/// Tells a folder of an earlier bench from one that holds something else.
const MARK: &str = ".platen-bench";

/// What is to be found out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Part {
    /// The paper's tables 1 to 4 beside this machine's figures
    Tables,
    /// Accuracy over many seeds: plates of every shape, strokes, templates
    Accuracy,
    /// Time and memory from 1.6 to 44 million cells
    Scale,
    /// All of these
    All,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  platen bench\n  platen bench --flattening harmonic --repeat 11\n  \
                        platen bench --json | jq .tables.table_2\n  platen bench accuracy --seeds 50 --noise-mm 0.5,2 --threads 2\n  \
                        platen bench scale --cells dome\n\n\
                        Scans come from the `simulated` driver library; what a measurement should find is written beside them into --out. \
                        A measurement runs on one thread by design: times are processor time of one measurement, whatever --threads says.")]
pub(crate) struct Command {
    /// What to find out
    #[arg(value_enum, default_value = "tables")]
    parts: Vec<Part>,
    /// Flattening plugins to compare
    #[arg(long, value_name = "NAME", value_delimiter = ',', default_value = "elastic,abf,harmonic")]
    pub(crate) flattening: Vec<String>,
    /// Seed of the scan's errors
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// How often times are taken; their median counts
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = at_least_one)]
    pub(crate) repeat: usize,
    /// Seeds of `accuracy`, counted up from --seed
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = at_least_one)]
    pub(crate) seeds: usize,
    /// Threads that cast rays; those of `accuracy` also measure plates side by side
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = at_least_one)]
    pub(crate) threads: usize,
    /// Lattices of `scale`
    #[arg(long, value_enum, value_delimiter = ',', default_value = "quarter,half,dome")]
    pub(crate) cells: Vec<scale::Cells>,
    /// Standard deviation of the range at 10 m, millimetres; `accuracy` takes several
    #[arg(long, value_name = "MM", value_delimiter = ',', default_value = "0.5")]
    pub(crate) noise_mm: Vec<f64>,
    /// Angle between cells of the scan of the tables, degrees; the default gives the paper's number of points
    #[arg(long, value_name = "DEG", default_value_t = tables::QUARTER_DEG)]
    pub(crate) step_deg: f64,
    /// Vertices of the meshes of table 3
    #[arg(long, value_name = "N", value_delimiter = ',', default_value = "1000,5000,10000,50000,100000")]
    pub(crate) meshes: Vec<usize>,
    /// Folder for descriptions and truths; an earlier bench there is replaced
    #[arg(long, value_name = "DIR", default_value = "platen-bench")]
    pub(crate) out: PathBuf,
}

fn at_least_one(text: &str) -> Result<usize, String> {
    text.parse().ok().filter(|n| *n >= 1).ok_or_else(|| "give a whole number of at least 1".to_owned())
}

pub(crate) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    prepare(&command.out)?;
    let catalogue = common.catalogue();
    let machine = Machine::here();
    if !common.json {
        output::line(&machine.says())?;
    }
    let mut document = json!({ "machine": machine });
    let wanted = |part: Part| command.parts.iter().any(|p| [part, Part::All].contains(p));
    if wanted(Part::Tables) {
        document["tables"] = tables::tables(&catalogue, &command.out, command, common.json)?;
    }
    if wanted(Part::Accuracy) {
        document["accuracy"] = seeds::accuracy(&catalogue, &command.out, command, common.json)?;
    }
    if wanted(Part::Scale) {
        document["scale"] = scale::scale(common, command)?;
    }
    if common.json {
        output::json(&document)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Makes an empty folder; only an earlier bench is removed.
fn prepare(out: &Path) -> Result<(), CliError> {
    if out.exists() {
        if !out.join(MARK).is_file() {
            let text = format!("{}: exists and is no earlier bench; give another --out", out.display());
            return Err(CliError::Usage(text));
        }
        std::fs::remove_dir_all(out)?;
    }
    std::fs::create_dir_all(out)?;
    Ok(std::fs::write(out.join(MARK), "made by `platen bench`, which may replace this folder\n")?)
}

/// The flattening plugins of these names, each with its default options.
pub(crate) fn flattenings(catalogue: &Catalogue, names: &[String]) -> Result<Vec<Flattening>, CliError> {
    let load = |name: &String| {
        let (library, values) = pipeline::load(catalogue, &PluginUse::by_default(name))?;
        Ok(Flattening::create(&library, &values, FLATTENING_LIMIT)?)
    };
    names.iter().map(load).collect()
}
