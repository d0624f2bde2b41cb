//! Host functions that a plugin can call (`platen_host` of `platen.h`), with every argument checked.
#![allow(unsafe_code, reason = "callbacks from the other side of the boundary")]

use std::ffi::{c_char, c_int, c_void};

use platen_abi::{self as abi, Table as _};

use super::super::clock;
use super::super::worker::{ToHost, outbox};
use super::descriptor::text;
use super::job;

/// Largest frame: a column of the finest scanner has some 400 kB, a surface with covariance some 10 MB.
const MAX_FRAME_BYTES: u64 = 256 << 20;

struct Table(abi::Host);
// SAFETY: functions and static strings only.
unsafe impl Sync for Table {}

static TABLE: Table = Table(abi::Host {
    struct_size: size_of::<abi::Host>() as u32,
    abi_minor: abi::ABI_MINOR,
    version: concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast(),
    log_enabled,
    log,
    progress,
    cancelled,
    buffer_alloc,
    buffer_free,
    emit,
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

/// Returns the message, the device's code and the hint as one line; without a message, the name of the status.
pub(super) fn message(error: &abi::Error, status: abi::Status) -> String {
    let text = |chars: &[c_char]| {
        let bytes: Vec<u8> = chars.iter().map(|c| *c as u8).take_while(|b| *b != 0).collect();
        String::from_utf8_lossy(&bytes).into_owned()
    };
    let mut message = text(&error.message);
    if message.is_empty() {
        message = format!("it gave no reason ({})", status_name(status));
    }
    if error.vendor_code != 0 {
        message = format!("{message} (code {} of the device)", error.vendor_code);
    }
    match text(&error.hint) {
        hint if hint.is_empty() => message,
        hint => format!("{message}; {hint}"),
    }
}

fn status_name(status: abi::Status) -> String {
    use abi::status as s;
    match status {
        s::CANCELLED => "cancelled",
        s::TIMEOUT => "a device did not answer in time",
        s::CONFIG => "the options contradict each other",
        s::UNSUPPORTED => "not supported",
        s::NOT_FOUND => "not found",
        s::DISCONNECTED => "disconnected",
        s::BUSY => "in use",
        s::DENIED => "access refused",
        s::IO => "reading or writing failed",
        s::NO_DATA => "no data",
        s::BAD_DATA => "invalid data",
        s::MEMORY => "out of memory",
        s::STATE => "not allowed in this state",
        s::INTERNAL => "a fault of the plugin",
        other => return format!("status {other}"),
    }
    .to_owned()
}

unsafe extern "C" fn log_enabled(_: *const abi::Host, level: abi::Level) -> c_int {
    c_int::from(outbox().is_none_or(|outbox| outbox.logs(level)))
}

unsafe extern "C" fn log(_: *const abi::Host, job: u64, level: abi::Level, message: *const c_char) {
    // SAFETY: null or the plugin's string, alive for the call.
    let message = unsafe { text(message) };
    let of_job = job::find(job).map(|job| job.outbox.clone());
    if let Some(outbox) = of_job.or_else(outbox) {
        outbox.log(job, level, &message);
    }
}

unsafe extern "C" fn progress(_: *const abi::Host, job: u64, fraction: f64, phase: *const c_char) {
    // SAFETY: null or the plugin's string, alive for the call.
    let phase = unsafe { text(phase) };
    if let Some(found) = job::find(job) {
        let _ = found.outbox.send(&ToHost::Progress { job, fraction, phase });
    }
}

unsafe extern "C" fn cancelled(_: *const abi::Host, job: u64) -> c_int {
    c_int::from(job::find(job).is_none_or(|job| job.is_stopped()))
}

unsafe extern "C" fn buffer_alloc(
    _: *const abi::Host,
    job: u64,
    bytes: u64,
    out: *mut abi::Buffer,
) -> abi::Status {
    let Some(job) = job::find(job) else { return abi::status::STATE };
    if out.is_null() || bytes > MAX_FRAME_BYTES {
        return abi::status::UNSUPPORTED;
    }
    let Some((extent, token)) = job.allocate(bytes as usize) else {
        return if job.is_stopped() { abi::status::CANCELLED } else { abi::status::MEMORY };
    };
    let data = job.pool.data(extent).cast::<c_void>();
    // SAFETY: `out` is the plugin's struct, checked for null.
    unsafe { out.write(abi::Buffer { data, bytes, token }) };
    abi::status::OK
}

unsafe extern "C" fn buffer_free(_: *const abi::Host, buffer: *mut abi::Buffer) {
    // SAFETY: null or the plugin's struct.
    if let Some(buffer) = unsafe { buffer.as_ref() } {
        job::free(buffer.token);
    }
}

unsafe extern "C" fn emit(_: *const abi::Host, job: u64, frame: *const abi::Frame) -> abi::Status {
    let Some(job) = job::find(job) else { return abi::status::STATE };
    if frame.is_null() {
        return abi::status::BAD_DATA;
    }
    // SAFETY: the plugin's struct, as long as its struct_size, alive for the call; so is its string.
    let (Ok(frame), format) = (unsafe { (abi::Frame::read(frame), text((*frame).format)) }) else {
        return abi::status::BAD_DATA;
    };
    let Some(extent) = job.take(frame.buffer.token) else {
        job.outbox.log(job.id, 1, "a frame was emitted whose buffer is not of this job");
        return abi::status::BAD_DATA;
    };
    if job.is_stopped() {
        job.pool.free(extent);
        return abi::status::CANCELLED;
    }
    let (offset, bytes) = (extent.offset as u64, extent.bytes as u64);
    let message = ToHost::Frame { job: job.id, format, offset, bytes };
    match job.pool.emit(extent, || job.outbox.send(&message)) {
        Ok(()) => abi::status::OK,
        Err(_) => abi::status::CANCELLED,
    }
}

unsafe extern "C" fn now_mono_ns(_: *const abi::Host) -> i64 {
    clock::now_ns()
}
