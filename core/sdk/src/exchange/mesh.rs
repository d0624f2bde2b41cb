//! The mid-surface mesh, and the chart that a flattening returns.

use std::ffi::CStr;

use platen_abi::payload::{self, Header, Layout};
use platen_shape::mesh::{DiskMesh, DiskParts};
use platen_shape::{Chart, Vec3};

use super::{Decode, DecodeError, Encode};

impl Encode for DiskMesh {
    const FORMAT: &'static CStr = payload::Mesh::FORMAT;

    fn encode<B: AsMut<[u8]>, E>(&self, allocate: impl FnOnce(usize) -> Result<B, E>) -> Result<B, E> {
        let vertices: Vec<[f64; 3]> = self.vertices.iter().map(|p| [p.x, p.y, p.z]).collect();
        let mut layout = Layout::of::<payload::Mesh>();
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
            vertices: layout.add::<[f64; 3]>(vertices.len()),
            triangles: layout.add::<[u32; 3]>(self.triangles.len()),
            boundary: layout.add::<u32>(self.boundary.len()),
            arc: layout.add::<f64>(self.arc.len()),
            places: layout.add::<[f64; 2]>(self.places.len()),
        };
        let mut buffer = allocate(layout.bytes())?;
        let bytes = buffer.as_mut();
        payload::put_header(bytes, &head);
        payload::put(bytes, head.vertices, &vertices);
        payload::put(bytes, head.triangles, &self.triangles);
        payload::put(bytes, head.boundary, &self.boundary);
        payload::put(bytes, head.arc, &self.arc);
        payload::put(bytes, head.places, &self.places);
        Ok(buffer)
    }
}

impl Decode for DiskMesh {
    const FORMAT: &'static CStr = payload::Mesh::FORMAT;

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

impl Encode for Chart {
    const FORMAT: &'static CStr = payload::Chart::FORMAT;

    fn count(&self) -> u64 {
        self.uv.len() as u64
    }

    fn encode<B: AsMut<[u8]>, E>(&self, allocate: impl FnOnce(usize) -> Result<B, E>) -> Result<B, E> {
        let strain = self.strain.as_deref().unwrap_or_default();
        let sigma = self.sigma.as_deref().unwrap_or_default();
        let mut layout = Layout::of::<payload::Chart>();
        let head = payload::Chart {
            struct_size: size_of::<payload::Chart>() as u32,
            reserved: 0,
            uv: layout.add::<[f64; 2]>(self.uv.len()),
            strain: layout.add::<[f64; 3]>(strain.len()),
            sigma: layout.add::<[f64; 2]>(sigma.len()),
        };
        let mut buffer = allocate(layout.bytes())?;
        let bytes = buffer.as_mut();
        payload::put_header(bytes, &head);
        payload::put(bytes, head.uv, &self.uv);
        payload::put(bytes, head.strain, strain);
        payload::put(bytes, head.sigma, sigma);
        Ok(buffer)
    }
}

impl Decode for Chart {
    const FORMAT: &'static CStr = payload::Chart::FORMAT;

    fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        let head: payload::Chart = payload::read(bytes)?;
        let strain = payload::slice::<[f64; 3]>(bytes, head.strain)?;
        let sigma = payload::slice::<[f64; 2]>(bytes, head.sigma)?;
        Ok(Self {
            uv: payload::slice::<[f64; 2]>(bytes, head.uv)?.to_vec(),
            strain: (!strain.is_empty()).then(|| strain.to_vec()),
            sigma: (!sigma.is_empty()).then(|| sigma.to_vec()),
        })
    }
}
