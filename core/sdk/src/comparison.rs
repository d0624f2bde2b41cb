//! Comparison plugins: trait, inputs, frames of the boundary.

use std::ffi::c_char;

use platen_abi::payload::{self, Header, Layout};
use platen_abi::{desc_flag, frame_flag};
use platen_model::{Field, Findings, Report, Task};
use platen_shape::surface::{Surface, SurfaceParts};

use crate::shim::{Input, Plugin, describe, malformed};
use crate::sink::Payload;
use crate::{Error, ErrorKind, Info, Job, Options, Result, Values};

/// Plugin that compares the plate with the stroke before, with the baseline, or with its target.
pub trait Comparison: Send + Sized + 'static {
    /// Description of the plugin.
    const INFO: Info;
    /// Options of the plugin; `()` for none.
    type Options: Options;

    /// Creates the plugin from checked options.
    ///
    /// # Errors
    /// When the options contradict each other.
    fn new(options: Self::Options) -> Result<Self>;

    /// Returns the report of a comparison. Deterministic: equal inputs give equal reports, to the last bit.
    ///
    /// # Errors
    /// When the task cannot be carried out, or the job was cancelled.
    fn compare(&mut self, job: &Job<'_>, inputs: &Inputs) -> Result<Report>;
}

/// Inputs of a comparison.
#[derive(Debug, Clone)]
pub struct Inputs {
    /// Plate, target, lines, templates, stations, calibration.
    pub task: Task,
    /// Surface of this scan.
    pub now: Surface,
    /// Surface of the stroke before.
    pub before: Option<Surface>,
    /// Surface of the blank, before the first stroke.
    pub baseline: Option<Surface>,
}

impl Inputs {
    /// Returns the earlier surface by name, `before` or `baseline`; `None` when there is no such scan.
    ///
    /// # Errors
    /// [`ErrorKind::BadData`] when it is of another plate: scans of one plate have equal size, from the plate file.
    pub fn earlier(&self, against: &str) -> Result<Option<&Surface>> {
        const SAME_SIZE: f64 = 1e-6;
        let earlier = if against == "before" { &self.before } else { &self.baseline };
        let Some(earlier) = earlier else { return Ok(None) };
        let size = |s: &Surface| [s.width(), s.height()];
        let (now, then) = (size(&self.now), size(earlier));
        if now.iter().zip(&then).all(|(a, b)| (a - b).abs() <= SAME_SIZE) {
            return Ok(Some(earlier));
        }
        let mm = |[w, h]: [f64; 2]| format!("{:.0} x {:.0} mm", w * 1000.0, h * 1000.0);
        let message =
            format!("the plate measures {}, the one before {}: not the same plate", mm(now), mm(then));
        Err(Error::new(ErrorKind::BadData, message).hint("give a scan of the same plate"))
    }
}

/// Adapter of a [`Comparison`] to the boundary.
#[derive(Debug)]
pub struct ComparisonPlugin<C>(C);

const INPUTS: &[*const c_char] =
    &[payload::TASK.as_ptr(), payload::Surface::FORMAT.as_ptr(), std::ptr::null()];
const OUTPUTS: &[*const c_char] =
    &[payload::FINDINGS.as_ptr(), payload::Grid::FORMAT.as_ptr(), std::ptr::null()];

impl<C: Comparison> Plugin for ComparisonPlugin<C> {
    const DESC: platen_abi::Desc = describe::<C::Options>(c"comparison", C::INFO, INPUTS, OUTPUTS);

    fn create(values: &Values<'_>) -> Result<Self> {
        const { assert!(C::INFO.flags & desc_flag::HARDWARE == 0, "a comparison drives no hardware") };
        C::new(C::Options::from_values(values)?).map(Self)
    }

    fn run(&mut self, job: &Job<'_>, inputs: &[Input<'_>]) -> Result<()> {
        let report = self.0.compare(job, &read(inputs)?)?;
        for field in &report.fields {
            emit_field(job, field)?;
        }
        emit_findings(job, &report.findings)
    }
}

fn read(inputs: &[Input<'_>]) -> Result<Inputs> {
    let bad = |what: String| Error::new(ErrorKind::BadData, what);
    let task = inputs
        .iter()
        .find(|i| i.format == payload::TASK)
        .ok_or_else(|| bad("the host sent no task".into()))?;
    let surface = |role: &std::ffi::CStr| {
        let mut with_role =
            inputs.iter().filter(|i| i.format == payload::Surface::FORMAT && i.role == Some(role));
        with_role.next().map(|input| surface(input.bytes)).transpose()
    };
    Ok(Inputs {
        task: serde_json::from_slice(task.bytes)
            .map_err(|e| bad(format!("the host's task cannot be read: {e}")))?,
        now: surface(c"now")?.ok_or_else(|| bad("the host sent no surface".into()))?,
        before: surface(c"before")?,
        baseline: surface(c"baseline")?,
    })
}

fn surface(bytes: &[u8]) -> Result<Surface> {
    let parts = surface_parts(bytes).map_err(|e| malformed(&e))?;
    Surface::from_parts(parts).map_err(|e| Error::new(ErrorKind::BadData, e.to_string()))
}

fn surface_parts(bytes: &[u8]) -> std::result::Result<SurfaceParts, payload::Malformed> {
    let head: payload::Surface = payload::read(bytes)?;
    Ok(SurfaceParts {
        knots_u: payload::slice::<f64>(bytes, head.knots_u)?.to_vec(),
        knots_v: payload::slice::<f64>(bytes, head.knots_v)?.to_vec(),
        control: payload::slice::<[f64; 3]>(bytes, head.control)?.to_vec(),
        thickness: head.thickness,
        precision_factor: payload::slice::<f64>(bytes, head.precision_factor)?.to_vec(),
        covariance: payload::slice::<[f64; 49]>(bytes, head.covariance)?.to_vec(),
        noise_share: head.scatter_share(),
        mask_cells: [head.mask_u as usize, head.mask_v as usize],
        seen: payload::slice::<u8>(bytes, head.seen)?.iter().map(|seen| *seen != 0).collect(),
    })
}

fn emit_field(job: &Job<'_>, field: &Field) -> Result<()> {
    let nodes = field.nodes[0] * field.nodes[1];
    if field.values.len() != nodes * field.components || field.state.len() != nodes {
        return Err(Error::new(ErrorKind::Internal, format!("field {} does not fit its grid", field.name)));
    }
    let state: Vec<u8> = field.state.iter().map(|s| *s as u8).collect();
    let mut layout = Layout::of::<payload::Grid>();
    let head = payload::Grid {
        struct_size: size_of::<payload::Grid>() as u32,
        reserved: 0,
        n_u: field.nodes[0] as u32,
        n_v: field.nodes[1] as u32,
        components: field.components as u32,
        reserved_2: 0,
        name: layout.add::<u8>(field.name.len()),
        unit: layout.add::<u8>(field.unit.len()),
        values: layout.add::<f64>(field.values.len()),
        state: layout.add::<u8>(state.len()),
    };
    let mut out = Payload::new(job, &layout)?;
    out.header(&head).array(head.name, field.name.as_bytes()).array(head.unit, field.unit.as_bytes());
    out.array(head.values, &field.values).array(head.state, &state);
    out.emit::<payload::Grid>(job, nodes as u64, 0)
}

fn emit_findings(job: &Job<'_>, findings: &Findings) -> Result<()> {
    let text = serde_json::to_vec(findings)
        .map_err(|e| Error::new(ErrorKind::Internal, format!("the findings cannot be written: {e}")))?;
    let mut buffer = job.buffer(text.len())?;
    buffer.bytes().copy_from_slice(&text);
    job.emit(payload::FINDINGS, 0, frame_flag::LAST, buffer)
}
