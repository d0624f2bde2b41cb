//! Job of a plugin: deadline, cancellation, progress, host memory.

use std::ffi::CString;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use platen_abi as abi;

use crate::exchange::Payload;
use crate::{Error, ErrorKind, Result};

/// Callback that wakes a blocking call of the plugin when its job is cancelled.
pub(crate) type Waker = Mutex<Option<Box<dyn Fn() + Send>>>;

/// One job, borrowed for the call.
#[derive(Clone, Copy)]
pub struct Job<'a> {
    pub(crate) raw: &'a abi::Job,
    pub(crate) host: &'a abi::Host,
    pub(crate) waker: &'a Waker,
}

// SAFETY: every function of the host's table may be called from any thread, and nothing changes a job during its call.
unsafe impl Sync for Job<'_> {}

impl std::fmt::Debug for Job<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Job").field("id", &self.raw.job_id).finish_non_exhaustive()
    }
}

impl<'a> Job<'a> {
    /// Returns the id, unique in the lifetime of the host.
    pub fn id(&self) -> u64 {
        self.raw.job_id
    }

    /// Returns the number of the stroke, 0 when the job belongs to none.
    pub fn stroke(&self) -> u64 {
        self.raw.stroke_no
    }

    /// Fails when the job was cancelled or its deadline has passed. Call it at least every 50 ms of work.
    ///
    /// # Errors
    /// [`ErrorKind::Cancelled`].
    pub fn check(&self) -> Result<()> {
        // SAFETY: the host's table lives until `deinit`.
        if unsafe { (self.host.cancelled)(self.host, self.raw.job_id) } == 0 {
            Ok(())
        } else {
            Err(cancelled())
        }
    }

    /// Returns the time left until the deadline, zero when it has passed.
    pub fn remaining(&self) -> Duration {
        // SAFETY: as above.
        let now = unsafe { (self.host.now_mono_ns)(self.host) };
        Duration::from_nanos(self.raw.deadline_mono_ns.saturating_sub(now).max(0).unsigned_abs())
    }

    /// Reports progress: a fraction from 0 to 1 and the name of the phase. Progress does not extend the deadline.
    pub fn progress(&self, fraction: f64, phase: &str) {
        let phase = CString::new(phase.replace('\0', " ")).unwrap_or_default();
        // SAFETY: the string lives for the call.
        unsafe { (self.host.progress)(self.host, self.raw.job_id, fraction, phase.as_ptr()) };
    }

    /// Registers `wake`, which is called from another thread when the job is cancelled, until the guard is dropped.
    /// Typically it closes a socket, so that a blocking read returns. It must return at once.
    #[must_use]
    pub fn on_cancel(&self, wake: impl Fn() + Send + 'static) -> CancelGuard<'a> {
        *self.waker.lock().unwrap_or_else(PoisonError::into_inner) = Some(Box::new(wake));
        CancelGuard { waker: self.waker }
    }

    /// Allocates a buffer of the host.
    fn buffer(&self, bytes: usize) -> Result<OwnedBuffer<'a>> {
        let mut raw = abi::Buffer { data: std::ptr::null_mut(), bytes: 0, token: 0 };
        // SAFETY: `raw` lives for the call.
        let status =
            unsafe { (self.host.buffer_alloc)(self.host, self.raw.job_id, bytes as u64, &raw mut raw) };
        if status == abi::status::CANCELLED {
            return Err(cancelled());
        }
        if status != abi::status::OK || raw.data.is_null() || raw.bytes < bytes as u64 {
            return Err(Error::new(ErrorKind::Memory, format!("the host has no buffer of {bytes} bytes")));
        }
        Ok(OwnedBuffer { raw, bytes, host: self.host })
    }

    /// Sends a value to the host.
    pub(crate) fn send<T: Payload>(&self, value: &T) -> Result<()> {
        let buffer = value.encode(|bytes| self.buffer(bytes))?;
        let frame = abi::Frame {
            struct_size: size_of::<abi::Frame>() as u32,
            reserved: 0,
            format: T::FORMAT.as_ptr(),
            role: std::ptr::null(),
            buffer: buffer.raw,
        };
        std::mem::forget(buffer);
        // SAFETY: the frame lives for the call; the buffer is the host's from here on.
        match unsafe { (self.host.emit)(self.host, self.raw.job_id, &raw const frame) } {
            abi::status::OK => Ok(()),
            abi::status::CANCELLED => Err(cancelled()),
            status => {
                Err(Error::new(ErrorKind::BadData, format!("the host refused a frame (status {status})")))
            }
        }
    }
}

fn cancelled() -> Error {
    Error::new(ErrorKind::Cancelled, "the job was cancelled or its deadline passed")
}

/// Registration of a waker; ends when dropped.
pub struct CancelGuard<'a> {
    waker: &'a Waker,
}

impl std::fmt::Debug for CancelGuard<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("CancelGuard")
    }
}

impl Drop for CancelGuard<'_> {
    fn drop(&mut self) {
        *self.waker.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}

/// Buffer of the host; freed on drop unless emitted.
struct OwnedBuffer<'a> {
    raw: abi::Buffer,
    bytes: usize,
    host: &'a abi::Host,
}

impl AsMut<[u8]> for OwnedBuffer<'_> {
    fn as_mut(&mut self) -> &mut [u8] {
        // SAFETY: the host gave at least `bytes` bytes of memory that was written before, which are ours until emitted
        // or freed.
        unsafe { std::slice::from_raw_parts_mut(self.raw.data.cast(), self.bytes) }
    }
}

impl Drop for OwnedBuffer<'_> {
    fn drop(&mut self) {
        // SAFETY: the buffer is ours and was not emitted.
        unsafe { (self.host.buffer_free)(self.host, &raw mut self.raw) };
    }
}
