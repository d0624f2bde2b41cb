//! C functions behind [`export!`](crate::export). Each catches panics and writes errors into the caller's struct.

use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CStr, c_char, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, PoisonError};

use platen_abi as abi;

use crate::exchange::{DecodeError, Payload, from_raw_window};
pub use crate::option::{Declared, declare};
use crate::{Device, Error, ErrorKind, Health, Info, Job, Options, Result, Scanner, Values, job, logging};

/// Input frame from the host.
#[derive(Debug, Clone, Copy)]
pub struct Input<'a> {
    pub(crate) format: &'a CStr,
    #[cfg_attr(
        not(feature = "comparison"),
        expect(dead_code, reason = "only comparisons get frames with roles")
    )]
    pub(crate) role: Option<&'a CStr>,
    pub(crate) bytes: &'a [u8],
}

/// Common interface of the three kinds behind the C functions.
pub trait Plugin: Send + Sized + 'static {
    const DESC: abi::Desc;
    fn create(values: &Values<'_>) -> Result<Self>;
    fn open(&mut self) -> Result<()> {
        Ok(())
    }
    fn run(&mut self, job: &Job<'_>, inputs: &[Input<'_>]) -> Result<()>;
    fn estimate_s(&mut self, window: Option<&platen_scan::Window>) -> Option<f64> {
        let _ = window;
        None
    }
    fn health(&mut self) -> Option<Health> {
        None
    }
    fn discover(&mut self) -> Result<Vec<Device>> {
        Err(Error::new(ErrorKind::Unsupported, "no driver"))
    }
    fn close(&mut self) {}
}

/// Makes the descriptor of a plugin.
pub const fn describe<O: Options>(
    kind: &'static CStr,
    info: Info,
    inputs: &'static [*const c_char],
    outputs: &'static [*const c_char],
) -> abi::Desc {
    abi::Desc {
        struct_size: size_of::<abi::Desc>() as u32,
        flags: info.flags,
        id: info.id.as_ptr(),
        kind: kind.as_ptr(),
        name: info.name.as_ptr(),
        vendor: info.vendor.as_ptr(),
        version: info.version.as_ptr(),
        doc: info.doc.as_ptr(),
        url: std::ptr::null(),
        license: info.license.as_ptr(),
        inputs: inputs.as_ptr(),
        outputs: outputs.as_ptr(),
        options: O::TABLE.as_ptr(),
        n_options: O::TABLE.len() as u32,
        reserved: 0,
    }
}

/// Adapter of a [`Scanner`] to the boundary.
#[derive(Debug)]
pub struct ScannerPlugin<S>(S);

impl<S: Scanner> Plugin for ScannerPlugin<S> {
    const DESC: abi::Desc = describe::<S::Options>(
        c"scanner",
        S::INFO,
        &[c"platen.window/1".as_ptr(), std::ptr::null()],
        &[
            c"platen.scan/1".as_ptr(),
            c"platen.column/2".as_ptr(),
            c"platen.scan-end/1".as_ptr(),
            std::ptr::null(),
        ],
    );
    fn create(values: &Values<'_>) -> Result<Self> {
        S::new(S::Options::from_values(values)?).map(Self)
    }
    fn open(&mut self) -> Result<()> {
        self.0.open()
    }
    fn estimate_s(&mut self, window: Option<&platen_scan::Window>) -> Option<f64> {
        self.0.estimate_s(window)
    }
    fn health(&mut self) -> Option<Health> {
        self.0.health()
    }
    fn discover(&mut self) -> Result<Vec<Device>> {
        self.0.discover()
    }
    fn run(&mut self, job: &Job<'_>, inputs: &[Input<'_>]) -> Result<()> {
        let window = inputs.iter().find(|input| input.format == platen_scan::Window::FORMAT);
        let window = window
            .map(|input| platen_scan::Window::decode(input.bytes).map_err(|e| refused(&e)))
            .transpose()?;
        let mut sink = crate::ScanSink { job: *job, window, n_rows: None, ended: false };
        self.0.capture(job, &mut sink)?;
        if sink.ended {
            Ok(())
        } else {
            Err(Error::new(ErrorKind::Internal, "the driver returned without calling end"))
        }
    }
    fn close(&mut self) {
        self.0.close();
    }
}

pub(crate) fn refused(error: &DecodeError) -> Error {
    match error {
        DecodeError::Malformed(malformed) => {
            Error::new(ErrorKind::BadData, format!("the host sent a malformed frame: {malformed}"))
        }
        DecodeError::Invalid(why) => Error::new(ErrorKind::BadData, why.clone()),
    }
}

/// State behind one `platen_instance`. `raw` is the first field, so a pointer to it is a pointer to the state.
#[repr(C)]
struct State<P> {
    raw: abi::Instance,
    estimate: abi::Estimate,
    health: abi::HealthSource,
    discovery: abi::Discovery,
    host: &'static abi::Host,
    waker: job::Waker,
    plugin: P,
}

thread_local! {
    static LAST_PANIC: RefCell<Option<String>> = const { RefCell::new(None) };
}

/// Runs `work`, catching panics; writes an error to the caller's struct and returns its status.
///
/// # Safety
/// `out` is null or a caller's `platen_error` with its `struct_size` set.
unsafe fn guard(out: *mut abi::Error, work: impl FnOnce() -> Result<()>) -> abi::Status {
    let error = match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(())) => return abi::status::OK,
        Ok(Err(error)) => error,
        Err(payload) => {
            let text = LAST_PANIC.take().unwrap_or_else(|| panic_text(payload.as_ref()));
            Error::new(ErrorKind::Internal, format!("the plugin panicked: {text}"))
                .hint("this is a fault of the plugin: report it with the scan and the plant file")
        }
    };
    // SAFETY: as the caller promises; a shorter struct of an older host is left alone.
    if let Some(out) = unsafe { out.as_mut() }
        && out.struct_size as usize >= size_of::<abi::Error>()
    {
        out.flags = error.flags;
        copy_text(&mut out.message, &error.message);
        copy_text(&mut out.hint, &error.hint);
    }
    error.kind as abi::Status
}

fn panic_text(payload: &(dyn Any + Send)) -> String {
    payload
        .downcast_ref::<&str>()
        .map(|s| (*s).to_owned())
        .or_else(|| payload.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "without a message".to_owned())
}

/// Copies as much of `text` as fits, whole characters only, NUL at the end.
pub(crate) fn copy_text(out: &mut [c_char], text: &str) {
    let mut end = text.len().min(out.len() - 1);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    for (place, byte) in out.iter_mut().zip(text.as_bytes()[..end].iter().filter(|b| **b != 0).chain([&0])) {
        *place = *byte as c_char;
    }
}

/// One plugin of a library.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    desc: &'static abi::Desc,
    create: unsafe fn(&'static abi::Host, &[abi::Value]) -> Result<*mut abi::Instance>,
}

// SAFETY: a descriptor is constant and leads to constants.
unsafe impl Sync for Row {}

/// Makes the row of a plugin.
pub const fn row<P: Plugin>() -> Row {
    Row { desc: const { &P::DESC }, create: create::<P> }
}

/// Functions that depend on the plugins of the library.
type Desc = unsafe extern "C" fn(u32) -> *const abi::Desc;
type Create = unsafe extern "C" fn(
    *const abi::Host,
    *const c_char,
    *const abi::Value,
    u32,
    *mut *mut abi::Instance,
    *mut abi::Error,
) -> abi::Status;

/// Makes the exported table of a library.
pub const fn entry(count: unsafe extern "C" fn() -> u32, desc: Desc, create: Create) -> abi::Entry {
    abi::Entry {
        struct_size: size_of::<abi::Entry>() as u32,
        abi_minor: abi::ABI_MINOR,
        init: Some(init),
        deinit: None,
        count: Some(count),
        desc: Some(desc),
        create: Some(create),
    }
}

/// Returns the descriptor of a plugin, null when there is none.
pub fn desc(rows: &'static [Row], index: u32) -> *const abi::Desc {
    rows.get(index as usize).map_or(std::ptr::null(), |row| std::ptr::from_ref(row.desc))
}

/// Creates an instance of the plugin `id`.
///
/// # Safety
/// The arguments are the host's, valid for the call, as the header demands.
pub unsafe fn create_one(
    rows: &'static [Row],
    host: *const abi::Host,
    id: *const c_char,
    values: (*const abi::Value, u32),
    out: *mut *mut abi::Instance,
    error: *mut abi::Error,
) -> abi::Status {
    // SAFETY: as the caller promises.
    unsafe {
        guard(error, || {
            let host = checked_host(host)?;
            let is_named = |row: &&Row| !id.is_null() && CStr::from_ptr(id) == CStr::from_ptr(row.desc.id);
            let row = rows
                .iter()
                .find(is_named)
                .ok_or_else(|| Error::new(ErrorKind::NotFound, "this library has no plugin of that name"))?;
            let (values, n) = values;
            let values = if n == 0 { &[] } else { std::slice::from_raw_parts(values, n as usize) };
            *out = (row.create)(host, values)?;
            Ok(())
        })
    }
}

unsafe extern "C" fn init(
    host: *const abi::Host,
    _dir: *const c_char,
    error: *mut abi::Error,
) -> abi::Status {
    // SAFETY: the host's table is valid until `deinit`; `error` is the caller's.
    unsafe {
        guard(error, || {
            let host = checked_host(host)?;
            logging::install(host);
            std::panic::set_hook(Box::new(|info| LAST_PANIC.set(Some(info.to_string().replace('\n', ": ")))));
            Ok(())
        })
    }
}

/// # Safety
/// `host` is null or a table that lives until `deinit`.
unsafe fn checked_host(host: *const abi::Host) -> Result<&'static abi::Host> {
    // SAFETY: as the caller promises.
    let host = unsafe { host.as_ref() }.ok_or_else(|| Error::new(ErrorKind::State, "no host table"))?;
    let needed = size_of::<abi::Host>();
    if (host.struct_size as usize) < needed {
        return Err(Error::new(
            ErrorKind::Unsupported,
            format!("the host's table has {} bytes, this plugin needs {needed}", host.struct_size),
        )
        .hint("use a plugin built for this version of platen"));
    }
    Ok(host)
}

/// # Safety
/// The host's table lives until `deinit`; the values live for the call.
unsafe fn create<P: Plugin>(host: &'static abi::Host, values: &[abi::Value]) -> Result<*mut abi::Instance> {
    let state = Box::new(State {
        raw: abi::Instance {
            struct_size: size_of::<abi::Instance>() as u32,
            reserved: 0,
            data: std::ptr::null_mut(),
            open: Some(open::<P>),
            run: Some(run::<P>),
            cancel: Some(cancel::<P>),
            close: Some(close::<P>),
            destroy: Some(destroy::<P>),
            get_extension: Some(get_extension::<P>),
        },
        estimate: abi::Estimate {
            struct_size: size_of::<abi::Estimate>() as u32,
            reserved: 0,
            scan_seconds: Some(scan_seconds::<P>),
        },
        health: abi::HealthSource {
            struct_size: size_of::<abi::HealthSource>() as u32,
            reserved: 0,
            health: Some(health::<P>),
        },
        discovery: abi::Discovery {
            struct_size: size_of::<abi::Discovery>() as u32,
            reserved: 0,
            discover: Some(discover::<P>),
        },
        host,
        waker: Mutex::new(None),
        plugin: P::create(&Values(values))?,
    });
    Ok(Box::into_raw(state).cast())
}

/// Returns the parts of an instance that an `[inst]` call uses.
///
/// # Safety
/// `instance` came from [`create`] and no other `[inst]` call is running.
unsafe fn parts<'a, P>(instance: *mut abi::Instance) -> (&'a mut P, &'static abi::Host, &'a job::Waker) {
    let state = instance.cast::<State<P>>();
    // SAFETY: distinct fields; `cancel` touches only `waker`, which is shared.
    unsafe { (&mut (*state).plugin, (*state).host, &(*state).waker) }
}

unsafe extern "C" fn open<P: Plugin>(instance: *mut abi::Instance, error: *mut abi::Error) -> abi::Status {
    // SAFETY: `[inst]` call on an instance from `create`.
    unsafe { guard(error, || parts::<P>(instance).0.open()) }
}

unsafe extern "C" fn run<P: Plugin>(
    instance: *mut abi::Instance,
    job: *const abi::Job,
    frames: *const abi::Frame,
    n_frames: u32,
    error: *mut abi::Error,
) -> abi::Status {
    // SAFETY: `[inst]` call on an instance from `create`; job and frames are borrowed for the call.
    unsafe {
        guard(error, || {
            let (plugin, host, waker) = parts::<P>(instance);
            let raw = &*job;
            let frames =
                if n_frames == 0 { &[] } else { std::slice::from_raw_parts(frames, n_frames as usize) };
            let inputs: Vec<Input<'_>> = frames.iter().map(|frame| input(frame)).collect();
            logging::in_job(raw.job_id, || plugin.run(&Job { raw, host, waker }, &inputs))
        })
    }
}

/// # Safety
/// The frame and what it points to live as long as the borrow.
unsafe fn input(frame: &abi::Frame) -> Input<'_> {
    // SAFETY: as the caller promises.
    unsafe {
        let role = (!frame.role.is_null()).then(|| CStr::from_ptr(frame.role));
        let bytes = if frame.buffer.bytes == 0 {
            &[]
        } else {
            std::slice::from_raw_parts(frame.buffer.data.cast::<u8>(), frame.buffer.bytes as usize)
        };
        Input { format: CStr::from_ptr(frame.format), role, bytes }
    }
}

unsafe extern "C" fn cancel<P: Plugin>(instance: *mut abi::Instance, _job_id: u64) {
    // SAFETY: `[any]` call; only the shared waker is touched.
    let waker = unsafe { &(*instance.cast::<State<P>>()).waker };
    let woken = catch_unwind(AssertUnwindSafe(|| {
        if let Some(wake) = waker.lock().unwrap_or_else(PoisonError::into_inner).as_ref() {
            wake();
        }
    }));
    if woken.is_err() {
        tracing::error!("the plugin panicked while being cancelled");
    }
}

unsafe extern "C" fn close<P: Plugin>(instance: *mut abi::Instance) {
    // SAFETY: `[inst]` call on an instance from `create`.
    let _ = unsafe {
        guard(std::ptr::null_mut(), || {
            parts::<P>(instance).0.close();
            Ok(())
        })
    };
}

unsafe extern "C" fn destroy<P: Plugin>(instance: *mut abi::Instance) {
    // SAFETY: the last `[inst]` call; the box came from `create`.
    let _ = unsafe {
        guard(std::ptr::null_mut(), || {
            drop(Box::from_raw(instance.cast::<State<P>>()));
            Ok(())
        })
    };
}

unsafe extern "C" fn get_extension<P: Plugin>(
    instance: *mut abi::Instance,
    id: *const c_char,
) -> *const c_void {
    // SAFETY: `[any]` call; the tables never change, the id is NUL-terminated.
    unsafe {
        let state = instance.cast::<State<P>>();
        match id {
            _ if id.is_null() => std::ptr::null(),
            _ if CStr::from_ptr(id) == abi::EXT_ESTIMATE => (&raw const (*state).estimate).cast(),
            _ if CStr::from_ptr(id) == abi::EXT_HEALTH => (&raw const (*state).health).cast(),
            _ if CStr::from_ptr(id) == abi::EXT_DISCOVERY => (&raw const (*state).discovery).cast(),
            _ => std::ptr::null(),
        }
    }
}

unsafe extern "C" fn discover<P: Plugin>(
    instance: *mut abi::Instance,
    devices: *mut abi::Device,
    n: u32,
    found: *mut u32,
    error: *mut abi::Error,
) -> abi::Status {
    // SAFETY: `[inst]` call on an instance from `create`; the host's array has n structs as long as the first one says.
    unsafe {
        guard(error, || {
            let all = parts::<P>(instance).0.discover()?;
            let stride = devices.as_ref().map_or(0, |first| first.struct_size as usize);
            if stride >= size_of::<abi::Device>() {
                for (place, device) in all.iter().enumerate().take(n as usize) {
                    if let Some(out) = devices.byte_add(place * stride).as_mut() {
                        device.write(out);
                    }
                }
            }
            if let Some(found) = found.as_mut() {
                *found = all.len() as u32;
            }
            Ok(())
        })
    }
}

unsafe extern "C" fn health<P: Plugin>(instance: *mut abi::Instance, out: *mut abi::Health) -> abi::Status {
    // SAFETY: `[inst]` call on an instance from `create`; `out` is the host's struct, as long as it says.
    unsafe {
        guard(std::ptr::null_mut(), || {
            let known = parts::<P>(instance).0.health();
            let known = known.ok_or_else(|| Error::new(ErrorKind::NoData, "nothing is known"))?;
            if let Some(out) = out.as_mut() {
                *out = known.to_raw();
            }
            Ok(())
        })
    }
}

unsafe extern "C" fn scan_seconds<P: Plugin>(
    instance: *mut abi::Instance,
    window: *const abi::payload::Window,
) -> f64 {
    let mut seconds = -1.0;
    // SAFETY: `[inst]` call on an instance from `create`; the window is null or borrowed for the call.
    let _ = unsafe {
        guard(std::ptr::null_mut(), || {
            let window = window.as_ref().map(from_raw_window);
            seconds = parts::<P>(instance).0.estimate_s(window.as_ref()).unwrap_or(-1.0);
            Ok(())
        })
    };
    seconds
}

/// Exports the plugins of a library: `export!(scanner Type);`, `export!(flattening Type);`, `export!(comparison Type);`, or several:
/// `export!(flattening One, flattening Two);`.
#[macro_export]
macro_rules! export {
    ($($kind:ident $plugin:ty),+ $(,)?) => {
        #[cfg(panic = "abort")]
        compile_error!("a plugin must be built with panic = \"unwind\": its panics become errors");

        #[allow(unsafe_code, reason = "the boundary")]
        const _: () = {
            use $crate::abi;

            static ROWS: &[$crate::shim::Row] = &[$($crate::shim::row::<$crate::export!(@adapter $kind $plugin)>()),+];

            unsafe extern "C" fn count() -> u32 {
                ROWS.len() as u32
            }
            unsafe extern "C" fn desc(index: u32) -> *const abi::Desc {
                $crate::shim::desc(ROWS, index)
            }
            unsafe extern "C" fn create(
                host: *const abi::Host,
                id: *const ::std::ffi::c_char,
                values: *const abi::Value,
                n: u32,
                out: *mut *mut abi::Instance,
                error: *mut abi::Error,
            ) -> abi::Status {
                // SAFETY: as the header demands of the host.
                unsafe { $crate::shim::create_one(ROWS, host, id, (values, n), out, error) }
            }

            #[allow(non_upper_case_globals, reason = "the name is the boundary's")]
            #[unsafe(no_mangle)]
            static platen_entry_2: abi::Entry = $crate::shim::entry(count, desc, create);
        };
    };
    (@adapter scanner $plugin:ty) => { $crate::shim::ScannerPlugin<$plugin> };
    (@adapter flattening $plugin:ty) => { $crate::shim::FlatteningPlugin<$plugin> };
    (@adapter comparison $plugin:ty) => { $crate::shim::ComparisonPlugin<$plugin> };
    (@adapter advisor $plugin:ty) => { $crate::shim::AdvisorPlugin<$plugin> };
}

#[cfg(feature = "comparison")]
pub use crate::advisor::AdvisorPlugin;
#[cfg(feature = "comparison")]
pub use crate::comparison::ComparisonPlugin;
#[cfg(feature = "flattening")]
pub use crate::flattening::FlatteningPlugin;
