//! Flattening plugins: trait, frames of the boundary.

use std::ffi::c_char;

use platen_abi::payload::{self, Header, Layout};
use platen_shape::mesh::{DiskMesh, DiskParts};
use platen_shape::{Chart, Vec3};

use crate::shim::{Input, Plugin, describe, malformed};
use crate::sink::Payload;
use crate::{Error, ErrorKind, Info, Job, Options, Result, Values};

/// Plugin that assigns each vertex of the mid-surface mesh its place (u, v) on the original plate.
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

    /// Returns the chart of `mesh`: (u, v) per vertex in metres, optionally strain and uncertainty. The mesh contains the
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
        let parts = mesh_parts(input.bytes).map_err(|e| malformed(&e))?;
        let mesh = DiskMesh::new(parts).map_err(|e| Error::new(ErrorKind::BadData, e.to_string()))?;
        let chart = self.0.flatten(job, &mesh)?;
        chart.check(&mesh).map_err(|e| Error::new(ErrorKind::Internal, e.to_string()))?;
        emit_chart(job, &chart)
    }
}

fn mesh_parts(bytes: &[u8]) -> std::result::Result<DiskParts, payload::Malformed> {
    let head: payload::Mesh = payload::read(bytes)?;
    let sigma = head.corner_sigma;
    Ok(DiskParts {
        vertices: payload::slice::<[f64; 3]>(bytes, head.vertices)?.iter().map(|p| Vec3::from(*p)).collect(),
        triangles: payload::slice::<[u32; 3]>(bytes, head.triangles)?.to_vec(),
        boundary: payload::slice::<u32>(bytes, head.boundary)?.to_vec(),
        corners: head.corners,
        corner_sigma: std::array::from_fn(|k| [sigma[2 * k], sigma[2 * k + 1]]),
        edge_sigma: head.edge_sigma,
        arc: payload::slice::<f64>(bytes, head.arc)?.to_vec(),
        places: payload::slice::<[f64; 2]>(bytes, head.places)?.to_vec(),
        edge_length: head.edge_length,
        width: head.width,
        height: head.height,
        thickness: head.thickness,
    })
}

fn emit_chart(job: &Job<'_>, chart: &Chart) -> Result<()> {
    let strain = chart.strain.as_deref().unwrap_or_default();
    let sigma = chart.sigma.as_deref().unwrap_or_default();
    let mut layout = Layout::of::<payload::Chart>();
    let head = payload::Chart {
        struct_size: size_of::<payload::Chart>() as u32,
        reserved: 0,
        uv: layout.add::<[f64; 2]>(chart.uv.len()),
        strain: layout.add::<[f64; 3]>(strain.len()),
        sigma: layout.add::<[f64; 2]>(sigma.len()),
    };
    let mut out = Payload::new(job, &layout)?;
    out.header(&head).array(head.uv, &chart.uv).array(head.strain, strain).array(head.sigma, sigma);
    out.emit::<payload::Chart>(job, chart.uv.len() as u64, platen_abi::frame_flag::LAST)
}
