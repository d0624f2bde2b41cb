//! One configured plugin: its worker, started again after a fault, and given up after too many.

mod running_job;

use std::ffi::CStr;
use std::fs;
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, TryLockError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use platen_abi::status;
use platen_plant::OptionValue;
use platen_scan::Window;
use platen_sdk::exchange::Payload;
use platen_sdk::{Device, Health};

pub use running_job::{Emitted, RunningJob};

use super::faults::Faults;
use super::job::JobSpec;
use super::worker::{CallError, Confinement, Job, Link, LinkError, SharedMemory, new_job, printable};
use super::{Descriptor, Isolation, Kind, Library, PluginError, Quarantined, clock, library};

/// Time for a driver to search for devices: 3 s for the search, the rest as a margin.
const DISCOVERY_LIMIT: Duration = Duration::from_secs(5);
/// Time for the state of an instrument, which the driver must return without a request to the instrument.
const HEALTH_LIMIT: Duration = Duration::from_secs(1);

/// An input of a job, in memory that the plugin can only read.
#[derive(Debug)]
pub(super) struct InputFrame {
    pub(super) format: &'static CStr,
    pub(super) role: Option<&'static CStr>,
    pub(super) memory: SharedMemory,
}

impl InputFrame {
    pub(super) fn new<T: Payload>(value: &T, role: Option<&'static CStr>) -> io::Result<Self> {
        let memory = value.encode(SharedMemory::new)?;
        memory.seal()?;
        Ok(Self { format: T::FORMAT, role, memory })
    }
}

/// One configured plugin. Dropping it ends its worker.
#[derive(Debug)]
pub struct Instance {
    library: Library,
    values: Vec<OptionValue>,
    /// Stroke number of the jobs that give none.
    stroke: AtomicU64,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    link: Option<Link>,
    /// The host has opened it: after a lost link the next job opens it again.
    opened: bool,
    /// SHA-256 of the library that the link runs.
    sha256: String,
    faults: Faults,
    /// Content that failed too often, and the state of its file at that time.
    given_up: Option<(Quarantined, Option<Stamp>)>,
    /// A job was repeated in a new process since the last call of `take_retried`.
    retried: bool,
}

/// Inode, size and modification time (seconds, nanoseconds) of a file: they change with its content and can be read
/// without opening it.
type Stamp = (u64, u64, i64, i64);

fn stamp(path: &Path) -> Option<Stamp> {
    fs::metadata(path).ok().map(|file| (file.ino(), file.size(), file.mtime(), file.mtime_nsec()))
}

/// State of a plugin's worker, for maintenance.
#[derive(Debug, Clone, PartialEq)]
pub struct WorkerState {
    /// Name of the plugin.
    pub plugin: String,
    /// Process identifier; `None` when there is no process.
    pub process: Option<u32>,
    /// Private memory, bytes.
    pub memory: Option<u64>,
    /// Open descriptors.
    pub files: Option<u64>,
    /// Threads.
    pub threads: Option<u64>,
    /// Last line that it printed.
    pub printed: Option<String>,
    /// Sandbox in force.
    pub confinement: Confinement,
    /// Faults since the start of the host.
    pub faults: u64,
    /// Reason why it is out of use.
    pub out_of_use: Option<String>,
}

impl Instance {
    /// Creates a plugin with checked option values. Accesses no hardware.
    ///
    /// # Errors
    /// Wrong kind, or the plugin's reason to refuse the values.
    pub fn create(library: &Library, kind: Kind, values: &[OptionValue]) -> Result<Self, PluginError> {
        let descriptor = library.descriptor();
        if descriptor.kind != kind {
            let (name, found) = (descriptor.id.clone(), descriptor.kind.name().to_owned());
            return Err(PluginError::WrongKind { name, found, needed: kind.name() });
        }
        let instance = Self {
            library: library.clone(),
            values: values.to_vec(),
            stroke: AtomicU64::new(0),
            state: Mutex::default(),
        };
        instance.revive()?;
        Ok(instance)
    }

    /// Returns the name in plant files.
    #[expect(clippy::misnamed_getters, reason = "the name of a description is a title for people")]
    pub fn name(&self) -> &str {
        &self.library.descriptor().id
    }

    /// Returns the description of the plugin.
    pub fn descriptor(&self) -> &Descriptor {
        self.library.descriptor()
    }

    /// Returns the SHA-256 of the library that is in use, hexadecimal.
    pub fn sha256(&self) -> String {
        self.state().map(|state| state.sha256.clone()).unwrap_or_default()
    }

    /// Sets the stroke number of the following jobs, 0 for none.
    pub fn at_stroke(&self, stroke: u64) {
        self.stroke.store(stroke, Ordering::Relaxed);
    }

    /// Returns the specification of an evaluation at this stroke.
    pub(super) fn evaluation(&self, limit: Duration) -> JobSpec {
        JobSpec { stroke: self.stroke.load(Ordering::Relaxed), ..JobSpec::untriggered(limit) }
    }

    /// Returns whether the plugin runs in a process of its own.
    pub fn is_isolated(&self) -> bool {
        self.library.settings.isolation == Isolation::Process
    }

    /// Returns the state; an error while a job runs, which holds it until its end.
    fn state(&self) -> Result<MutexGuard<'_, State>, PluginError> {
        match self.state.try_lock() {
            Ok(state) => Ok(state),
            Err(TryLockError::Poisoned(poisoned)) => Ok(poisoned.into_inner()),
            Err(TryLockError::WouldBlock) => Err(PluginError::Failed {
                name: self.name().to_owned(),
                message: "its job before has not ended".into(),
                retryable: true,
            }),
        }
    }

    /// Checks an idle worker.
    ///
    /// # Errors
    /// The reason why the worker ended, returned once.
    pub fn check(&self) -> Result<(), PluginError> {
        let mut state = self.state()?;
        let checked = state.link.as_mut().map_or(Ok(()), Link::check);
        checked.map_err(|error| self.failed(&mut state, error, Instant::now()))
    }

    /// Ensures that there is a worker in which the plugin is created: checks an idle one, starts a missing one.
    ///
    /// # Errors
    /// The reason why there is no worker.
    pub fn revive(&self) -> Result<(), PluginError> {
        if let Err(error) = self.check() {
            tracing::error!("{error}");
        }
        let mut state = self.state()?;
        let limit = self.library.settings.limits.memory / 2;
        if let Some(held) = state.link.as_ref().and_then(Link::process_id).and_then(private_memory)
            && held > limit
        {
            let (plugin, mib) = (self.name(), held >> 20);
            tracing::warn!(plugin, "it holds {mib} MiB between two jobs: a fresh process takes its place");
            state.link = None;
        }
        self.link(&mut state).map(drop)
    }

    /// Returns the worker; starts a new one where there is none.
    fn link<'a>(&self, state: &'a mut State) -> Result<&'a mut Link, PluginError> {
        let link = match state.link.take() {
            Some(link) => link,
            None => self.start(state)?,
        };
        Ok(state.link.insert(link))
    }

    fn start(&self, state: &mut State) -> Result<Link, PluginError> {
        let name = || self.name().to_owned();
        let path = self.library.path();
        let quarantine = self.library.quarantine.as_ref();
        if let Some((held, file)) = &state.given_up {
            let released = quarantine.is_some_and(|quarantine| quarantine.find(&held.sha256).is_none());
            if !released && stamp(path) == *file {
                return Err(quarantined(held.clone()));
            }
            state.faults.forget();
        }
        let rest = state.faults.rest(Instant::now());
        if !rest.is_zero() {
            let wait_s = rest.as_secs() + 1;
            return Err(PluginError::Resting { name: name(), wait_s, why: state.faults.why().to_owned() });
        }
        let file = stamp(path);
        let (mut link, about) = library::start(path, self.library.settings)?;
        if let Some(held) = quarantine.and_then(|quarantine| quarantine.find(&about.sha256)) {
            state.given_up = Some((held.clone(), file));
            return Err(quarantined(held));
        }
        if state.given_up.take().is_some() || (!state.sha256.is_empty() && about.sha256 != state.sha256) {
            tracing::warn!(
                plugin = self.name(),
                sha256 = about.sha256,
                "started from another content, or released"
            );
            state.faults.forget();
        }
        state.sha256 = about.sha256;
        let ours = self.library.descriptor();
        let same = about
            .plugins
            .iter()
            .any(|plugin| plugin.id == ours.id && plugin.kind == ours.kind && plugin.options == ours.options);
        if !same {
            return Err(PluginError::Replaced { name: name(), path: path.to_owned() });
        }
        let confine = ours.kind != Kind::Scanner;
        link.create(&ours.id, &self.values, confine).map_err(|error| match error {
            LinkError::Call(CallError { message, .. }) => {
                PluginError::RefusedOptions { name: name(), message }
            }
            other => self.failed(state, other, Instant::now()),
        })?;
        Ok(link)
    }

    /// Opens the plugin: it connects to its device, again when it was connected.
    ///
    /// # Errors
    /// The plugin's reason, or the reason why it has no worker.
    pub fn open(&self, limit: Duration) -> Result<(), PluginError> {
        let mut state = self.state()?;
        let start = Instant::now();
        state.opened = true;
        let opened = self.link(&mut state)?.open(limit);
        opened.map_err(|error| self.failed(&mut state, error, start))
    }

    /// Returns the duration of a scan of the window, seconds, if the plugin can estimate it.
    ///
    /// # Errors
    /// The reason why it has no worker or does not answer.
    pub fn estimate_s(&self, window: Option<&Window>, limit: Duration) -> Result<Option<f64>, PluginError> {
        let mut state = self.state()?;
        let start = Instant::now();
        let raw = window.map(|w| [w.azimuth_start, w.azimuth_width, w.elevation_min, w.elevation_max]);
        let seconds = self.link(&mut state)?.estimate_s(raw, limit);
        seconds.map_err(|error| self.failed(&mut state, error, start))
    }

    /// Returns the state of the plugin's instrument, if the plugin reports it.
    ///
    /// # Errors
    /// The reason why it has no worker or does not answer.
    pub fn health(&self) -> Result<Option<Health>, PluginError> {
        let mut state = self.state()?;
        let start = Instant::now();
        let health = self.link(&mut state)?.health(HEALTH_LIMIT);
        let health = health.map_err(|error| self.failed(&mut state, error, start))?;
        Ok(health.map(|raw| {
            Health::from_raw(&platen_abi::Health {
                struct_size: 0,
                flags: raw.flags,
                temperature_c: raw.temperature_c,
                battery: raw.battery,
                tilt: raw.tilt,
            })
        }))
    }

    /// Returns the devices that a driver finds in reach, without opening any.
    ///
    /// # Errors
    /// The plugin cannot search for devices, has no worker, or does not answer.
    pub fn discover(&self) -> Result<Vec<Device>, PluginError> {
        let mut state = self.state()?;
        let start = Instant::now();
        let found = self.link(&mut state)?.discover(DISCOVERY_LIMIT);
        let found = found.map_err(|error| self.failed(&mut state, error, start))?;
        let device = |it: super::worker::Device| Device {
            option: printable(&it.option),
            value: printable(&it.value),
            about: printable(&it.about),
        };
        Ok(found.into_iter().map(device).collect())
    }

    /// Returns whether a job was repeated in a new process since the last call of this function.
    pub fn take_retried(&self) -> bool {
        self.state().is_ok_and(|mut state| std::mem::take(&mut state.retried))
    }

    /// Returns the state of the worker; `None` while a job runs.
    pub fn worker_state(&self) -> Option<WorkerState> {
        let state = self.state().ok()?;
        let process = state.link.as_ref().and_then(Link::process_id);
        let given_up = state.given_up.as_ref().map(|(held, _)| quarantined(held.clone()).to_string());
        Some(WorkerState {
            plugin: self.name().to_owned(),
            process,
            memory: process.and_then(private_memory),
            files: process.and_then(|process| {
                fs::read_dir(format!("/proc/{process}/fd")).ok().map(|files| files.count() as u64)
            }),
            printed: state.link.as_ref().and_then(Link::last_line),
            threads: process.and_then(|process| library::status(process, "Threads")),
            confinement: state.link.as_ref().map(Link::confinement).unwrap_or_default(),
            faults: state.faults.count(),
            out_of_use: given_up.or_else(|| state.link.is_none().then(|| state.faults.why().to_owned())),
        })
    }

    /// Encodes a value in memory that the plugin can read.
    pub(super) fn input<T: Payload>(
        &self,
        value: &T,
        role: Option<&'static CStr>,
    ) -> Result<InputFrame, PluginError> {
        InputFrame::new(value, role).map_err(|why| PluginError::Failed {
            name: self.name().to_owned(),
            message: format!("the system has no memory for its input: {why}"),
            retryable: true,
        })
    }

    /// Starts a job.
    pub(super) fn run(&self, spec: JobSpec, inputs: &[InputFrame]) -> Result<RunningJob<'_>, PluginError> {
        let mut state = self.state()?;
        let started = Instant::now();
        state.faults.job();
        let opened = state.opened;
        let link = self.link(&mut state)?;
        if opened && !link.is_open() {
            let opened = link.open(spec.limit);
            opened.map_err(|error| self.failed(&mut state, error, started))?;
        }
        let job = job(&spec, started);
        let sent = self.link(&mut state)?.run(job, inputs, spec.progress);
        sent.map_err(|error| self.failed(&mut state, error, started))?;
        Ok(RunningJob::new(self, state, job.id, started, spec.limit, spec.cancel))
    }

    /// Runs a job, and a second time in a new process if the plugin's process ended or its answer was invalid.
    pub(super) fn twice<T>(&self, job: impl Fn() -> Result<T, PluginError>) -> Result<T, PluginError> {
        match job() {
            Err(error) if error.is_fault() && !matches!(error, PluginError::Hangs { .. }) => {
                tracing::error!("{error}; once more in a fresh process");
                let again = job();
                self.state()?.retried = again.is_ok();
                again.map_err(|second| if second.is_out_of_use() { error } else { second })
            }
            other => other,
        }
    }

    /// Records an error of the worker, and returns it as an error of the plugin.
    fn failed(&self, state: &mut State, error: LinkError, since: Instant) -> PluginError {
        let name = self.name().to_owned();
        let failed = |message, retryable| PluginError::Failed { name: name.clone(), message, retryable };
        match error {
            LinkError::Load(fault) => PluginError::of_load(fault, self.library.path()),
            LinkError::System(why) => failed(format!("the system refuses: {why}"), true),
            LinkError::Died(how) => self.fault(state, PluginError::Died { name, how }),
            LinkError::Hung(_) => {
                let elapsed_ms = since.elapsed().as_millis() as u64;
                self.fault(state, PluginError::Hangs { name, elapsed_ms })
            }
            LinkError::Call(CallError { status, retryable, message }) => match status {
                status::MEMORY | status::STATE | status::INTERNAL | status::CANCELLED => {
                    self.fault(state, failed(message, retryable))
                }
                _ => {
                    let lost = matches!(status, status::TIMEOUT | status::DISCONNECTED | status::IO);
                    if let Some(link) = state.link.as_mut().filter(|_| lost || status <= status::VENDOR) {
                        link.reopen();
                    }
                    let again = matches!(status, status::TIMEOUT | status::DISCONNECTED | status::BUSY);
                    failed(message, retryable || again)
                }
            },
        }
    }

    /// Counts a fault: the process is not used again, and after too many faults nor is the library.
    fn fault(&self, state: &mut State, error: PluginError) -> PluginError {
        state.link = None;
        let why = error.to_string();
        if !state.faults.add(&why, Instant::now()) {
            return error;
        }
        let (path, faults) = (self.library.path(), state.faults.count());
        let held = Quarantined {
            plugin: self.name().to_owned(),
            library: path.to_owned(),
            sha256: state.sha256.clone(),
            why,
            faults,
            since: jiff::Timestamp::now(),
        };
        tracing::error!("{}", quarantined(held.clone()));
        if let Some(quarantine) = &self.library.quarantine
            && let Err(why) = quarantine.add(held.clone())
        {
            tracing::error!("the quarantine is not kept: {why}");
        }
        state.given_up = Some((held, stamp(path)));
        error
    }
}

fn quarantined(Quarantined { plugin, library, why, faults, .. }: Quarantined) -> PluginError {
    PluginError::Quarantined { name: plugin, path: library, faults, why }
}

/// Returns the private memory of a process, bytes.
fn private_memory(process: u32) -> Option<u64> {
    let text = fs::read_to_string(format!("/proc/{process}/statm")).ok()?;
    let mut pages = text.split(' ').skip(1).map(|n| n.parse::<u64>().ok());
    let (resident, shared) = (pages.next()??, pages.next()??);
    Some(resident.saturating_sub(shared) * 4096)
}

fn job(spec: &JobSpec, now: Instant) -> Job {
    let utc = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let utc = utc.saturating_sub(spec.trigger.elapsed());
    Job {
        id: new_job(),
        stroke: spec.stroke,
        trigger_ns: clock::ns_at(spec.trigger),
        trigger_utc_ns: i64::try_from(utc.as_nanos()).unwrap_or(i64::MAX),
        deadline_ns: clock::ns_at(now + spec.limit),
    }
}
