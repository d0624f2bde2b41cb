//! The surface S(u, v) with its covariance and its mask.

use std::ffi::CStr;

use platen_abi::payload::{self, Header, Layout};
use platen_shape::{Surface, SurfaceParts};

use super::{Decode, DecodeError, Encode};

impl Encode for Surface {
    const FORMAT: &'static CStr = payload::Surface::FORMAT;

    fn encode<B: AsMut<[u8]>, E>(&self, allocate: impl FnOnce(usize) -> Result<B, E>) -> Result<B, E> {
        let parts = self.to_parts();
        let seen: Vec<u8> = parts.seen.iter().map(|seen| u8::from(*seen)).collect();
        let mut layout = Layout::of::<payload::Surface>();
        let head = payload::Surface {
            struct_size: size_of::<payload::Surface>() as u32,
            mask_u: parts.mask_cells[0] as u32,
            mask_v: parts.mask_cells[1] as u32,
            noise_share: parts.noise_share,
            thickness: parts.thickness,
            knots_u: layout.add::<f64>(parts.knots_u.len()),
            knots_v: layout.add::<f64>(parts.knots_v.len()),
            control: layout.add::<[f64; 3]>(parts.control.len()),
            precision_factor: layout.add::<f64>(parts.precision_factor.len()),
            covariance: layout.add::<[f64; 49]>(parts.covariance.len()),
            seen: layout.add::<u8>(seen.len()),
        };
        let mut buffer = allocate(layout.bytes())?;
        let bytes = buffer.as_mut();
        payload::put_header(bytes, &head);
        payload::put(bytes, head.knots_u, &parts.knots_u);
        payload::put(bytes, head.knots_v, &parts.knots_v);
        payload::put(bytes, head.control, &parts.control);
        payload::put(bytes, head.precision_factor, &parts.precision_factor);
        payload::put(bytes, head.covariance, &parts.covariance);
        payload::put(bytes, head.seen, &seen);
        Ok(buffer)
    }
}

impl Decode for Surface {
    const FORMAT: &'static CStr = payload::Surface::FORMAT;

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
