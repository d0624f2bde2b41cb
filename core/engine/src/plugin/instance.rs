//! One configured plugin, with a thread of its own for all its calls.
#![allow(unsafe_code, reason = "calls through the plugin's table")]

use std::ffi::{CStr, CString};
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, channel, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use platen_abi as abi;
use platen_abi::payload;
use platen_plant::OptionValue;
use platen_scan::Window;
use platen_sdk::exchange::{AlignedBuffer, DecodeError, Payload, to_raw_window};

use super::job::{self, CancelToken, Event, JobSpec, Listed};
use super::values::Values;
use super::{Kind, Library, PluginError, host_table};

/// Grace period: time for a plugin to return after its cancellation. A plugin that exceeds it ends the host, hence long
/// enough for a busy computer.
const GRACE: Duration = Duration::from_secs(2);

/// Period at which a waiting job checks for cancellation.
const CANCEL_POLL: Duration = Duration::from_millis(20);

/// Capacity of the queue between a plugin and its consumer, frames: both stay busy, and memory is bounded.
const FRAMES_UNDER_WAY: usize = 64;

/// An input frame of a job.
#[derive(Debug)]
pub(super) struct InputFrame {
    pub(super) format: &'static CStr,
    pub(super) role: Option<&'static CStr>,
    pub(super) buffer: AlignedBuffer,
}

impl InputFrame {
    pub(super) fn new<T: Payload>(value: &T, role: Option<&'static CStr>) -> Self {
        Self { format: T::FORMAT, role, buffer: value.to_buffer() }
    }
}

type Reply<T> = SyncSender<T>;

enum Command {
    Open(Reply<Result<(), PluginError>>),
    Estimate(Option<payload::Window>, Reply<Option<f64>>),
    Arm(abi::Job, Reply<Result<(), PluginError>>),
    Run(abi::Job, Vec<InputFrame>, SyncSender<Event>),
}

/// The C instance. Only `cancel` may be called through it from other threads.
#[derive(Debug, Clone, Copy)]
struct Raw(*mut abi::Instance);
// SAFETY: the boundary allows `cancel` from any thread; all else is called by the instance's own thread.
unsafe impl Send for Raw {}

/// One configured plugin. Dropping it closes and destroys the plugin's instance.
#[derive(Debug)]
pub struct Instance {
    name: String,
    commands: Option<Sender<Command>>,
    raw: Raw,
    thread: Option<JoinHandle<()>>,
}

impl Instance {
    /// Creates an instance of a plugin with checked option values. Accesses no hardware.
    ///
    /// # Errors
    /// Wrong kind, or the plugin's reason to refuse the values.
    pub fn create(library: &Library, kind: Kind, values: &[OptionValue]) -> Result<Self, PluginError> {
        let descriptor = library.descriptor();
        let name = descriptor.id.clone();
        if descriptor.kind != kind {
            let found = descriptor.kind.name().to_owned();
            return Err(PluginError::WrongKind { name, found, needed: kind.name() });
        }
        let (commands, inbox) = channel();
        let (made, created) = sync_channel(1);
        let (entry, id, values) = (library.entry(), name.clone(), Values::new(values));
        let thread = std::thread::Builder::new().name(name.clone()).spawn(move || {
            let raw = create(entry, &id, &values);
            if let Ok(raw) = raw {
                // The instance's `[inst]` calls all come from this thread.
                let _ = made.send(Ok(Raw(raw)));
                serve(raw, &id, &inbox);
            } else if let Err(error) = raw {
                let _ = made.send(Err(error));
            }
        });
        let failed = |message: String| PluginError::Failed { name: name.clone(), message, retryable: false };
        let thread = thread.map_err(|e| failed(format!("no thread for it: {e}")))?;
        let raw = created.recv().map_err(|_| failed("its thread ended".into()))??;
        Ok(Self { name, commands: Some(commands), raw, thread: Some(thread) })
    }

    /// Returns the name in plant files.
    pub fn name(&self) -> &str {
        &self.name
    }

    fn ask<T>(&self, limit: Duration, command: impl FnOnce(Reply<T>) -> Command) -> Result<T, PluginError> {
        let start = Instant::now();
        let (reply, answer) = sync_channel(1);
        if let Some(commands) = &self.commands {
            // A thread that ended shows as a disconnected answer below.
            let _ = commands.send(command(reply));
        }
        answer.recv_timeout(limit).map_err(|e| match e {
            RecvTimeoutError::Timeout => self.hangs(start),
            RecvTimeoutError::Disconnected => self.died(),
        })
    }

    fn hangs(&self, start: Instant) -> PluginError {
        PluginError::Hangs { name: self.name.clone(), elapsed_ms: start.elapsed().as_millis() as u64 }
    }

    fn died(&self) -> PluginError {
        self.misbehaved("its thread ended")
    }

    /// Returns the error of a plugin that violated the contract of the boundary.
    pub(super) fn misbehaved(&self, what: impl Into<String>) -> PluginError {
        PluginError::Misbehaved { name: self.name.clone(), what: what.into() }
    }

    /// Opens the instance: the plugin connects to its device.
    ///
    /// # Errors
    /// The plugin's reason, or [`PluginError::Hangs`].
    pub fn open(&self, limit: Duration) -> Result<(), PluginError> {
        self.ask(limit, Command::Open)?
    }

    /// Returns the duration of a scan of the window, seconds, if the plugin can estimate it.
    ///
    /// # Errors
    /// [`PluginError::Hangs`].
    pub fn estimate_s(&self, window: Option<&Window>, limit: Duration) -> Result<Option<f64>, PluginError> {
        let window = window.map(to_raw_window);
        self.ask(limit, |reply| Command::Estimate(window, reply))
    }

    /// Prepares for the next trigger.
    ///
    /// # Errors
    /// The plugin's reason, or [`PluginError::Hangs`].
    pub fn arm(&self, spec: JobSpec) -> Result<(), PluginError> {
        let (reports, _receiver) = sync_channel(1);
        let listed = job::begin(Instant::now() + spec.limit, reports);
        let raw = raw_job(&listed, &spec);
        self.ask(spec.limit + GRACE, |reply| Command::Arm(raw, reply))?
    }

    pub(super) fn start(&self, spec: JobSpec, inputs: Vec<InputFrame>) -> RunningJob<'_> {
        let (reports, inbox) = sync_channel(FRAMES_UNDER_WAY);
        let started = Instant::now();
        let listed = job::begin(started + spec.limit, reports.clone());
        let raw = raw_job(&listed, &spec);
        if let Some(commands) = &self.commands {
            // A thread that ended shows as a disconnected inbox.
            let _ = commands.send(Command::Run(raw, inputs, reports));
        }
        RunningJob {
            instance: self,
            listed,
            inbox,
            started,
            token: spec.cancel,
            cancelled_at: None,
            result: None,
        }
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        drop(self.commands.take());
        if let Some(thread) = self.thread.take() {
            let end = Instant::now() + GRACE;
            while !thread.is_finished() && Instant::now() < end {
                std::thread::park_timeout(Duration::from_millis(2));
            }
            if thread.is_finished() {
                let _ = thread.join();
            } else {
                tracing::warn!(
                    plugin = self.name,
                    "the plugin does not return from closing; its thread is abandoned"
                );
            }
        }
    }
}

/// A frame that a plugin emitted.
#[derive(Debug)]
pub struct Emitted {
    /// Name of the format.
    pub format: String,
    /// Bits of `platen_abi::frame_flag`.
    pub flags: u32,
    pub(super) buffer: AlignedBuffer,
}

impl Emitted {
    /// Returns the data, unchecked.
    pub fn bytes(&self) -> &[u8] {
        self.buffer.as_ref()
    }

    /// Whether the frame has the format of `T`.
    pub fn is<T: Payload>(&self) -> bool {
        self.format.as_bytes() == T::FORMAT.to_bytes()
    }

    /// Reads the value in the frame.
    ///
    /// # Errors
    /// As [`Payload::decode`].
    pub fn decode<T: Payload>(&self) -> Result<T, DecodeError> {
        T::decode(self.bytes())
    }
}

/// A job in progress. Dropping it before its end cancels it and waits for the plugin.
#[derive(Debug)]
pub struct RunningJob<'a> {
    instance: &'a Instance,
    listed: Listed,
    inbox: Receiver<Event>,
    started: Instant,
    token: CancelToken,
    cancelled_at: Option<Instant>,
    result: Option<Result<(), PluginError>>,
}

impl RunningJob<'_> {
    /// Returns the next frame; `None` at the end of the job.
    pub fn next_frame(&mut self) -> Option<Emitted> {
        while self.result.is_none() {
            if self.token.is_cancelled() && self.cancelled_at.is_none() {
                self.cancel();
            }
            let until = self.cancelled_at.map_or(self.listed.0.deadline, |at| at + GRACE);
            let left = until.saturating_duration_since(Instant::now());
            match self.inbox.recv_timeout(left.min(CANCEL_POLL)) {
                Ok(Event::Frame(frame)) if self.cancelled_at.is_none() => return Some(frame),
                Ok(Event::Frame(_)) => {}
                Ok(Event::Done(result)) => self.result = Some(self.judge(result)),
                Err(RecvTimeoutError::Timeout) if left > CANCEL_POLL => {}
                Err(RecvTimeoutError::Timeout) if self.cancelled_at.is_none() => self.cancel(),
                Err(RecvTimeoutError::Timeout) => self.result = Some(Err(self.instance.hangs(self.started))),
                Err(RecvTimeoutError::Disconnected) => self.result = Some(Err(self.instance.died())),
            }
        }
        None
    }

    /// Returns how the job ended: a job that was stopped is reported as stopped, whatever status the plugin returned.
    fn judge(&self, result: Result<(), PluginError>) -> Result<(), PluginError> {
        if self.cancelled_at.is_none() && !(result.is_err() && self.listed.0.is_stopped()) {
            return result;
        }
        let late = Instant::now() >= self.listed.0.deadline;
        Err(PluginError::Stopped {
            name: self.instance.name.clone(),
            elapsed_ms: self.started.elapsed().as_millis() as u64,
            why: if late { "its deadline passed" } else { "it was cancelled" },
        })
    }

    /// Cancels the job; later frames are dropped.
    pub fn cancel(&mut self) {
        self.cancelled_at = Some(Instant::now());
        self.listed.0.cancelled.store(true, Ordering::Relaxed);
        let raw = self.instance.raw.0;
        // SAFETY: `cancel` may be called at any time while the instance lives, which `self.instance` ensures.
        unsafe { ((*raw).cancel)(raw, self.listed.0.id) };
    }

    /// Waits for the end; later frames are dropped.
    ///
    /// # Errors
    /// The reason of the failure.
    pub fn finish(&mut self) -> Result<(), PluginError> {
        while self.next_frame().is_some() {}
        self.result.clone().unwrap_or(Ok(()))
    }

    pub(super) fn misbehaved(&self, what: impl Into<String>) -> PluginError {
        self.instance.misbehaved(what)
    }
}

impl Drop for RunningJob<'_> {
    fn drop(&mut self) {
        if self.result.is_some() {
            return;
        }
        if self.cancelled_at.is_none() {
            self.cancel();
        }
        let hung = matches!(self.finish(), Err(PluginError::Hangs { .. }));
        tracing::debug!(plugin = self.instance.name, hung, "cancelled before its end");
    }
}

fn raw_job(listed: &Listed, spec: &JobSpec) -> abi::Job {
    let since_trigger = spec.trigger.elapsed();
    let utc = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().saturating_sub(since_trigger);
    abi::Job {
        struct_size: size_of::<abi::Job>() as u32,
        reserved: 0,
        job_id: listed.0.id,
        stroke_no: spec.stroke,
        trigger_mono_ns: job::mono_ns(spec.trigger),
        trigger_utc_ns: i64::try_from(utc.as_nanos()).unwrap_or(i64::MAX),
        deadline_mono_ns: job::mono_ns(listed.0.deadline),
    }
}

fn create(entry: &abi::Entry, name: &str, values: &Values) -> Result<*mut abi::Instance, PluginError> {
    let id = CString::new(name).unwrap_or_default();
    let (mut error, mut instance) = (host_table::empty_error(), std::ptr::null_mut());
    let rows = values.as_slice();
    // SAFETY: everything passed lives for the call.
    let status = unsafe {
        let host = host_table::get();
        (entry.create)(host, id.as_ptr(), rows.as_ptr(), rows.len() as u32, &raw mut instance, &raw mut error)
    };
    if status != abi::status::OK {
        return Err(PluginError::RefusedOptions {
            name: name.to_owned(),
            message: host_table::message(&error),
        });
    }
    // SAFETY: null, or the instance that the plugin made.
    match unsafe { instance.as_ref() } {
        Some(made) if made.struct_size as usize >= size_of::<abi::Instance>() => Ok(instance),
        _ => Err(PluginError::Misbehaved {
            name: name.to_owned(),
            what: "it created no valid instance".into(),
        }),
    }
}

/// The thread of one instance: executes commands until the host drops the instance, then closes and destroys it.
fn serve(raw: *mut abi::Instance, name: &str, inbox: &Receiver<Command>) {
    // SAFETY: of all calls here: `[inst]` calls of a live instance, all from this thread.
    let table = unsafe { &*raw };
    let mut opened = false;
    while let Ok(command) = inbox.recv() {
        match command {
            Command::Open(reply) => {
                // SAFETY: as above.
                let result = call(name, |error| unsafe { (table.open)(raw, error) });
                opened = result.is_ok();
                let _ = reply.send(result);
            }
            // SAFETY: as above.
            Command::Estimate(window, reply) => drop(reply.send(unsafe { estimate(raw, window.as_ref()) })),
            Command::Arm(job, reply) => {
                let result = table.arm.map_or(Ok(()), |arm| {
                    // SAFETY: as above.
                    call(name, |error| unsafe { arm(raw, &raw const job, error) })
                });
                let _ = reply.send(result);
            }
            Command::Run(job, inputs, reports) => {
                let attrs: Vec<Option<abi::Attr>> = inputs.iter().map(role).collect();
                let frames: Vec<abi::Frame> = inputs.iter().zip(&attrs).map(frame).collect();
                // SAFETY: as above; frames and attributes live for the call.
                let result = call(name, |error| unsafe {
                    (table.run)(raw, &raw const job, frames.as_ptr(), frames.len() as u32, error)
                });
                let _ = reports.send(Event::Done(result));
            }
        }
    }
    // SAFETY: as above; nothing is called after `destroy`.
    unsafe {
        if opened {
            (table.close)(raw);
        }
        (table.destroy)(raw);
    }
}

fn role(input: &InputFrame) -> Option<abi::Attr> {
    input.role.map(|role| abi::Attr { key: c"role".as_ptr(), value: role.as_ptr() })
}

fn frame((input, attr): (&InputFrame, &Option<abi::Attr>)) -> abi::Frame {
    let bytes = input.buffer.as_ref();
    abi::Frame {
        struct_size: size_of::<abi::Frame>() as u32,
        flags: 0,
        format: input.format.as_ptr(),
        frame_id: c"scanner".as_ptr(),
        mono_ns: 0,
        count: 0,
        buffer: abi::Buffer { data: bytes.as_ptr().cast_mut().cast(), bytes: bytes.len() as u64, token: 0 },
        attrs: attr.as_ref().map_or(std::ptr::null(), std::ptr::from_ref),
        n_attrs: u32::from(attr.is_some()),
        reserved: 0,
    }
}

fn call(name: &str, call: impl FnOnce(*mut abi::Error) -> abi::Status) -> Result<(), PluginError> {
    let mut error = host_table::empty_error();
    match call(&raw mut error) {
        abi::status::OK => Ok(()),
        _ => Err(PluginError::Failed {
            name: name.to_owned(),
            message: host_table::message(&error),
            retryable: error.flags & abi::error_flag::RETRYABLE != 0,
        }),
    }
}

/// # Safety
/// `[inst]` call of a live instance.
unsafe fn estimate(raw: *mut abi::Instance, window: Option<&payload::Window>) -> Option<f64> {
    // SAFETY: as the caller promises; the table, when given, is as long as it says.
    let seconds = unsafe {
        let table =
            ((*raw).get_extension)(raw, abi::EXT_ESTIMATE.as_ptr()).cast::<abi::Estimate>().as_ref()?;
        if (table.struct_size as usize) < size_of::<abi::Estimate>() {
            return None;
        }
        (table.scan_seconds)(raw, window.map_or(std::ptr::null(), std::ptr::from_ref))
    };
    (seconds >= 0.0).then_some(seconds)
}
