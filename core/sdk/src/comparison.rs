//! Comparison plugins: the trait, its inputs, and the frames of the boundary.

use std::ffi::{CStr, c_char};

use platen_abi::desc_flag;
use platen_abi::payload::{self, Header};
use platen_model::{Report, Task};
use platen_shape::Surface;

use crate::exchange::{Payload, check};
use crate::shim::{Input, Plugin, describe, refused};
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
    /// [`ErrorKind::BadData`] if it belongs to another plate: scans of one plate have equal size, from the plate file.
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
            check(field).map_err(|e| Error::new(ErrorKind::Internal, e.to_string()))?;
            job.send(field)?;
        }
        job.send(&report.findings)
    }
}

fn read(inputs: &[Input<'_>]) -> Result<Inputs> {
    let missing = |what: &str| Error::new(ErrorKind::BadData, format!("the host sent no {what}"));
    let task = inputs.iter().find(|i| i.format == payload::TASK).ok_or_else(|| missing("task"))?;
    let surface = |role: &CStr| {
        let with_role = inputs.iter().find(|i| i.format == payload::Surface::FORMAT && i.role == Some(role));
        with_role.map(|input| Surface::decode(input.bytes).map_err(|e| refused(&e))).transpose()
    };
    Ok(Inputs {
        task: Task::decode(task.bytes).map_err(|e| refused(&e))?,
        now: surface(c"now")?.ok_or_else(|| missing("surface"))?,
        before: surface(c"before")?,
        baseline: surface(c"baseline")?,
    })
}
