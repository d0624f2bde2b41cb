//! Payload writer: header and arrays into a buffer of the host.

use platen_abi::payload::{self, Header, Layout};

use crate::Result;
use crate::job::{Job, OwnedBuffer};

/// Buffer of the host with a planned layout.
pub(crate) struct Payload<'a>(OwnedBuffer<'a>);

impl<'a> Payload<'a> {
    pub(crate) fn new(job: &Job<'a>, layout: &Layout) -> Result<Self> {
        Ok(Self(job.buffer(layout.bytes())?))
    }

    pub(crate) fn header<H: Header>(&mut self, header: &H) -> &mut Self {
        payload::put_header(self.0.bytes(), header);
        self
    }

    pub(crate) fn array<T: payload::Element>(&mut self, span: payload::Span, elements: &[T]) -> &mut Self {
        payload::put(self.0.bytes(), span, elements);
        self
    }

    pub(crate) fn emit<H: Header>(self, job: &Job<'_>, count: u64, flags: u32) -> Result<()> {
        job.emit(H::FORMAT, count, flags, self.0)
    }
}
