//! Timed measurement of a scan in memory: the processor time of each stage.

use std::time::Duration;

use platen_engine::pipeline;
use platen_engine::plugin::{Catalogue, Flattening, Isolation};
use platen_engine::stroke::NotMeasured;
use platen_host::cli::CliError;
use platen_plant::PluginUse;
use platen_shape::Patch;
use platen_shape::measure::{Measurement, Timings, measure};
use platen_shape::outline::{Outline, outline};

use crate::machine::cpu_time;
use crate::scene::Shot;

/// Time limit of flattening one mesh, far longer than that of a press, for slow plugins and large meshes.
const FLATTENING_LIMIT: Duration = Duration::from_secs(120);

/// Processor time of each stage.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Stages {
    /// Extraction of the plate's face from the lattice.
    pub(super) extract: Duration,
    /// Boundary loop, corners, edges.
    pub(super) outline: Duration,
    /// Smooth face, mid-surface, mesh.
    pub(super) mesh: Duration,
    pub(super) flatten: Duration,
    /// Fit of S(u, v) and its covariance.
    pub(super) surface: Duration,
}

impl Stages {
    /// Returns the sum of all stages.
    pub(super) fn total(&self) -> Duration {
        self.extract + self.outline + self.mesh + self.flatten + self.surface
    }
}

/// Extracted face and outline, and their times.
pub(super) struct Seen {
    pub(super) patch: Patch,
    pub(super) outline: Outline,
    times: [Duration; 2],
}

/// Measurement with its intermediate results and times.
pub(super) struct Run {
    pub(super) seen: Seen,
    pub(super) measurement: Measurement,
    pub(super) stages: Stages,
}

/// Extracts the plate's face and outline from a scan.
pub(super) fn see(shot: &Shot) -> Result<Seen, NotMeasured> {
    let start = cpu_time();
    let patch = shot.extract()?;
    let extracted = cpu_time();
    let outline = outline(&patch, &shot.spec)?;
    let times = [extracted.saturating_sub(start), cpu_time().saturating_sub(extracted)];
    Ok(Seen { patch, outline, times })
}

/// Measures an extracted plate.
pub(super) fn shape(
    shot: &Shot,
    seen: &Seen,
    flattening: &mut Flattening,
) -> Result<Measurement, NotMeasured> {
    Ok(measure(&seen.patch, &seen.outline, &shot.spec, &shot.blank, flattening, &mut cpu_time)?)
}

/// Extracts and measures.
pub(super) fn run(shot: &Shot, flattening: &mut Flattening) -> Result<Run, NotMeasured> {
    let seen = see(shot)?;
    let measurement = shape(shot, &seen, flattening)?;
    let [extract, outline] = seen.times;
    let Timings { mesh, flatten, surface } = measurement.timings;
    let stages = Stages { extract, outline, mesh, flatten, surface };
    Ok(Run { seen, measurement, stages })
}

/// Returns the median; for an even number of times, the smaller of the two in the middle.
pub(super) fn median(mut times: Vec<Duration>) -> Duration {
    times.sort_unstable();
    times.get(times.len().saturating_sub(1) / 2).copied().unwrap_or_default()
}

/// Returns milliseconds, rounded to microseconds.
pub(super) fn ms(time: Duration) -> f64 {
    (time.as_secs_f64() * 1e6).round() / 1e3
}

/// Loads the flattening plugins with these names and their default options in threads of this process, so that its time
/// and memory include theirs.
pub(crate) fn flattenings(catalogue: &Catalogue, names: &[String]) -> Result<Vec<Flattening>, CliError> {
    let catalogue = &catalogue.clone().isolated(Isolation::InProcess);
    let load = |name: &String| {
        let (library, values) = pipeline::load(catalogue, &PluginUse::by_default(name))?;
        Ok(Flattening::create(&library, &values, FLATTENING_LIMIT)?)
    };
    names.iter().map(load).collect()
}
