//! A surface as a `platen.surface/1` buffer: for comparisons, and for the file beside a result.

use platen_abi::payload::{self, Layout, Malformed};
use platen_shape::{Surface, SurfaceParts};

use super::job::HostBuffer;

pub(super) fn buffer(surface: &Surface) -> HostBuffer {
    let parts = surface.to_parts();
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
    let mut buffer = HostBuffer::new(layout.bytes());
    let bytes = buffer.bytes_mut();
    payload::put_header(bytes, &head);
    payload::put(bytes, head.knots_u, &parts.knots_u);
    payload::put(bytes, head.knots_v, &parts.knots_v);
    payload::put(bytes, head.control, &parts.control);
    payload::put(bytes, head.precision_factor, &parts.precision_factor);
    payload::put(bytes, head.covariance, &parts.covariance);
    payload::put(bytes, head.seen, &seen);
    buffer
}

/// The bytes of a surface.
pub fn surface_bytes(surface: &Surface) -> Vec<u8> {
    buffer(surface).bytes().to_vec()
}

/// The surface of such bytes.
///
/// # Errors
/// What is wrong with them, in words.
pub fn surface_from_bytes(bytes: &[u8]) -> Result<Surface, String> {
    // Arrays are looked at in place and must be aligned as they were written.
    let mut aligned = HostBuffer::new(bytes.len());
    aligned.bytes_mut().copy_from_slice(bytes);
    let parts = parts(aligned.bytes()).map_err(|e| e.to_string())?;
    Surface::from_parts(parts).map_err(|e| e.to_string())
}

fn parts(bytes: &[u8]) -> Result<SurfaceParts, Malformed> {
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
