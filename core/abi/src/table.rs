//! Tables of functions and descriptions, field by field as in `include/platen.h`.

use std::ffi::{c_char, c_int, c_void};

/// Result of a call: 0 or one of [`status`], at or below [`status::VENDOR`] a plugin's own.
pub type Status = i32;

/// Values of [`Status`].
pub mod status {
    /// Done.
    pub const OK: i32 = 0;
    /// The job was cancelled.
    pub const CANCELLED: i32 = -1;
    /// The deadline passed, or a device did not answer in time.
    pub const TIMEOUT: i32 = -2;
    /// The options contradict each other or the plant.
    pub const CONFIG: i32 = -3;
    /// Not something this plugin can do.
    pub const UNSUPPORTED: i32 = -4;
    /// The named thing does not exist.
    pub const NOT_FOUND: i32 = -5;
    /// The device is not reachable.
    pub const DISCONNECTED: i32 = -6;
    /// The device or file is in use.
    pub const BUSY: i32 = -7;
    /// Access was refused.
    pub const DENIED: i32 = -8;
    /// Reading or writing failed.
    pub const IO: i32 = -9;
    /// There is nothing to deliver.
    pub const NO_DATA: i32 = -10;
    /// The input or the device's data is wrong.
    pub const BAD_DATA: i32 = -11;
    /// No memory.
    pub const MEMORY: i32 = -12;
    /// The call does not fit the state of the instance.
    pub const STATE: i32 = -13;
    /// A fault of the plugin itself.
    pub const INTERNAL: i32 = -14;
    /// First of the plugin's own codes, downwards.
    pub const VENDOR: i32 = -10_000;
}

/// Bits of [`Error::flags`].
pub mod error_flag {
    /// Trying again may help.
    pub const RETRYABLE: u32 = 1;
    /// The device is gone until it is opened again.
    pub const DEVICE_LOST: u32 = 2;
    /// The instance must be made anew.
    pub const RECREATE: u32 = 4;
}

/// Filled by the callee when it fails; memory of the caller.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Error {
    /// Size of this struct.
    pub struct_size: u32,
    /// Bits of [`error_flag`].
    pub flags: u32,
    /// Code of the device, 0 when there is none.
    pub vendor_code: i32,
    /// 0.
    pub reserved: u32,
    /// What happened, one sentence, UTF-8, NUL at the end.
    pub message: [c_char; 512],
    /// What to do, one sentence, UTF-8, NUL at the end.
    pub hint: [c_char; 256],
}

/// One piece of work; borrowed for the call.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Job {
    /// Size of this struct.
    pub struct_size: u32,
    /// 0.
    pub reserved: u32,
    /// Unique in the host's life; 0 is no job.
    pub job_id: u64,
    /// Stroke that this work belongs to, 0 when none.
    pub stroke_no: u64,
    /// When the press triggered, host's monotonic clock.
    pub trigger_mono_ns: i64,
    /// The same in UTC since 1970.
    pub trigger_utc_ns: i64,
    /// When the result is worthless, host's monotonic clock.
    pub deadline_mono_ns: i64,
}

/// Memory of the host.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Buffer {
    /// First byte, aligned as asked for, at least to 8.
    pub data: *mut c_void,
    /// Size.
    pub bytes: u64,
    /// The host's mark.
    pub token: u64,
}

/// A named text beside a frame.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Attr {
    /// Name.
    pub key: *const c_char,
    /// Value.
    pub value: *const c_char,
}

/// Bits of [`Frame::flags`].
pub mod frame_flag {
    /// Data is missing.
    pub const INCOMPLETE: u32 = 1;
    /// No real instrument stood there.
    pub const SIMULATED: u32 = 2;
    /// The last frame of a successful job.
    pub const LAST: u32 = 4;
}

/// One piece of data on its way.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    /// Size of this struct.
    pub struct_size: u32,
    /// Bits of [`frame_flag`].
    pub flags: u32,
    /// What the buffer holds, e.g. `platen.column/2`.
    pub format: *const c_char,
    /// Coordinate frame, e.g. `scanner`.
    pub frame_id: *const c_char,
    /// When it was measured, host's monotonic clock, 0 unknown.
    pub mono_ns: i64,
    /// Number of things in it (points, vertices).
    pub count: u64,
    /// The data. Emitting hands it to the host.
    pub buffer: Buffer,
    /// Named texts.
    pub attrs: *const Attr,
    /// How many.
    pub n_attrs: u32,
    /// 0.
    pub reserved: u32,
}

/// Values of [`OptionDecl::kind`].
pub mod option_type {
    /// `i` is 0 or 1.
    pub const BOOL: i32 = 1;
    /// `i`.
    pub const INT: i32 = 2;
    /// `f`, in the declared unit.
    pub const FLOAT: i32 = 3;
    /// `s`.
    pub const STRING: i32 = 4;
    /// `s`, one of the choices.
    pub const CHOICE: i32 = 5;
    /// `s`, absolute or relative to the plant file; the host makes it absolute.
    pub const PATH: i32 = 6;
    /// `f`, seconds.
    pub const DURATION: i32 = 7;
    /// `list` and `n`.
    pub const FLOAT_LIST: i32 = 8;
}

/// Bits of [`OptionDecl::flags`].
pub mod option_flag {
    /// There is no default and the plant must give it.
    pub const REQUIRED: u32 = 1;
    /// Not to be shown in logs and records.
    pub const SECRET: u32 = 2;
    /// Rarely needed.
    pub const ADVANCED: u32 = 4;
    /// Still read, no longer to be used.
    pub const DEPRECATED: u32 = 8;
    /// `min` counts.
    pub const HAS_MIN: u32 = 16;
    /// `max` counts.
    pub const HAS_MAX: u32 = 32;
}

/// Declaration of one option; static data.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct OptionDecl {
    /// Size of this struct, also the stride of an array.
    pub struct_size: u32,
    /// One of [`option_type`].
    pub kind: i32,
    /// Bits of [`option_flag`].
    pub flags: u32,
    /// 0.
    pub reserved: u32,
    /// `[a-z][a-z0-9_]*`.
    pub name: *const c_char,
    /// Unit of a number, or null.
    pub unit: *const c_char,
    /// What it does, in sentences.
    pub doc: *const c_char,
    /// Default as TOML text, or null.
    pub default_text: *const c_char,
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// Names of a choice, null at the end; or null.
    pub choices: *const *const c_char,
}

/// One option's value, checked, defaulted, in the declared unit.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Value {
    /// Name of the option.
    pub name: *const c_char,
    /// One of [`option_type`].
    pub kind: i32,
    /// 1 when the plant file did not give it.
    pub from_default: i32,
    /// Whole number or truth value.
    pub i: i64,
    /// Number.
    pub f: f64,
    /// Text, or null.
    pub s: *const c_char,
    /// Numbers, or null.
    pub list: *const f64,
    /// How many.
    pub n: u64,
}

/// Bits of [`Desc::flags`].
pub mod desc_flag {
    /// Drives hardware.
    pub const HARDWARE: u32 = 1;
}

/// What a plugin is; static data, no I/O to produce.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Desc {
    /// Size of this struct.
    pub struct_size: u32,
    /// Bits of [`desc_flag`].
    pub flags: u32,
    /// Name in plant files, e.g. `faro-file`.
    pub id: *const c_char,
    /// `scanner`, `flattening` or `comparison`.
    pub kind: *const c_char,
    /// Name for people.
    pub name: *const c_char,
    /// Maker.
    pub vendor: *const c_char,
    /// Version of the plugin.
    pub version: *const c_char,
    /// What it does, in sentences.
    pub doc: *const c_char,
    /// Where to read more, or null.
    pub url: *const c_char,
    /// SPDX expression.
    pub license: *const c_char,
    /// Formats read, null at the end; or null.
    pub inputs: *const *const c_char,
    /// Formats written, null at the end; or null.
    pub outputs: *const *const c_char,
    /// Options.
    pub options: *const OptionDecl,
    /// How many.
    pub n_options: u32,
    /// 0.
    pub reserved: u32,
}

/// Log levels: 1 error, 2 warn, 3 info, 4 debug, 5 trace.
pub type Level = i32;

/// What the host offers. All `[any]`; valid until `deinit` returns.
#[repr(C)]
#[derive(Debug)]
pub struct Host {
    /// Size of this struct.
    pub struct_size: u32,
    /// Minor version of the boundary that the host speaks.
    pub abi_minor: u32,
    /// The host's own.
    pub ctx: *mut c_void,
    /// Name of the host.
    pub name: *const c_char,
    /// Its version.
    pub version: *const c_char,
    /// Non-zero when a message of this level would be kept.
    pub log_enabled: unsafe extern "C" fn(*const Host, Level) -> c_int,
    /// Logs a message for a job, 0 for none.
    pub log: unsafe extern "C" fn(*const Host, u64, Level, *const c_char),
    /// Says how far a job is, 0 to 1, and in which phase. Never extends a deadline.
    pub progress: unsafe extern "C" fn(*const Host, u64, f64, *const c_char),
    /// Non-zero when the job was cancelled or its deadline is past.
    pub cancelled: unsafe extern "C" fn(*const Host, u64) -> c_int,
    /// Memory for one frame of a job: bytes, alignment (a power of two).
    pub buffer_alloc: unsafe extern "C" fn(*const Host, u64, u64, u32, *mut Buffer) -> Status,
    /// Gives back a buffer that will not be emitted.
    pub buffer_free: unsafe extern "C" fn(*const Host, *mut Buffer),
    /// Hands a frame to the host, buffer included, whatever the answer.
    pub emit: unsafe extern "C" fn(*const Host, u64, *const Frame) -> Status,
    /// A named table, or null.
    pub get_extension: unsafe extern "C" fn(*const Host, *const c_char) -> *const c_void,
    /// The host's monotonic clock.
    pub now_mono_ns: unsafe extern "C" fn(*const Host) -> i64,
}

/// One configured plugin at work.
#[repr(C)]
#[derive(Debug)]
pub struct Instance {
    /// Size of this struct.
    pub struct_size: u32,
    /// 0.
    pub reserved: u32,
    /// The plugin's own.
    pub data: *mut c_void,
    /// What it is.
    pub desc: *const Desc,
    /// `[inst]` Connects to what it needs; may block.
    pub open: unsafe extern "C" fn(*mut Instance, *mut Error) -> Status,
    /// `[inst]` Prepares for the next trigger; may be null.
    pub arm: Option<unsafe extern "C" fn(*mut Instance, *const Job, *mut Error) -> Status>,
    /// `[inst]` Does one job, emitting its results.
    pub run: unsafe extern "C" fn(*mut Instance, *const Job, *const Frame, u32, *mut Error) -> Status,
    /// `[any]` Wakes a blocked `run` of this job and returns at once.
    pub cancel: unsafe extern "C" fn(*mut Instance, u64),
    /// `[inst]` Disconnects; joins own threads.
    pub close: unsafe extern "C" fn(*mut Instance),
    /// `[inst]` Ends the instance; no host call after it.
    pub destroy: unsafe extern "C" fn(*mut Instance),
    /// `[any]` A named table, or null.
    pub get_extension: unsafe extern "C" fn(*mut Instance, *const c_char) -> *const c_void,
}

/// The exported table of a library.
#[repr(C)]
#[derive(Debug)]
pub struct Entry {
    /// Size of this struct.
    pub struct_size: u32,
    /// Minor version of the boundary that the plugin was built for.
    pub abi_minor: u32,
    /// Once, before `create`: the host and the folder of the library.
    pub init: unsafe extern "C" fn(*const Host, *const c_char, *mut Error) -> Status,
    /// Once, after the last `destroy`.
    pub deinit: unsafe extern "C" fn(),
    /// How many plugins are in the library.
    pub count: unsafe extern "C" fn() -> u32,
    /// What plugin `index` is, null when there is none; constant, also before `init`.
    pub desc: unsafe extern "C" fn(u32) -> *const Desc,
    /// Makes an instance from checked values; touches no hardware.
    pub create: unsafe extern "C" fn(
        *const Host,
        *const c_char,
        *const Value,
        u32,
        *mut *mut Instance,
        *mut Error,
    ) -> Status,
}

/// Extension of a scanner instance: how long a scan takes.
pub const EXT_ESTIMATE: &std::ffi::CStr = c"platen.ext.estimate/1";

/// Table of [`EXT_ESTIMATE`].
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Estimate {
    /// Size of this struct.
    pub struct_size: u32,
    /// 0.
    pub reserved: u32,
    /// `[inst]` Seconds that a scan of the window (null: everything) takes, negative when unknown.
    pub scan_seconds: unsafe extern "C" fn(*mut Instance, *const crate::payload::Window) -> f64,
}

// Sizes on a 64-bit machine; the C header asserts the same.
#[cfg(target_pointer_width = "64")]
const _: () = {
    assert!(size_of::<Error>() == 784);
    assert!(size_of::<Job>() == 48);
    assert!(size_of::<Frame>() == 80);
    assert!(size_of::<OptionDecl>() == 72);
    assert!(size_of::<Value>() == 56);
    assert!(size_of::<Desc>() == 104);
    assert!(size_of::<Host>() == 104);
    assert!(size_of::<Instance>() == 80);
    assert!(size_of::<Entry>() == 48);
};
