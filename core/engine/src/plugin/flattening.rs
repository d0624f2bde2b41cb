//! Flattening plugins: from the mid-surface mesh to a chart.

use std::time::Duration;

use platen_plant::OptionValue;
use platen_shape::{Chart, DiskMesh, Flatten, FlattenError};

use super::instance::InputFrame;
use super::{Instance, JobSpec, Kind, Library, PluginError};

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

    /// Returns the name in plant files.
    pub fn name(&self) -> &str {
        self.instance.name()
    }

    fn run(&self, mesh: &DiskMesh) -> Result<Chart, PluginError> {
        let mut job =
            self.instance.start(JobSpec::untriggered(self.limit), vec![InputFrame::new(mesh, None)]);
        let mut answer = None;
        while let Some(frame) = job.next_frame() {
            if !frame.is::<Chart>() || answer.is_some() {
                return Err(self.instance.misbehaved(format!("a frame {} out of turn", frame.format)));
            }
            answer = Some(
                frame.decode().map_err(|e| self.instance.misbehaved(format!("a malformed chart: {e}")))?,
            );
        }
        job.finish()?;
        answer.ok_or_else(|| self.instance.misbehaved("success without a chart"))
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
