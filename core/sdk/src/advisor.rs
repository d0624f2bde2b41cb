//! Advisor plugins: the trait, its inputs, and the frames of the boundary.

use std::ffi::{CStr, c_char};

use platen_abi::desc_flag;
use platen_abi::payload::{self, Header};
use platen_model::{Advice, PlateHistory};
use platen_shape::Surface;

use crate::exchange::Payload;
use crate::shim::{Input, Plugin, describe, refused};
use crate::{Error, ErrorKind, Info, Job, Options, Result, Values};

/// Plugin that advises the next stroke of a plate. It runs after the result has been sent to the press; if it fails,
/// only the advice is lost.
pub trait Advisor: Send + Sized + 'static {
    /// Description of the plugin.
    const INFO: Info;
    /// Options of the plugin; `()` for none.
    type Options: Options;

    /// Creates the plugin from checked options.
    ///
    /// # Errors
    /// When the options contradict each other.
    fn new(options: Self::Options) -> Result<Self>;

    /// Returns the advice after the last stroke of the history. Deterministic: equal inputs give equal advice, to the
    /// last bit. A reason for giving none is also an advice ([`Step::Cannot`](platen_model::Step::Cannot)).
    ///
    /// # Errors
    /// The inputs are inconsistent, or the job was cancelled.
    fn advise(&mut self, job: &Job<'_>, inputs: &AdvisorInputs) -> Result<Advice>;
}

/// Inputs of an advisor.
#[derive(Debug, Clone)]
pub struct AdvisorInputs {
    /// Plate, target, templates as laid, die, steel, strokes so far.
    pub history: PlateHistory,
    /// Surface of the last scan.
    pub now: Surface,
    /// Surface of the blank, where it was scanned.
    pub baseline: Option<Surface>,
}

/// Adapter of an [`Advisor`] to the boundary.
#[derive(Debug)]
pub struct AdvisorPlugin<A>(A);

const INPUTS: &[*const c_char] =
    &[payload::RECORD.as_ptr(), payload::Surface::FORMAT.as_ptr(), std::ptr::null()];
const OUTPUTS: &[*const c_char] = &[payload::ADVICE.as_ptr(), std::ptr::null()];

impl<A: Advisor> Plugin for AdvisorPlugin<A> {
    const DESC: platen_abi::Desc = describe::<A::Options>(c"advisor", A::INFO, INPUTS, OUTPUTS);

    fn create(values: &Values<'_>) -> Result<Self> {
        const { assert!(A::INFO.flags & desc_flag::HARDWARE == 0, "an advisor drives no hardware") };
        A::new(A::Options::from_values(values)?).map(Self)
    }

    fn run(&mut self, job: &Job<'_>, inputs: &[Input<'_>]) -> Result<()> {
        let advice = self.0.advise(job, &read(inputs)?)?;
        job.send(&advice)
    }
}

fn read(inputs: &[Input<'_>]) -> Result<AdvisorInputs> {
    let missing = |what: &str| Error::new(ErrorKind::BadData, format!("the host sent no {what}"));
    let history = inputs.iter().find(|i| i.format == payload::RECORD).ok_or_else(|| missing("record"))?;
    let surface = |role: &CStr| {
        let with_role = inputs.iter().find(|i| i.format == payload::Surface::FORMAT && i.role == Some(role));
        with_role.map(|input| Surface::decode(input.bytes).map_err(|e| refused(&e))).transpose()
    };
    Ok(AdvisorInputs {
        history: PlateHistory::decode(history.bytes).map_err(|e| refused(&e))?,
        now: surface(c"now")?.ok_or_else(|| missing("surface"))?,
        baseline: surface(c"baseline")?,
    })
}
