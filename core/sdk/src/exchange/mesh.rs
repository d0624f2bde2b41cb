//! Mid-surface mesh, and the chart that a flattening returns.

use std::ffi::CStr;

use platen_abi::payload::{self, Header};
use platen_shape::mesh::{DiskMesh, DiskParts};
use platen_shape::{Chart, Vec3};

use super::{Arrays, DecodeError, Payload};

impl Payload for DiskMesh {
    const FORMAT: &'static CStr = payload::Mesh::FORMAT;

    fn encode<B: AsMut<[u8]>, E>(&self, allocate: impl FnOnce(usize) -> Result<B, E>) -> Result<B, E> {
        let vertices: Vec<[f64; 3]> = self.vertices.iter().map(|p| [p.x, p.y, p.z]).collect();
        let mut arrays = Arrays::behind::<payload::Mesh>();
        let mut corner_sigma = [0.0; 8];
        for (pair, sigma) in corner_sigma.chunks_exact_mut(2).zip(&self.corner_sigma) {
            pair.copy_from_slice(sigma);
        }
        let head = payload::Mesh {
            struct_size: size_of::<payload::Mesh>() as u32,
            reserved: 0,
            width: self.width,
            height: self.height,
            thickness: self.thickness,
            corners: self.corners,
            corner_sigma,
            edge_sigma: self.edge_sigma,
            edge_length: self.edge_length,
            vertices: arrays.add(&vertices),
            triangles: arrays.add(&self.triangles),
            boundary: arrays.add(&self.boundary),
            arc: arrays.add(&self.arc),
            places: arrays.add(&self.places),
        };
        arrays.encode(&head, allocate)
    }

    fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        let head: payload::Mesh = payload::read(bytes)?;
        let sigma = head.corner_sigma;
        let parts = DiskParts {
            vertices: payload::slice::<[f64; 3]>(bytes, head.vertices)?
                .iter()
                .map(|p| Vec3::from(*p))
                .collect(),
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
        };
        Self::new(parts).map_err(|error| DecodeError::Invalid(error.to_string()))
    }
}

impl Payload for Chart {
    const FORMAT: &'static CStr = payload::Chart::FORMAT;

    fn encode<B: AsMut<[u8]>, E>(&self, allocate: impl FnOnce(usize) -> Result<B, E>) -> Result<B, E> {
        let sigma = self.sigma.as_deref().unwrap_or_default();
        let mut arrays = Arrays::behind::<payload::Chart>();
        let head = payload::Chart {
            struct_size: size_of::<payload::Chart>() as u32,
            reserved: 0,
            uv: arrays.add(&self.uv),
            sigma: arrays.add(sigma),
        };
        arrays.encode(&head, allocate)
    }

    fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        let head: payload::Chart = payload::read(bytes)?;
        let sigma = payload::slice::<[f64; 2]>(bytes, head.sigma)?;
        Ok(Self {
            uv: payload::slice::<[f64; 2]>(bytes, head.uv)?.to_vec(),
            sigma: (!sigma.is_empty()).then(|| sigma.to_vec()),
        })
    }
}
