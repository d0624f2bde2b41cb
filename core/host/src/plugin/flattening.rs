//! Flattenings as the host sees them.

use std::time::Duration;

use platen_abi::payload::{self, Header, Layout, Malformed};
use platen_shape::{Chart, DiskMesh, Flatten, FlattenError};

use super::instance::InputFrame;
use super::job::HostBuffer;
use platen_plant::OptionValue;

use super::{Instance, JobSpec, Kind, Library, PluginError};

/// A flattening with its options.
#[derive(Debug)]
pub struct Flattening {
    instance: Instance,
    limit: Duration,
}

impl Flattening {
    /// Makes a flattening of checked options; `limit` is the time for one mesh.
    ///
    /// # Errors
    /// As [`Instance::create`].
    pub fn create(library: &Library, values: &[OptionValue], limit: Duration) -> Result<Self, PluginError> {
        let instance = Instance::create(library, Kind::Flattening, values)?;
        instance.open(limit)?;
        Ok(Self { instance, limit })
    }

    /// Name in plant files.
    pub fn name(&self) -> &str {
        self.instance.name()
    }

    fn run(&self, mesh: &DiskMesh) -> Result<Chart, PluginError> {
        let misbehaved =
            |what: String| PluginError::Misbehaved { name: self.instance.name().to_owned(), what };
        let mut job = self.instance.start(JobSpec::untriggered(self.limit), vec![mesh_frame(mesh)]);
        let mut answer = None;
        while let Some(frame) = job.next_frame() {
            if frame.format.as_bytes() != payload::Chart::FORMAT.to_bytes() || answer.is_some() {
                return Err(misbehaved(format!("a frame {} out of turn", frame.format)));
            }
            answer = Some(chart(frame.bytes()).map_err(|e| misbehaved(format!("a malformed chart: {e}")))?);
        }
        job.finish()?;
        answer.ok_or_else(|| misbehaved("success without a chart".into()))
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

fn mesh_frame(mesh: &DiskMesh) -> InputFrame {
    let vertices: Vec<[f64; 3]> = mesh.vertices.iter().map(|p| [p.x, p.y, p.z]).collect();
    let mut layout = Layout::of::<payload::Mesh>();
    let mut corner_sigma = [0.0; 8];
    for (pair, sigma) in corner_sigma.chunks_exact_mut(2).zip(&mesh.corner_sigma) {
        pair.copy_from_slice(sigma);
    }
    let head = payload::Mesh {
        struct_size: size_of::<payload::Mesh>() as u32,
        reserved: 0,
        width: mesh.width,
        height: mesh.height,
        thickness: mesh.thickness,
        corners: mesh.corners,
        corner_sigma,
        edge_sigma: mesh.edge_sigma,
        edge_length: mesh.edge_length,
        vertices: layout.add::<[f64; 3]>(vertices.len()),
        triangles: layout.add::<[u32; 3]>(mesh.triangles.len()),
        boundary: layout.add::<u32>(mesh.boundary.len()),
        arc: layout.add::<f64>(mesh.arc.len()),
        places: layout.add::<[f64; 2]>(mesh.places.len()),
    };
    let mut buffer = HostBuffer::new(layout.bytes());
    let bytes = buffer.bytes_mut();
    payload::put_header(bytes, &head);
    payload::put(bytes, head.vertices, &vertices);
    payload::put(bytes, head.triangles, &mesh.triangles);
    payload::put(bytes, head.boundary, &mesh.boundary);
    payload::put(bytes, head.arc, &mesh.arc);
    payload::put(bytes, head.places, &mesh.places);
    InputFrame { format: payload::Mesh::FORMAT, role: None, buffer }
}

fn chart(bytes: &[u8]) -> Result<Chart, Malformed> {
    let head: payload::Chart = payload::read(bytes)?;
    let strain = payload::slice::<[f64; 3]>(bytes, head.strain)?;
    let sigma = payload::slice::<[f64; 2]>(bytes, head.sigma)?;
    Ok(Chart {
        uv: payload::slice::<[f64; 2]>(bytes, head.uv)?.to_vec(),
        strain: (!strain.is_empty()).then(|| strain.to_vec()),
        sigma: (!sigma.is_empty()).then(|| sigma.to_vec()),
    })
}
