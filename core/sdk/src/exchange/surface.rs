//! Surface S(u, v) with its covariance and its mask.

use std::ffi::CStr;

use platen_abi::payload::{self, Header};
use platen_shape::{Surface, SurfaceParts};

use super::{Arrays, DecodeError, Payload};

impl Payload for Surface {
    const FORMAT: &'static CStr = payload::Surface::FORMAT;

    fn encode<B: AsMut<[u8]>, E>(&self, allocate: impl FnOnce(usize) -> Result<B, E>) -> Result<B, E> {
        let parts = self.to_parts();
        let seen: Vec<u8> = parts.seen.iter().map(|seen| u8::from(*seen)).collect();
        let mut arrays = Arrays::behind::<payload::Surface>();
        let head = payload::Surface {
            struct_size: size_of::<payload::Surface>() as u32,
            mask_u: parts.mask_cells[0] as u32,
            mask_v: parts.mask_cells[1] as u32,
            noise_share: parts.noise_share,
            thickness: parts.thickness,
            knots_u: arrays.add(&parts.knots_u),
            knots_v: arrays.add(&parts.knots_v),
            control: arrays.add(&parts.control),
            precision_factor: arrays.add(&parts.precision_factor),
            covariance: arrays.add(&parts.covariance),
            seen: arrays.add(&seen),
        };
        arrays.encode(&head, allocate)
    }

    fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        let head: payload::Surface = payload::read(bytes)?;
        let parts = SurfaceParts {
            knots_u: payload::slice::<f64>(bytes, head.knots_u)?.to_vec(),
            knots_v: payload::slice::<f64>(bytes, head.knots_v)?.to_vec(),
            control: payload::slice::<[f64; 3]>(bytes, head.control)?.to_vec(),
            thickness: head.thickness,
            precision_factor: payload::slice::<f64>(bytes, head.precision_factor)?.to_vec(),
            covariance: payload::slice::<[f64; 49]>(bytes, head.covariance)?.to_vec(),
            noise_share: head.scatter_share(),
            mask_cells: [head.mask_u as usize, head.mask_v as usize],
            seen: payload::slice::<u8>(bytes, head.seen)?.iter().map(|seen| *seen != 0).collect(),
        };
        Self::from_parts(parts).map_err(|error| DecodeError::Invalid(error.to_string()))
    }
}
