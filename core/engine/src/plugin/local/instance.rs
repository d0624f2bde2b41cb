//! One instance of a plugin in this process: the calls through its table.
#![allow(unsafe_code, reason = "calls through the plugin's table")]

use std::ffi::CString;

use platen_abi::{self as abi, Table as _};
use platen_plant::OptionValue;

use super::super::worker::{CallError, Device, Health, Job, SharedMemory};
use super::values::Values;
use super::{Library, host_table};

/// Most devices that a driver may find.
const DEVICES: u32 = 64;

/// Functions that every instance has.
#[derive(Debug, Clone, Copy)]
struct Functions {
    open: unsafe extern "C" fn(*mut abi::Instance, *mut abi::Error) -> abi::Status,
    run: unsafe extern "C" fn(
        *mut abi::Instance,
        *const abi::Job,
        *const abi::Frame,
        u32,
        *mut abi::Error,
    ) -> abi::Status,
    close: unsafe extern "C" fn(*mut abi::Instance),
    destroy: unsafe extern "C" fn(*mut abi::Instance),
}

/// An instance; its `[inst]` calls are the methods, all from one thread. Dropping it closes and destroys it.
#[derive(Debug)]
pub(in crate::plugin) struct Instance {
    raw: *mut abi::Instance,
    table: abi::Instance,
    functions: Functions,
    opened: bool,
}

/// The `[any]` call of an instance.
#[derive(Debug, Clone, Copy)]
pub(in crate::plugin) struct Canceller {
    raw: *mut abi::Instance,
    cancel: Option<unsafe extern "C" fn(*mut abi::Instance, u64)>,
}

// SAFETY: `cancel` may be called from any thread.
unsafe impl Send for Canceller {}

impl Canceller {
    /// Wakes `run` of a job.
    ///
    /// # Safety
    /// The instance lives.
    pub(in crate::plugin) unsafe fn cancel(self, job: u64) {
        if let Some(cancel) = self.cancel {
            // SAFETY: as the caller promises.
            unsafe { cancel(self.raw, job) };
        }
    }
}

/// An input of a job.
#[derive(Debug)]
pub(in crate::plugin) struct Input {
    pub(in crate::plugin) format: String,
    pub(in crate::plugin) role: Option<String>,
    pub(in crate::plugin) memory: SharedMemory,
}

impl Instance {
    pub(in crate::plugin) fn create(
        library: &Library,
        plugin: &str,
        values: &[OptionValue],
    ) -> Result<Self, CallError> {
        let id = CString::new(plugin).unwrap_or_default();
        let values = Values::new(values);
        let rows = values.as_slice();
        let mut raw = std::ptr::null_mut();
        call(|error| match library.entry().create {
            // SAFETY: everything passed lives for the call.
            Some(create) => unsafe {
                create(host_table::get(), id.as_ptr(), rows.as_ptr(), rows.len() as u32, &raw mut raw, error)
            },
            None => abi::status::INTERNAL,
        })?;
        let unsound =
            |what: String| CallError { status: abi::status::INTERNAL, retryable: false, message: what };
        if raw.is_null() {
            return Err(unsound("it created no instance".into()));
        }
        // SAFETY: the instance that the plugin made, as long as its struct_size.
        let table = unsafe { abi::Instance::read(raw) }.map_err(|size| {
            let (name, least) = (abi::Instance::NAME, abi::Instance::LEAST);
            unsound(format!("its {name} has {size} bytes, {least} are needed"))
        })?;
        let abi::Instance {
            open: Some(open),
            run: Some(run),
            close: Some(close),
            destroy: Some(destroy),
            ..
        } = table
        else {
            return Err(unsound(format!("its {} lacks a function", abi::Instance::NAME)));
        };
        Ok(Self { raw, table, functions: Functions { open, run, close, destroy }, opened: false })
    }

    pub(in crate::plugin) fn canceller(&self) -> Canceller {
        Canceller { raw: self.raw, cancel: self.table.cancel }
    }

    /// Opens the instance, again when it was open.
    pub(in crate::plugin) fn open(&mut self) -> Result<(), CallError> {
        self.close();
        // SAFETY: `[inst]` call of a live instance.
        call(|error| unsafe { (self.functions.open)(self.raw, error) })?;
        self.opened = true;
        Ok(())
    }

    fn close(&mut self) {
        if std::mem::take(&mut self.opened) {
            // SAFETY: as above.
            unsafe { (self.functions.close)(self.raw) };
        }
    }

    /// Returns a table of the instance.
    fn extension<T: abi::Table>(&self, id: &std::ffi::CStr) -> Option<T> {
        let get = self.table.get_extension?;
        // SAFETY: `[any]` call of a live instance; a table that it returns is as long as its struct_size.
        unsafe {
            let table = get(self.raw, id.as_ptr()).cast::<T>();
            if table.is_null() { None } else { T::read(table).ok() }
        }
    }

    /// Returns the duration of a scan, seconds.
    pub(in crate::plugin) fn estimate_s(&self, window: Option<&abi::payload::Window>) -> Option<f64> {
        let scan_seconds = self.extension::<abi::Estimate>(abi::EXT_ESTIMATE)?.scan_seconds?;
        let window = window.map_or(std::ptr::null(), std::ptr::from_ref);
        // SAFETY: `[inst]` call of a live instance; the window lives for the call.
        let seconds = unsafe { scan_seconds(self.raw, window) };
        (seconds >= 0.0).then_some(seconds)
    }

    pub(in crate::plugin) fn health(&self) -> Option<Health> {
        let health = self.extension::<abi::HealthSource>(abi::EXT_HEALTH)?.health?;
        let mut found = abi::Health {
            struct_size: size_of::<abi::Health>() as u32,
            flags: 0,
            temperature_c: f64::NAN,
            battery: f64::NAN,
            tilt: f64::NAN,
        };
        // SAFETY: `[inst]` call of a live instance; the struct lives for the call.
        let status = unsafe { health(self.raw, &raw mut found) };
        let abi::Health { flags, temperature_c, battery, tilt, .. } = found;
        (status == abi::status::OK).then_some(Health { flags, temperature_c, battery, tilt })
    }

    pub(in crate::plugin) fn discover(&self) -> Result<Vec<Device>, CallError> {
        let table = self.extension::<abi::Discovery>(abi::EXT_DISCOVERY);
        let Some(discover) = table.and_then(|table| table.discover) else {
            let message = "this driver cannot look for devices".to_owned();
            return Err(CallError { status: abi::status::UNSUPPORTED, retryable: false, message });
        };
        let empty = abi::Device {
            struct_size: size_of::<abi::Device>() as u32,
            reserved: 0,
            option: [0; 32],
            value: [0; 128],
            about: [0; 128],
        };
        let (mut devices, mut found) = (vec![empty; DEVICES as usize], 0);
        // SAFETY: `[inst]` call of a live instance; array and number live for the call.
        call(|error| unsafe { discover(self.raw, devices.as_mut_ptr(), DEVICES, &raw mut found, error) })?;
        let written = devices.iter().take(found.min(DEVICES) as usize).map(platen_sdk::Device::from_raw);
        Ok(written.map(|it| Device { option: it.option, value: it.value, about: it.about }).collect())
    }

    pub(in crate::plugin) fn run(&mut self, job: &Job, inputs: &[Input]) -> Result<(), CallError> {
        let text = |text: &str| CString::new(text).unwrap_or_default();
        let names: Vec<(CString, Option<CString>)> =
            inputs.iter().map(|input| (text(&input.format), input.role.as_deref().map(text))).collect();
        let frame = |(input, (format, role)): (&Input, &(CString, Option<CString>))| abi::Frame {
            struct_size: size_of::<abi::Frame>() as u32,
            reserved: 0,
            format: format.as_ptr(),
            role: role.as_ref().map_or(std::ptr::null(), |role| role.as_ptr()),
            buffer: abi::Buffer {
                data: input.memory.data().cast(),
                bytes: input.memory.len() as u64,
                token: 0,
            },
        };
        let frames: Vec<abi::Frame> = inputs.iter().zip(&names).map(frame).collect();
        let raw_job = abi::Job {
            struct_size: size_of::<abi::Job>() as u32,
            reserved: 0,
            job_id: job.id,
            stroke_no: job.stroke,
            trigger_mono_ns: job.trigger_ns,
            trigger_utc_ns: job.trigger_utc_ns,
            deadline_mono_ns: job.deadline_ns,
        };
        // SAFETY: `[inst]` call of a live instance; job, frames and what they point to live for the call.
        call(|error| unsafe {
            (self.functions.run)(self.raw, &raw const raw_job, frames.as_ptr(), frames.len() as u32, error)
        })
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        self.close();
        // SAFETY: nothing is called after `destroy`.
        unsafe { (self.functions.destroy)(self.raw) };
    }
}

fn call(call: impl FnOnce(*mut abi::Error) -> abi::Status) -> Result<(), CallError> {
    let mut error = host_table::empty_error();
    match call(&raw mut error) {
        abi::status::OK => Ok(()),
        status => Err(CallError {
            status,
            retryable: error.flags & abi::error_flag::RETRYABLE != 0,
            message: host_table::message(&error, status),
        }),
    }
}
