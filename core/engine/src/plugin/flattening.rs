//! Flattening plugins: they map the mid-surface mesh to a chart in the plane.

use std::time::Duration;

use platen_plant::OptionValue;
use platen_shape::{Chart, DiskMesh, Flatten, FlattenError};

use super::{Instance, Kind, Library, PluginError};

/// A configured flattening.
#[derive(Debug)]
pub struct Flattening {
    instance: Instance,
    limit: Duration,
}

impl Flattening {
    /// Creates a flattening from checked options; `limit` is the deadline of one mesh.
    ///
    /// # Errors
    /// As [`Instance::create`].
    pub fn create(library: &Library, values: &[OptionValue], limit: Duration) -> Result<Self, PluginError> {
        let instance = Instance::create(library, Kind::Flattening, values)?;
        instance.open(limit)?;
        Ok(Self { instance, limit })
    }

    /// Returns the flattening with another deadline.
    #[must_use]
    pub fn with_limit(self, limit: Duration) -> Self {
        Self { limit, ..self }
    }

    /// Returns the name in plant files.
    pub fn name(&self) -> &str {
        self.instance.name()
    }

    /// Returns the instance.
    pub fn instance(&self) -> &Instance {
        &self.instance
    }

    fn run(&self, mesh: &DiskMesh) -> Result<Chart, PluginError> {
        let inputs = [self.instance.input(mesh, None)?];
        self.instance.twice(|| {
            let mut job = self.instance.run(self.instance.evaluation(self.limit), &inputs)?;
            let mut answer = None;
            while let Some(frame) = job.next_frame() {
                if !frame.is::<Chart>() || answer.is_some() {
                    return Err(job.misbehaved(format!("a frame {} out of turn", frame.format)));
                }
                answer = Some(frame.decode().map_err(|e| job.misbehaved(format!("a malformed chart: {e}")))?);
            }
            job.finish()?;
            answer.ok_or_else(|| job.misbehaved("success without a chart"))
        })
    }
}

impl Flatten for Flattening {
    fn flatten(&mut self, mesh: &DiskMesh) -> Result<Chart, FlattenError> {
        let chart = self.run(mesh).map_err(|error| match error {
            PluginError::Stopped { .. } | PluginError::Hangs { .. } => {
                FlattenError::Stopped { reason: error.to_string() }
            }
            other => FlattenError::Refused {
                message: other.to_string(),
                hint: "try another [flattening] plugin, or scan again".into(),
            },
        })?;
        chart.check(mesh)?;
        Ok(chart)
    }
}
