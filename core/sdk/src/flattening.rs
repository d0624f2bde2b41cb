//! Flattening plugins: the trait, and the frames of the boundary.

use std::ffi::c_char;

use platen_abi::payload::{self, Header};
use platen_shape::{Chart, DiskMesh};

use crate::exchange::Payload;
use crate::shim::{Input, Plugin, describe, refused};
use crate::{Error, ErrorKind, Info, Job, Options, Result, Values};

/// Plugin that assigns to each vertex of the mid-surface mesh its position (u, v) on the original plate.
pub trait Flattening: Send + Sized + 'static {
    /// Description of the plugin.
    const INFO: Info;
    /// Options of the plugin; `()` for none.
    type Options: Options;

    /// Creates the plugin from checked options.
    ///
    /// # Errors
    /// When the options contradict each other.
    fn new(options: Self::Options) -> Result<Self>;

    /// Returns the chart of `mesh`: (u, v) per vertex in metres, optionally their uncertainty. The mesh contains the
    /// places of its boundary. Deterministic: equal meshes give equal charts, to the last bit.
    ///
    /// # Errors
    /// When the mesh cannot be flattened, or the job was cancelled.
    fn flatten(&mut self, job: &Job<'_>, mesh: &DiskMesh) -> Result<Chart>;
}

/// Adapter of a [`Flattening`] to the boundary.
#[derive(Debug)]
pub struct FlatteningPlugin<F>(F);

const INPUTS: &[*const c_char] = &[payload::Mesh::FORMAT.as_ptr(), std::ptr::null()];
const OUTPUTS: &[*const c_char] = &[payload::Chart::FORMAT.as_ptr(), std::ptr::null()];

impl<F: Flattening> Plugin for FlatteningPlugin<F> {
    const DESC: platen_abi::Desc = describe::<F::Options>(c"flattening", F::INFO, INPUTS, OUTPUTS);

    fn create(values: &Values<'_>) -> Result<Self> {
        F::new(F::Options::from_values(values)?).map(Self)
    }

    fn run(&mut self, job: &Job<'_>, inputs: &[Input<'_>]) -> Result<()> {
        let input = inputs
            .iter()
            .find(|input| input.format == payload::Mesh::FORMAT)
            .ok_or_else(|| Error::new(ErrorKind::NoData, "the host sent no mesh"))?;
        let mesh = DiskMesh::decode(input.bytes).map_err(|e| refused(&e))?;
        let chart = self.0.flatten(job, &mesh)?;
        chart.check(&mesh).map_err(|e| Error::new(ErrorKind::Internal, e.to_string()))?;
        job.send(&chart)
    }
}
