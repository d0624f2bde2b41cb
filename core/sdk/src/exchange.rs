//! Encoder and decoder of the payloads that cross the plugin boundary.
//!
//! Each value that crosses the boundary has one format of `platen.h`, and one implementation of [`Payload`] here. The
//! SDK writes into buffers of the host, the host into an [`AlignedBuffer`]. A file of a surface (`surface.platen`) has
//! the same bytes.
//!
//! | module | values | format |
//! |---|---|---|
//! | `scan` | scan header, column, end of a scan, window | `platen.scan/1`, `.column/2`, `.scan-end/1`, `.window/1` |
//! | `mesh` | mid-surface mesh, chart | `platen.mesh/2`, `.chart/1` |
//! | `surface` | S(u, v) with covariance and mask | `platen.surface/1` |
//! | `findings` | task, findings, history, advice (JSON), field | `platen.task/1`, `.findings/1`, `.record/1`, `.advice/1`, `.grid/1` |

#[cfg(feature = "comparison")]
mod findings;
#[cfg(feature = "flattening")]
mod mesh;
mod scan;
#[cfg(feature = "comparison")]
mod surface;

#[cfg(feature = "comparison")]
pub(crate) use findings::check;
pub use scan::{from_raw_window, to_raw_window};

use std::ffi::CStr;

use platen_abi::payload::{self, Element, Header, Layout, Malformed, Span};

/// Reason why a payload is refused.
#[derive(Debug, Clone, PartialEq)]
pub enum DecodeError {
    /// Headers or arrays do not fit the buffer.
    Malformed(Malformed),
    /// The document or the values are invalid.
    Invalid(String),
}

impl std::fmt::Display for DecodeError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Malformed(malformed) => malformed.fmt(f),
            Self::Invalid(why) => f.write_str(why),
        }
    }
}

impl std::error::Error for DecodeError {}

impl From<Malformed> for DecodeError {
    fn from(malformed: Malformed) -> Self {
        Self::Malformed(malformed)
    }
}

/// Value that crosses the boundary as a payload.
pub trait Payload: Sized {
    /// Name of the format.
    const FORMAT: &'static CStr;

    /// Writes the value into a buffer from `allocate`, which is called with the number of bytes.
    ///
    /// # Errors
    /// The errors of `allocate`.
    fn encode<B: AsMut<[u8]>, E>(&self, allocate: impl FnOnce(usize) -> Result<B, E>) -> Result<B, E>;

    /// Writes the value into a buffer of its own.
    fn to_buffer(&self) -> AlignedBuffer {
        let allocated: Result<_, std::convert::Infallible> =
            self.encode(|bytes| Ok(AlignedBuffer::new(bytes)));
        let Ok(buffer) = allocated;
        buffer
    }

    /// Reads the value. Arrays are read in place: `bytes` starts at a multiple of 8, as in an [`AlignedBuffer`].
    ///
    /// # Errors
    /// [`DecodeError`], when headers, arrays or values are wrong. No content can cause a panic.
    fn decode(bytes: &[u8]) -> Result<Self, DecodeError>;
}

/// Write of one array into the buffer of its payload.
type PutArray<'a> = Box<dyn Fn(&mut [u8]) + 'a>;

/// Arrays of a payload, placed behind its header in the order of their addition.
struct Arrays<'a> {
    layout: Layout,
    put: Vec<PutArray<'a>>,
}

impl<'a> Arrays<'a> {
    fn behind<H: Header>() -> Self {
        Self { layout: Layout::of::<H>(), put: Vec::new() }
    }

    /// Adds an array; returns its place.
    fn add<T: Element>(&mut self, elements: &'a [T]) -> Span {
        let span = self.layout.add::<T>(elements.len());
        self.put.push(Box::new(move |bytes| payload::put(bytes, span, elements)));
        span
    }

    /// Writes header and arrays, as [`Payload::encode`].
    fn encode<H: Header, B: AsMut<[u8]>, E>(
        self,
        header: &H,
        allocate: impl FnOnce(usize) -> Result<B, E>,
    ) -> Result<B, E> {
        let mut buffer = allocate(self.layout.bytes())?;
        payload::put_header(buffer.as_mut(), header);
        self.put.iter().for_each(|put| put(buffer.as_mut()));
        Ok(buffer)
    }
}

/// Zeroed bytes that start at a multiple of 8.
#[derive(Debug)]
pub struct AlignedBuffer {
    words: Vec<u64>,
    bytes: usize,
}

impl AlignedBuffer {
    /// Allocates the buffer.
    #[must_use]
    pub fn new(bytes: usize) -> Self {
        Self { words: vec![0; bytes.div_ceil(8)], bytes }
    }

    /// Copies bytes of any alignment, e.g. of a file.
    #[must_use]
    pub fn copy_of(bytes: &[u8]) -> Self {
        let mut buffer = Self::new(bytes.len());
        buffer.as_mut().copy_from_slice(bytes);
        buffer
    }

    /// Returns the start of the buffer, for the boundary.
    pub fn as_mut_ptr(&mut self) -> *mut u64 {
        self.words.as_mut_ptr()
    }
}

impl AsRef<[u8]> for AlignedBuffer {
    fn as_ref(&self) -> &[u8] {
        // SAFETY: `words` holds at least `bytes` initialised bytes.
        unsafe { std::slice::from_raw_parts(self.words.as_ptr().cast(), self.bytes) }
    }
}

impl AsMut<[u8]> for AlignedBuffer {
    fn as_mut(&mut self) -> &mut [u8] {
        // SAFETY: `words` holds at least `bytes` initialised bytes, borrowed mutably.
        unsafe { std::slice::from_raw_parts_mut(self.words.as_mut_ptr().cast(), self.bytes) }
    }
}
