//! Payload of a frame: a header, then arrays at the offsets given in the header.
//!
//! All arrays lie in the same buffer, aligned to 8 bytes, little endian. Buffers are not trusted: [`read`] and
//! [`slice()`] check sizes, offsets and alignment before any access.

use std::ffi::CStr;
use std::mem::MaybeUninit;

/// Plain number type, valid with any bit pattern.
///
/// # Safety
/// Implementors have no padding and no invalid values.
pub unsafe trait Pod: Copy + 'static {}
// SAFETY: plain numbers.
unsafe impl Pod for u8 {}
// SAFETY: plain numbers.
unsafe impl Pod for u16 {}
// SAFETY: plain numbers.
unsafe impl Pod for u32 {}
// SAFETY: plain numbers.
unsafe impl Pod for f32 {}
// SAFETY: plain numbers.
unsafe impl Pod for f64 {}
// SAFETY: an array of plain numbers has no padding.
unsafe impl<T: Pod, const N: usize> Pod for [T; N] {}

/// Payload header: `struct_size`, then numbers and [`Span`]s without padding.
///
/// # Safety
/// Implementors are `repr(C)`, consist of numbers only, have no padding and begin with `struct_size: u32`.
pub unsafe trait Header: Copy + 'static {
    /// Format string of a frame with this header.
    const FORMAT: &'static CStr;
    /// Size of the first version of the format. Members appended since are zero in a payload of an older writer.
    const FIRST_SIZE: usize = size_of::<Self>();
}

/// Position of an array: byte offset from the start of the buffer, and number of scalar elements. 0, 0: absent.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Span {
    /// Bytes from the start of the buffer.
    pub offset: u64,
    /// Number of scalars; n points in space have 3 n.
    pub count: u64,
}

macro_rules! header {
    ($(#[doc = $doc:literal])* $name:ident = $format:literal $(, first $first:literal bytes)? {
        $($(#[doc = $field_doc:literal])* $field:ident: $ty:ty,)*
    }) => {
        $(#[doc = $doc])*
        #[repr(C)]
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct $name {
            /// Size of this struct.
            pub struct_size: u32,
            $($(#[doc = $field_doc])* pub $field: $ty,)*
        }
        // SAFETY: numbers only, in an order without padding (asserted below).
        unsafe impl Header for $name {
            const FORMAT: &'static CStr = $format;
            $(const FIRST_SIZE: usize = $first;)?
        }
        const _: () = assert!(size_of::<$name>() == 4 $(+ size_of::<$ty>())*, "padding");
    };
}

header! {
    /// First frame of a scan, driver to host. Azimuths run counter-clockwise, rows go down from `elevation_start`.
    Scan = c"platen.scan/1", first 96 bytes {
        /// 1: simulated, without a real instrument; 2: `range_error_m` is stated.
        flags: u32,
        /// Rows of the lattice.
        n_rows: u32,
        /// Columns expected.
        n_columns: u32,
        /// Nominal azimuth of column 0.
        azimuth_start: f64,
        /// Angle between columns, positive.
        azimuth_step: f64,
        /// Nominal elevation of row 0.
        elevation_start: f64,
        /// Angle between rows, positive.
        elevation_step: f64,
        /// First column of the back face, `u32::MAX` when there is one face.
        seam_column: u32,
        /// Smallest intensity that the instrument reports.
        intensity_min: u16,
        /// Largest.
        intensity_max: u16,
        /// Seconds since 1970 UTC, 0 unknown.
        acquired_unix_s: f64,
        /// UTF-8: maker, model, serial number.
        instrument: Span,
        /// UTF-8: decisions and corrections of the driver, one sentence per line.
        notes: Span,
        /// Range error that neighbouring cells share, one sigma, as the instrument's data sheet states it. Flag 2.
        range_error_m: f64,
    }
}

header! {
    /// One column, driver to host, in any order. The arrays have one element per row.
    Column = c"platen.column/2" {
        /// Place in the lattice, by increasing azimuth.
        index: u32,
        /// 0 front, 1 back.
        face: u32,
        /// Row of the first element.
        first_row: u32,
        /// f64 metres.
        range_m: Span,
        /// f64 radians.
        azimuth: Span,
        /// f64 radians.
        elevation: Span,
        /// u16.
        intensity: Span,
        /// u8: 0 valid, 1 direction only, 2 no return.
        state: Span,
    }
}

header! {
    /// Last frame of a scan, driver to host. A scan without it is discarded.
    ScanEnd = c"platen.scan-end/1" {
        /// Columns sent.
        columns: u32,
        /// Valid cells sent.
        points: u64,
        /// Number of columns, first in time, that must not be used.
        warm_up_columns: u32,
        /// 0 complete, 1 aborted, 2 failed.
        outcome: u32,
    }
}

header! {
    /// Part of the field of view to scan, host to driver; without it, all of it.
    Window = c"platen.window/1" {
        /// 0.
        reserved: u32,
        /// First azimuth.
        azimuth_start: f64,
        /// Width towards growing azimuth.
        azimuth_width: f64,
        /// Lowest elevation.
        elevation_min: f64,
        /// Highest elevation.
        elevation_max: f64,
    }
}

header! {
    /// Mid-surface mesh of the plate, host to flattening.
    Mesh = c"platen.mesh/2" {
        /// 0.
        reserved: u32,
        /// Extent of the rectangle along u.
        width: f64,
        /// Along v.
        height: f64,
        /// Thickness of the plate.
        thickness: f64,
        /// Places of the corners (0,0), (W,0), (W,H), (0,H) in the boundary loop.
        corners: [u32; 4],
        /// Standard deviation of each corner along the edge that leaves it and the one that arrives.
        corner_sigma: [f64; 8],
        /// Standard deviation across each edge.
        edge_sigma: [f64; 4],
        /// Arc length of the edges v = 0, u = W, v = H, u = 0.
        edge_length: [f64; 4],
        /// f64, 3 a vertex.
        vertices: Span,
        /// u32, 3 a triangle, counter-clockwise seen from the scanner.
        triangles: Span,
        /// u32, vertices of the boundary loop, counter-clockwise from corner (0,0).
        boundary: Span,
        /// f64, arc length of each boundary vertex from its edge's first corner.
        arc: Span,
        /// f64, 2 a boundary vertex: (u, v) of the material there.
        places: Span,
    }
}

header! {
    /// Place (u, v) of every vertex on the flat plate, flattening to host.
    Chart = c"platen.chart/1", first 24 bytes {
        /// 0.
        reserved: u32,
        /// f64, 2 a vertex.
        uv: Span,
        /// f64, 2 a vertex: standard deviation of u and v. May be absent.
        sigma: Span,
    }
}

header! {
    /// Mid-surface S(u, v) as a bicubic B-spline, host to comparison. Role of the frame: now, before or baseline.
    Surface = c"platen.surface/1" {
        /// Mask cells along u.
        mask_u: u32,
        /// Mask cells along v.
        mask_v: u32,
        /// Share of the covariance that is noise of the scan; the rest is smoothing bias. 0: unknown, taken as all of
        /// it.
        noise_share: f32,
        /// Thickness of the plate.
        thickness: f64,
        /// f64, uniform, three knots beyond each end; the plate is 0 to W.
        knots_u: Span,
        /// f64, likewise 0 to H.
        knots_v: Span,
        /// f64, 3 a control point, v outer, u inner.
        control: Span,
        /// f64: Cholesky factor of the control values' precision, for each row of the net across its longer axis the
        /// blocks that couple it to itself and to the three rows before, each square over the shorter axis,
        /// column-major.
        precision_factor: Span,
        /// f64, 49 a control point: covariances with those up to three away, 7 x 7, v outer, u inner.
        covariance: Span,
        /// u8 a mask cell, v outer: 1 seen.
        seen: Span,
    }
}

impl Surface {
    /// Returns the share of the covariance that is noise of the scan; 1 where the writer gives none.
    pub fn scatter_share(&self) -> f32 {
        if self.noise_share == 0.0 { 1.0 } else { self.noise_share }
    }
}

header! {
    /// A named field on a (u, v) grid, comparison to host.
    Grid = c"platen.grid/1" {
        /// 0.
        reserved: u32,
        /// Nodes along u.
        n_u: u32,
        /// Nodes along v.
        n_v: u32,
        /// Numbers a node.
        components: u32,
        /// 0.
        reserved_2: u32,
        /// UTF-8 name.
        name: Span,
        /// UTF-8 unit.
        unit: Span,
        /// f64, v outer, u inner, components innermost.
        values: Span,
        /// u8 a node: 0 no data, 1 data, 2 data and unchanged.
        state: Span,
    }
}

/// Format of the comparison task: UTF-8 JSON, no header.
pub const TASK: &CStr = c"platen.task/1";
/// Format of a comparison's findings: UTF-8 JSON, no header.
pub const FINDINGS: &CStr = c"platen.findings/1";
/// Format of the history of a plate, an advisor's input: UTF-8 JSON, no header.
pub const RECORD: &CStr = c"platen.record/1";
/// Format of an advisor's advice: UTF-8 JSON, no header.
pub const ADVICE: &CStr = c"platen.advice/1";

/// Fault of a buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Malformed {
    /// The header is longer than the buffer or shorter than this version's.
    Header {
        /// Size of the buffer.
        bytes: usize,
        /// Size stated in the header.
        struct_size: u32,
    },
    /// An array lies outside the buffer.
    OutOfBounds {
        /// Position stated in the header.
        span: Span,
        /// Size of the buffer.
        bytes: usize,
    },
    /// An array is not aligned for its type.
    Misaligned {
        /// Its offset.
        offset: u64,
    },
    /// An array's length does not fit its element.
    Ragged {
        /// Its length.
        count: u64,
        /// Scalars an element.
        per_element: usize,
    },
}

impl std::fmt::Display for Malformed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Header { bytes, struct_size } => {
                write!(f, "header of {struct_size} bytes in a buffer of {bytes}")
            }
            Self::OutOfBounds { span, bytes } => {
                write!(f, "array of {} elements at byte {} in a buffer of {bytes}", span.count, span.offset)
            }
            Self::Misaligned { offset } => write!(f, "array at byte {offset} is not aligned"),
            Self::Ragged { count, per_element } => {
                write!(f, "array of {count} numbers, not a multiple of {per_element}")
            }
        }
    }
}

impl std::error::Error for Malformed {}

/// Reads the header at the start of a buffer; members that an older writer does not have are zero.
///
/// # Errors
/// [`Malformed::Header`] when it is incomplete.
pub fn read<H: Header>(bytes: &[u8]) -> Result<H, Malformed> {
    let struct_size = bytes.first_chunk().map_or(0, |b| u32::from_le_bytes(*b));
    let stated = struct_size as usize;
    if stated < H::FIRST_SIZE || stated > bytes.len() {
        return Err(Malformed::Header { bytes: bytes.len(), struct_size });
    }
    let mut header = MaybeUninit::<H>::zeroed();
    let n = stated.min(size_of::<H>());
    // SAFETY: both hold `n` bytes and do not overlap.
    unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), header.as_mut_ptr().cast(), n) };
    // SAFETY: every byte is zero or copied, and H has no invalid bit patterns.
    Ok(unsafe { header.assume_init() })
}

/// Returns the elements of an array; `T` may be a number or a fixed array of numbers such as `[f64; 3]`.
///
/// # Errors
/// When the array does not lie in the buffer, is not aligned, or its length is no multiple of the element's.
pub fn slice<T: Element>(bytes: &[u8], span: Span) -> Result<&[T], Malformed> {
    if span.count == 0 {
        return Ok(&[]);
    }
    let out = Malformed::OutOfBounds { span, bytes: bytes.len() };
    let per_element = T::SCALARS;
    if !span.count.is_multiple_of(per_element as u64) {
        return Err(Malformed::Ragged { count: span.count, per_element });
    }
    let n = usize::try_from(span.count / per_element as u64).map_err(|_| out)?;
    let start = usize::try_from(span.offset).map_err(|_| out)?;
    let len = n.checked_mul(size_of::<T>()).ok_or(out)?;
    let end = start.checked_add(len).ok_or(out)?;
    let part = bytes.get(start..end).ok_or(out)?;
    let data = part.as_ptr().cast::<T>();
    if !data.is_aligned() {
        return Err(Malformed::Misaligned { offset: span.offset });
    }
    // SAFETY: in bounds and aligned as just checked; T has no invalid bit patterns; lifetime is the buffer's.
    Ok(unsafe { std::slice::from_raw_parts(data, n) })
}

/// Returns the text of an array of bytes, with invalid UTF-8 replaced.
///
/// # Errors
/// As [`slice()`].
pub fn text(bytes: &[u8], span: Span) -> Result<String, Malformed> {
    Ok(String::from_utf8_lossy(slice::<u8>(bytes, span)?).into_owned())
}

/// A number or a fixed array of numbers.
pub trait Element: Pod {
    /// Numbers in it.
    const SCALARS: usize;
}
macro_rules! element {
    ($($ty:ty)*) => { $(
        impl Element for $ty {
            const SCALARS: usize = 1;
        }
        impl<const N: usize> Element for [$ty; N] {
            const SCALARS: usize = N;
        }
    )* };
}
element!(u8 u16 u32 f32 f64);

/// Layout of a buffer: its size and the position of each array.
#[derive(Debug)]
pub struct Layout {
    bytes: usize,
}

impl Layout {
    /// Begins a layout with header `H`.
    #[must_use]
    pub fn of<H: Header>() -> Self {
        Self { bytes: size_of::<H>().next_multiple_of(8) }
    }

    /// Appends `n` elements of type `T`.
    pub fn add<T: Element>(&mut self, n: usize) -> Span {
        let span = Span { offset: self.bytes as u64, count: (n * T::SCALARS) as u64 };
        self.bytes = (self.bytes + n * size_of::<T>()).next_multiple_of(8);
        if n == 0 { Span::default() } else { span }
    }

    /// Returns the size in bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.bytes
    }
}

/// Puts the header at the start of a buffer that a [`Layout`] planned.
///
/// # Panics
/// When the buffer is smaller than planned.
pub fn put_header<H: Header>(bytes: &mut [u8], header: &H) {
    assert!(bytes.len() >= size_of::<H>(), "buffer is smaller than its layout");
    // SAFETY: the buffer is large enough and bytes have no alignment or validity to respect.
    unsafe { bytes.as_mut_ptr().cast::<H>().write_unaligned(*header) };
}

/// Puts an array where the [`Layout`] planned it.
///
/// # Panics
/// When the span is not the one planned for as many elements.
pub fn put<T: Element>(bytes: &mut [u8], span: Span, elements: &[T]) {
    assert!(span.count as usize == elements.len() * T::SCALARS, "span is not the one planned");
    let start = span.offset as usize;
    let part = &mut bytes[start..start + size_of_val(elements)];
    // SAFETY: `part` has the size of `elements`, which has no padding.
    unsafe { std::ptr::copy_nonoverlapping(elements.as_ptr().cast::<u8>(), part.as_mut_ptr(), part.len()) };
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Vec<u8> {
        let mut layout = Layout::of::<Grid>();
        let (name, values) = (layout.add::<u8>(3), layout.add::<[f64; 3]>(2));
        let header = Grid {
            struct_size: size_of::<Grid>() as u32,
            reserved: 0,
            n_u: 2,
            n_v: 1,
            components: 3,
            reserved_2: 0,
            name,
            unit: Span::default(),
            values,
            state: Span::default(),
        };
        let mut bytes = vec![0; layout.bytes()];
        put_header(&mut bytes, &header);
        put(&mut bytes, name, b"gap");
        put(&mut bytes, values, &[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0_f64]]);
        bytes
    }

    #[test]
    fn written_arrays_are_read_back() {
        let bytes = grid();
        let header: Grid = read(&bytes).unwrap();
        assert_eq!(text(&bytes, header.name).unwrap(), "gap");
        assert_eq!(slice::<[f64; 3]>(&bytes, header.values).unwrap()[1], [4.0, 5.0, 6.0]);
        assert_eq!(slice::<u8>(&bytes, header.state).unwrap(), &[] as &[u8]);
    }

    #[test]
    fn inconsistent_headers_are_refused() {
        let bytes = grid();
        let header: Grid = read(&bytes).unwrap();
        let end = bytes.len() as u64;
        let beyond = Span { offset: end - 8, count: 2 };
        assert!(matches!(slice::<f64>(&bytes, beyond), Err(Malformed::OutOfBounds { .. })));
        let huge = Span { offset: u64::MAX - 7, count: u64::MAX / 2 * 2 };
        assert!(slice::<f64>(&bytes, huge).is_err());
        let odd = Span { offset: header.values.offset + 4, count: 1 };
        assert!(matches!(slice::<f64>(&bytes, odd), Err(Malformed::Misaligned { .. })));
        let ragged = Span { count: 5, ..header.values };
        assert!(matches!(slice::<[f64; 3]>(&bytes, ragged), Err(Malformed::Ragged { .. })));
        assert!(matches!(read::<Grid>(&bytes[..20]), Err(Malformed::Header { .. })));
        let mut short = bytes;
        short[..4].copy_from_slice(&8_u32.to_le_bytes());
        assert!(matches!(read::<Grid>(&short), Err(Malformed::Header { .. })));
    }
}
