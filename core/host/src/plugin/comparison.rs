//! Comparisons as the host sees them.

use std::time::Duration;

use platen_abi::payload::{self, Header, Malformed};
use platen_model::{Field, Findings, NodeState, Report, Task};
use platen_plant::OptionValue;
use platen_shape::surface::Surface;

use super::instance::InputFrame;
use super::job::HostBuffer;
use super::{Instance, JobSpec, Kind, Library, PluginError, surface};

/// Largest field believed: 4 million numbers.
const MAX_FIELD: usize = 1 << 22;

/// A comparison with its options.
#[derive(Debug)]
pub struct Comparison {
    instance: Instance,
    limit: Duration,
}

/// The surfaces of a plate that a comparison may look at.
#[derive(Debug, Clone, Copy)]
pub struct Surfaces<'a> {
    /// The plate now.
    pub now: &'a Surface,
    /// The plate at the stroke before.
    pub before: Option<&'a Surface>,
    /// The plate before the first stroke.
    pub baseline: Option<&'a Surface>,
}

impl Comparison {
    /// Makes a comparison of checked options; `limit` is the time for one plate.
    ///
    /// # Errors
    /// As [`Instance::create`].
    pub fn create(library: &Library, values: &[OptionValue], limit: Duration) -> Result<Self, PluginError> {
        let instance = Instance::create(library, Kind::Comparison, values)?;
        instance.open(limit)?;
        Ok(Self { instance, limit })
    }

    /// Name in plant files.
    pub fn name(&self) -> &str {
        self.instance.name()
    }

    /// Compares.
    ///
    /// # Errors
    /// The plugin's reason, its deadline, or what was wrong with what it sent.
    pub fn compare(&self, task: &Task, surfaces: Surfaces<'_>) -> Result<Report, PluginError> {
        let misbehaved =
            |what: String| PluginError::Misbehaved { name: self.instance.name().to_owned(), what };
        let mut inputs =
            vec![task_frame(task).map_err(|e| misbehaved(format!("a task it cannot be sent: {e}")))?];
        inputs.push(surface_frame(surfaces.now, c"now"));
        inputs.extend(surfaces.before.map(|s| surface_frame(s, c"before")));
        inputs.extend(surfaces.baseline.map(|s| surface_frame(s, c"baseline")));

        let mut job = self.instance.start(JobSpec::untriggered(self.limit), inputs);
        let (mut findings, mut fields) = (None, Vec::new());
        while let Some(frame) = job.next_frame() {
            let is = |format: &std::ffi::CStr| frame.format.as_bytes() == format.to_bytes();
            if is(payload::FINDINGS) && findings.is_none() {
                let read = serde_json::from_slice::<Findings>(frame.bytes());
                findings = Some(read.map_err(|e| misbehaved(format!("findings that cannot be read: {e}")))?);
            } else if is(payload::Grid::FORMAT) {
                let field =
                    field(frame.bytes()).map_err(|e| misbehaved(format!("a malformed field: {e}")))?;
                fields.push(field.ok_or_else(|| misbehaved("a field that does not fit its grid".into()))?);
            } else {
                return Err(misbehaved(format!("a frame {} out of turn", frame.format)));
            }
        }
        job.finish()?;
        let findings = findings.ok_or_else(|| misbehaved("success without findings".into()))?;
        Ok(Report { comparison: self.instance.name().to_owned(), findings, fields })
    }
}

fn task_frame(task: &Task) -> Result<InputFrame, serde_json::Error> {
    let text = serde_json::to_vec(task)?;
    let mut buffer = HostBuffer::new(text.len());
    buffer.bytes_mut().copy_from_slice(&text);
    Ok(InputFrame { format: payload::TASK, role: None, buffer })
}

fn surface_frame(surface: &Surface, role: &'static std::ffi::CStr) -> InputFrame {
    InputFrame { format: payload::Surface::FORMAT, role: Some(role), buffer: surface::buffer(surface) }
}

/// `None` when the field does not fit its grid or holds numbers that are none.
fn field(bytes: &[u8]) -> Result<Option<Field>, Malformed> {
    let head: payload::Grid = payload::read(bytes)?;
    let state = |code: &u8| match code {
        1 => NodeState::Seen,
        2 => NodeState::Unchanged,
        _ => NodeState::Unseen,
    };
    let field = Field {
        name: payload::text(bytes, head.name)?,
        unit: payload::text(bytes, head.unit)?,
        nodes: [head.n_u as usize, head.n_v as usize],
        components: head.components as usize,
        values: payload::slice::<f64>(bytes, head.values)?.to_vec(),
        state: payload::slice::<u8>(bytes, head.state)?.iter().map(state).collect(),
    };
    let nodes = field.nodes[0].saturating_mul(field.nodes[1]);
    let numbers = nodes.saturating_mul(field.components);
    let sound =
        (1..=MAX_FIELD).contains(&numbers) && field.values.len() == numbers && field.state.len() == nodes;
    let known = |(i, value): (usize, &f64)| {
        value.is_finite() || field.state.get(i / field.components) == Some(&NodeState::Unseen)
    };
    Ok((sound && field.values.iter().enumerate().all(known)).then_some(field))
}
