//! One measurement of a scan in memory, stage by stage, in processor time.

use std::time::Duration;

use platen_shape::Patch;
use platen_shape::measure::{Measurement, measure};
use platen_shape::outline::{Outline, outline};

use super::machine::cpu_time;
use super::scene::Shot;
use crate::plugin::Flattening;
use crate::stroke::NotMeasured;

/// Processor time of each stage.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Stages {
    /// From the lattice to the plate's face.
    pub(super) extract: Duration,
    /// Loop, corners, edges.
    pub(super) outline: Duration,
    /// Smooth face, mid-surface, mesh.
    pub(super) mesh: Duration,
    /// Flattening.
    pub(super) flatten: Duration,
    /// S(u, v) and its covariance.
    pub(super) surface: Duration,
}

impl Stages {
    /// All of them.
    pub(super) fn total(&self) -> Duration {
        self.extract + self.outline + self.mesh + self.flatten + self.surface
    }
}

/// What came out, and after how long.
pub(super) struct Run {
    pub(super) patch: Patch,
    pub(super) outline: Outline,
    pub(super) measurement: Measurement,
    pub(super) stages: Stages,
}

/// Measures a scan.
pub(super) fn run(shot: &Shot, flattening: &mut Flattening) -> Result<Run, NotMeasured> {
    let start = cpu_time();
    let patch = shot.extract()?;
    let extracted = cpu_time();
    let outline = outline(&patch, &shot.spec)?;
    let outlined = cpu_time();
    let measurement = measure(&patch, &outline, &shot.spec, flattening, &mut cpu_time)?;
    let stages = Stages {
        extract: extracted.saturating_sub(start),
        outline: outlined.saturating_sub(extracted),
        mesh: measurement.timings.mesh,
        flatten: measurement.timings.flatten,
        surface: measurement.timings.surface,
    };
    Ok(Run { patch, outline, measurement, stages })
}

/// The middle of several times; of an even number, the smaller of the two in the middle.
pub(super) fn median(mut times: Vec<Duration>) -> Duration {
    times.sort_unstable();
    times.get(times.len().saturating_sub(1) / 2).copied().unwrap_or_default()
}

/// Milliseconds with a thousandth.
pub(super) fn ms(time: Duration) -> f64 {
    (time.as_secs_f64() * 1e6).round() / 1e3
}
