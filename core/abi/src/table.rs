//! Function tables and descriptors, field by field as in `include/platen.h`.

use std::ffi::{c_char, c_int, c_void};

/// Result of a call: one of [`status`]. Values at or below [`status::VENDOR`] are defined by the plugin and count as
/// [`status::IO`].
pub type Status = i32;

/// Values of [`Status`], and what the host does after each.
pub mod status {
    /// Done.
    pub const OK: i32 = 0;
    /// The job was cancelled or its deadline passed. Without either: a fault of the plugin.
    pub const CANCELLED: i32 = -1;
    /// A device did not answer in time. Reopened; a retry may succeed.
    pub const TIMEOUT: i32 = -2;
    /// The options contradict each other or the plant. Not repeated.
    pub const CONFIG: i32 = -3;
    /// The plugin does not support the request. Not repeated.
    pub const UNSUPPORTED: i32 = -4;
    /// The named file or device does not exist. Not repeated.
    pub const NOT_FOUND: i32 = -5;
    /// The device is not reachable. Reopened; a retry may succeed.
    pub const DISCONNECTED: i32 = -6;
    /// The device or file is in use. A retry may succeed.
    pub const BUSY: i32 = -7;
    /// Access was refused. Not repeated.
    pub const DENIED: i32 = -8;
    /// Reading or writing failed. Reopened.
    pub const IO: i32 = -9;
    /// No data is available. Not repeated.
    pub const NO_DATA: i32 = -10;
    /// The input or the device's data is invalid. Not repeated.
    pub const BAD_DATA: i32 = -11;
    /// Memory is exhausted. The plugin gets a fresh process.
    pub const MEMORY: i32 = -12;
    /// The call is not allowed in the state of the instance, or the job has ended. A fault of the plugin.
    pub const STATE: i32 = -13;
    /// A fault of the plugin itself. It gets a fresh process.
    pub const INTERNAL: i32 = -14;
    /// First of the plugin's own codes, downwards.
    pub const VENDOR: i32 = -10_000;
}

/// Bits of [`Error::flags`].
pub mod error_flag {
    /// A retry may succeed, whatever the status is.
    pub const RETRYABLE: u32 = 1;
}

/// Error struct: memory of the caller, filled by the callee when it fails.
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
    /// Description of the failure, one sentence, UTF-8, NUL at the end.
    pub message: [c_char; 512],
    /// Remedy, one sentence, UTF-8, NUL at the end.
    pub hint: [c_char; 256],
}

/// One job, borrowed for the call.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Job {
    /// Size of this struct.
    pub struct_size: u32,
    /// 0.
    pub reserved: u32,
    /// Unique in the lifetime of the host; 0 is no job.
    pub job_id: u64,
    /// Stroke of the job, 0 when it belongs to none.
    pub stroke_no: u64,
    /// Time of the press's trigger, host's monotonic clock.
    pub trigger_mono_ns: i64,
    /// The same, UTC since 1970.
    pub trigger_utc_ns: i64,
    /// Time after which the result is discarded, host's monotonic clock.
    pub deadline_mono_ns: i64,
}

/// Buffer of the host.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Buffer {
    /// First byte, aligned as asked for, at least to 8.
    pub data: *mut c_void,
    /// Size.
    pub bytes: u64,
    /// Identifier of the buffer, set by the host.
    pub token: u64,
}

/// Frame: one payload with its format.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    /// Size of this struct.
    pub struct_size: u32,
    /// 0.
    pub reserved: u32,
    /// Format of the payload, e.g. `platen.column/2`.
    pub format: *const c_char,
    /// Role of an input where several have one format: `now`, `before`, `baseline`; else null.
    pub role: *const c_char,
    /// Payload. Emitting transfers it to the host.
    pub buffer: Buffer,
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
    /// `s`, absolute: the host resolves what the plant file names beside itself.
    pub const PATH: i32 = 6;
    /// `f`, seconds.
    pub const DURATION: i32 = 7;
    /// `list` and `n`.
    pub const FLOAT_LIST: i32 = 8;
}

/// Bits of [`OptionDecl::flags`].
pub mod option_flag {
    /// Required: it has no default.
    pub const REQUIRED: u32 = 1;
    /// Must not appear in logs and records.
    pub const SECRET: u32 = 2;
    /// Rarely needed.
    pub const ADVANCED: u32 = 4;
    /// Deprecated, still accepted.
    pub const DEPRECATED: u32 = 8;
    /// `min` is valid.
    pub const HAS_MIN: u32 = 16;
    /// `max` is valid.
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
    /// Description, in sentences.
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

/// Value of one option: checked, with its default applied, in the declared unit.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Value {
    /// Name of the option.
    pub name: *const c_char,
    /// One of [`option_type`].
    pub kind: i32,
    /// 1 when it is the default.
    pub from_default: i32,
    /// Whole number or truth value.
    pub i: i64,
    /// Number.
    pub f: f64,
    /// Text, or null.
    pub s: *const c_char,
    /// Numbers, or null.
    pub list: *const f64,
    /// Number of elements.
    pub n: u64,
}

/// Bits of [`Desc::flags`].
pub mod desc_flag {
    /// Drives hardware.
    pub const HARDWARE: u32 = 1;
}

/// Descriptor of a plugin: static data, available without I/O.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Desc {
    /// Size of this struct.
    pub struct_size: u32,
    /// Bits of [`desc_flag`].
    pub flags: u32,
    /// Name in plant files, e.g. `faro-file`.
    pub id: *const c_char,
    /// `scanner`, `flattening`, `comparison` or `advisor`.
    pub kind: *const c_char,
    /// Display name.
    pub name: *const c_char,
    /// Vendor.
    pub vendor: *const c_char,
    /// Version of the plugin.
    pub version: *const c_char,
    /// Description, in sentences.
    pub doc: *const c_char,
    /// URL of the documentation, or null.
    pub url: *const c_char,
    /// SPDX expression.
    pub license: *const c_char,
    /// Input formats, null-terminated; or null.
    pub inputs: *const *const c_char,
    /// Output formats, null-terminated; or null.
    pub outputs: *const *const c_char,
    /// Options.
    pub options: *const OptionDecl,
    /// Number of elements.
    pub n_options: u32,
    /// 0.
    pub reserved: u32,
}

/// Log levels: 1 error, 2 warn, 3 info, 4 debug, 5 trace.
pub type Level = i32;

/// Function table of the host. All `[any]`; valid until `deinit` returns.
#[repr(C)]
#[derive(Debug)]
pub struct Host {
    /// Size of this struct.
    pub struct_size: u32,
    /// Minor version of the boundary, host side.
    pub abi_minor: u32,
    /// Version of the host, for logs.
    pub version: *const c_char,
    /// Returns non-zero when messages of this level are logged.
    pub log_enabled: unsafe extern "C" fn(*const Host, Level) -> c_int,
    /// Logs a message for a job, 0 for none.
    pub log: unsafe extern "C" fn(*const Host, u64, Level, *const c_char),
    /// Reports progress of a job: fraction from 0 to 1, phase. Does not extend the deadline.
    pub progress: unsafe extern "C" fn(*const Host, u64, f64, *const c_char),
    /// Returns non-zero when the job was cancelled or its deadline has passed.
    pub cancelled: unsafe extern "C" fn(*const Host, u64) -> c_int,
    /// Allocates a buffer for one frame of a job, aligned to 8 bytes, its contents undefined. Waits until the host has
    /// taken earlier frames, at most until the job is cancelled or its deadline has passed.
    pub buffer_alloc: unsafe extern "C" fn(*const Host, u64, u64, *mut Buffer) -> Status,
    /// Frees a buffer that will not be emitted.
    pub buffer_free: unsafe extern "C" fn(*const Host, *mut Buffer),
    /// Transfers a frame with its buffer to the host. Only a frame whose buffer is unknown stays with the plugin.
    pub emit: unsafe extern "C" fn(*const Host, u64, *const Frame) -> Status,
    /// Returns nanoseconds of the host's monotonic clock (`CLOCK_MONOTONIC`).
    pub now_mono_ns: unsafe extern "C" fn(*const Host) -> i64,
}

/// Instance of a plugin with its options. Functions are required unless their text says otherwise.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Instance {
    /// Size of this struct.
    pub struct_size: u32,
    /// 0.
    pub reserved: u32,
    /// Private data of the plugin.
    pub data: *mut c_void,
    /// `[inst]` Connects to devices; may block.
    pub open: Option<unsafe extern "C" fn(*mut Instance, *mut Error) -> Status>,
    /// `[inst]` Runs one job and emits its results.
    pub run: Option<unsafe extern "C" fn(*mut Instance, *const Job, *const Frame, u32, *mut Error) -> Status>,
    /// `[any]` Wakes a blocked `run` of this job and returns at once. Null: `run` asks `cancelled` often enough.
    pub cancel: Option<unsafe extern "C" fn(*mut Instance, u64)>,
    /// `[inst]` Disconnects, and joins the threads of the plugin; `open` may follow.
    pub close: Option<unsafe extern "C" fn(*mut Instance)>,
    /// `[inst]` Ends the instance; no host call after it.
    pub destroy: Option<unsafe extern "C" fn(*mut Instance)>,
    /// `[any]` Returns an extension table by name, or null. Null: the instance has none.
    pub get_extension: Option<unsafe extern "C" fn(*mut Instance, *const c_char) -> *const c_void>,
}

/// Exported table of a library. Functions are required unless their text says otherwise.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    /// Size of this struct.
    pub struct_size: u32,
    /// Minor version of the boundary, plugin side.
    pub abi_minor: u32,
    /// Called once, before `create`, with the host and the folder of the library.
    pub init: Option<unsafe extern "C" fn(*const Host, *const c_char, *mut Error) -> Status>,
    /// Called once, after the last `destroy`; may be null.
    pub deinit: Option<unsafe extern "C" fn()>,
    /// Returns the number of plugins in the library.
    pub count: Option<unsafe extern "C" fn() -> u32>,
    /// Returns the descriptor of plugin `index`, null when there is none; constant, also before `init`.
    pub desc: Option<unsafe extern "C" fn(u32) -> *const Desc>,
    /// Creates an instance of plugin `id` from checked values; accesses no hardware.
    pub create: Option<
        unsafe extern "C" fn(
            *const Host,
            *const c_char,
            *const Value,
            u32,
            *mut *mut Instance,
            *mut Error,
        ) -> Status,
    >,
}

/// Struct of a plugin, of which the host reads the members that both sides have.
///
/// # Safety
/// Implementors are `repr(C)`, begin with `struct_size: u32`, and all zeros is a valid value.
pub unsafe trait Table: Copy {
    /// Name in the header, for messages.
    const NAME: &'static str;
    /// Size up to and including the last member that every plugin must have.
    const LEAST: usize;

    /// Reads the struct; members that the plugin's version does not have are zero.
    ///
    /// # Errors
    /// Its size, when it is less than [`LEAST`](Self::LEAST).
    ///
    /// # Safety
    /// `at` points to a struct as long as its `struct_size`.
    unsafe fn read(at: *const Self) -> Result<Self, u32> {
        let mut table = std::mem::MaybeUninit::<Self>::zeroed();
        // SAFETY: the struct is at least as long as its struct_size, and zeros fill the rest.
        unsafe {
            let stated = at.cast::<u32>().read();
            if (stated as usize) < Self::LEAST {
                return Err(stated);
            }
            let n = (stated as usize).min(size_of::<Self>());
            std::ptr::copy_nonoverlapping(at.cast::<u8>(), table.as_mut_ptr().cast(), n);
            Ok(table.assume_init())
        }
    }
}

macro_rules! tables {
    ($($name:ident = $c:literal up to $last:ident of $bytes:literal bytes;)*) => { $(
        // SAFETY: numbers, raw pointers and optional functions; `struct_size` comes first.
        unsafe impl Table for $name {
            const NAME: &'static str = $c;
            const LEAST: usize = std::mem::offset_of!($name, $last) + $bytes;
        }
    )* };
}

tables! {
    Entry = "platen_entry" up to create of 8 bytes;
    Desc = "platen_desc" up to kind of 8 bytes;
    OptionDecl = "platen_option" up to default_text of 8 bytes;
    Instance = "platen_instance" up to destroy of 8 bytes;
    Frame = "platen_frame" up to buffer of 24 bytes;
    Estimate = "platen_estimate" up to scan_seconds of 8 bytes;
    HealthSource = "platen_health_source" up to health of 8 bytes;
    Discovery = "platen_discovery" up to discover of 8 bytes;
}

/// Extension of a scanner instance: duration of a scan.
pub const EXT_ESTIMATE: &std::ffi::CStr = c"platen.ext.estimate/1";

/// Table of [`EXT_ESTIMATE`].
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Estimate {
    /// Size of this struct.
    pub struct_size: u32,
    /// 0.
    pub reserved: u32,
    /// `[inst]` Returns the duration of a scan of the window (null: all of it) in seconds, negative when unknown.
    pub scan_seconds: Option<unsafe extern "C" fn(*mut Instance, *const crate::payload::Window) -> f64>,
}

/// Extension of a scanner instance: state of the instrument.
pub const EXT_HEALTH: &std::ffi::CStr = c"platen.ext.health/1";

/// Bits of [`Health::flags`].
pub mod health_flag {
    /// Mirror or window must be cleaned.
    pub const DIRTY: u32 = 1;
    /// The instrument runs on its battery.
    pub const ON_BATTERY: u32 = 2;
    /// The instrument has not reached its working temperature.
    pub const WARMING_UP: u32 = 4;
}

/// State of an instrument; NaN where it is not known.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Health {
    /// Size of this struct.
    pub struct_size: u32,
    /// Bits of [`health_flag`].
    pub flags: u32,
    /// Temperature inside, degrees Celsius.
    pub temperature_c: f64,
    /// Charge of the battery, 0 to 1.
    pub battery: f64,
    /// Angle between the instrument's vertical axis and the plumb line, radians.
    pub tilt: f64,
}

/// Table of [`EXT_HEALTH`].
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct HealthSource {
    /// Size of this struct.
    pub struct_size: u32,
    /// 0.
    pub reserved: u32,
    /// `[inst]` Writes what is known after `open` or a job, without asking for more than 100 ms.
    pub health: Option<unsafe extern "C" fn(*mut Instance, *mut Health) -> Status>,
}

/// Extension of a scanner instance: devices in reach.
pub const EXT_DISCOVERY: &std::ffi::CStr = c"platen.ext.discovery/1";

/// A device in reach: texts of UTF-8 with NUL.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Device {
    /// Size of this struct.
    pub struct_size: u32,
    /// 0.
    pub reserved: u32,
    /// Option by which a plant file names it.
    pub option: [c_char; 32],
    /// Value of that option.
    pub value: [c_char; 128],
    /// Model and serial number.
    pub about: [c_char; 128],
}

/// Table of [`EXT_DISCOVERY`].
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Discovery {
    /// Size of this struct.
    pub struct_size: u32,
    /// 0.
    pub reserved: u32,
    /// `[inst]` Looks for devices for at most 3 s, without `open`; writes up to n of them, and how many there are.
    pub discover:
        Option<unsafe extern "C" fn(*mut Instance, *mut Device, u32, *mut u32, *mut Error) -> Status>,
}

// Sizes on a 64-bit machine; the C header asserts the same.
#[cfg(target_pointer_width = "64")]
const _: () = {
    assert!(size_of::<Error>() == 784);
    assert!(size_of::<Job>() == 48);
    assert!(size_of::<Frame>() == 48);
    assert!(size_of::<OptionDecl>() == 72);
    assert!(size_of::<Value>() == 56);
    assert!(size_of::<Desc>() == 104);
    assert!(size_of::<Host>() == 80);
    assert!(size_of::<Instance>() == 64);
    assert!(size_of::<Entry>() == 48);
};
