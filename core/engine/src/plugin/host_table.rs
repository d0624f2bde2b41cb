//! The host's functions for plugins (`platen_host` of `platen.h`). Every argument is checked.
#![allow(unsafe_code, reason = "callbacks from the other side of the boundary")]

use std::ffi::{c_char, c_int, c_void};
use std::sync::PoisonError;
use std::time::Instant;

use platen_abi as abi;
use platen_sdk::exchange::AlignedBuffer;

use super::Emitted;
use super::descriptor::text as lossy;
use super::job::{self, Event};

/// Largest frame: a column of the finest scanner has some 400 kB, a surface with covariance some 10 MB.
const MAX_FRAME_BYTES: u64 = 256 << 20;

struct Table(abi::Host);
// SAFETY: functions and static strings only.
unsafe impl Sync for Table {}

static TABLE: Table = Table(abi::Host {
    struct_size: size_of::<abi::Host>() as u32,
    abi_minor: abi::ABI_MINOR,
    ctx: std::ptr::null_mut(),
    name: c"platen".as_ptr(),
    version: concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast(),
    log_enabled,
    log,
    progress,
    cancelled,
    buffer_alloc,
    buffer_free,
    emit,
    get_extension,
    now_mono_ns,
});

/// Returns the table, valid until the process ends.
pub(super) fn get() -> *const abi::Host {
    &raw const TABLE.0
}

/// Returns an empty error, to be filled by a plugin.
pub(super) fn empty_error() -> abi::Error {
    abi::Error {
        struct_size: size_of::<abi::Error>() as u32,
        flags: 0,
        vendor_code: 0,
        reserved: 0,
        message: [0; 512],
        hint: [0; 256],
    }
}

/// Returns message and hint as one line.
pub(super) fn message(error: &abi::Error) -> String {
    let text = |chars: &[c_char]| {
        let bytes: Vec<u8> = chars.iter().map(|c| *c as u8).take_while(|b| *b != 0).collect();
        String::from_utf8_lossy(&bytes).into_owned()
    };
    match (text(&error.message), text(&error.hint)) {
        (message, _) if message.is_empty() => "it gave no reason".to_owned(),
        (message, hint) if hint.is_empty() => message,
        (message, hint) => format!("{message}; {hint}"),
    }
}

unsafe extern "C" fn log_enabled(_: *const abi::Host, level: abi::Level) -> c_int {
    c_int::from(match level {
        1 => tracing::enabled!(target: "plugin", tracing::Level::ERROR),
        2 => tracing::enabled!(target: "plugin", tracing::Level::WARN),
        3 => tracing::enabled!(target: "plugin", tracing::Level::INFO),
        4 => tracing::enabled!(target: "plugin", tracing::Level::DEBUG),
        _ => tracing::enabled!(target: "plugin", tracing::Level::TRACE),
    })
}

unsafe extern "C" fn log(_: *const abi::Host, job: u64, level: abi::Level, text: *const c_char) {
    // SAFETY: the plugin's string lives for the call.
    let text = unsafe { lossy(text) };
    match level {
        1 => tracing::error!(target: "plugin", job, "{text}"),
        2 => tracing::warn!(target: "plugin", job, "{text}"),
        3 => tracing::info!(target: "plugin", job, "{text}"),
        4 => tracing::debug!(target: "plugin", job, "{text}"),
        _ => tracing::trace!(target: "plugin", job, "{text}"),
    }
}

unsafe extern "C" fn progress(_: *const abi::Host, job: u64, fraction: f64, phase: *const c_char) {
    // SAFETY: the plugin's string lives for the call.
    let phase = unsafe { lossy(phase) };
    tracing::debug!(target: "plugin", job, fraction, "{phase}");
}

unsafe extern "C" fn cancelled(_: *const abi::Host, job: u64) -> c_int {
    c_int::from(job::find(job).is_none_or(|job| job.is_stopped()))
}

unsafe extern "C" fn buffer_alloc(
    _: *const abi::Host,
    job: u64,
    bytes: u64,
    align: u32,
    out: *mut abi::Buffer,
) -> abi::Status {
    let Some(job) = job::find(job) else { return abi::status::STATE };
    if out.is_null() || align > 8 || bytes > MAX_FRAME_BYTES {
        return abi::status::UNSUPPORTED;
    }
    let mut buffer = AlignedBuffer::new(bytes as usize);
    let token = job::next_id();
    let data = buffer.as_mut_ptr().cast::<c_void>();
    job.buffers.lock().unwrap_or_else(PoisonError::into_inner).insert(token, buffer);
    // SAFETY: `out` is the plugin's struct, checked for null.
    unsafe { out.write(abi::Buffer { data, bytes, token }) };
    abi::status::OK
}

unsafe extern "C" fn buffer_free(_: *const abi::Host, buffer: *mut abi::Buffer) {
    // SAFETY: null or the plugin's struct.
    let Some(buffer) = (unsafe { buffer.as_ref() }) else { return };
    job::free(buffer.token);
}

unsafe extern "C" fn emit(_: *const abi::Host, job: u64, frame: *const abi::Frame) -> abi::Status {
    let Some(job) = job::find(job) else { return abi::status::STATE };
    // SAFETY: null or the plugin's struct, alive for the call.
    let Some(frame) = (unsafe { frame.as_ref() }) else { return abi::status::BAD_DATA };
    let Some(buffer) = job.buffers.lock().unwrap_or_else(PoisonError::into_inner).remove(&frame.buffer.token)
    else {
        tracing::error!(target: "plugin", job = job.id, "a plugin emitted a buffer that is not of this job");
        return abi::status::BAD_DATA;
    };
    if job.is_stopped() {
        return abi::status::CANCELLED;
    }
    // SAFETY: the plugin's string lives for the call.
    let format = unsafe { lossy(frame.format) };
    let emitted = Emitted { format, flags: frame.flags, buffer };
    if job.frames.send(Event::Frame(emitted)).is_err() { abi::status::CANCELLED } else { abi::status::OK }
}

unsafe extern "C" fn get_extension(_: *const abi::Host, _: *const c_char) -> *const c_void {
    std::ptr::null()
}

unsafe extern "C" fn now_mono_ns(_: *const abi::Host) -> i64 {
    job::mono_ns(Instant::now())
}
