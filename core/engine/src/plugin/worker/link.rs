//! Host's end of a worker: requests and their answers, a job and its frames, and the escalation when no answer arrives.
//!
//! The steps of the escalation are: deadline, cancellation, grace period, end of the process.

use std::fmt;
use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use platen_plant::OptionValue;
use platen_sdk::exchange::AlignedBuffer;

use super::memory::SharedMemory;
use super::process::{Process, printable};
use super::wire::{
    CallError, Device, Health, Input, Job, LoadFault, LoadedLibrary, PROTOCOL, Received, Socket, ToHost,
    ToWorker,
};
use super::{Confinement, Limits, pool, serve};
use crate::plugin::{InputFrame, ProgressSink};

pub(in crate::plugin) use super::serve::Place;

/// Time for a library to be loaded and its plugin to be created: neither touches hardware.
const START_LIMIT: Duration = Duration::from_secs(5);
/// Time for a plugin to return after its cancellation, and for a worker to end.
pub(super) const GRACE: Duration = Duration::from_millis(500);
/// Time in which a process ends after its connection.
const DEATH: Duration = Duration::from_secs(1);

/// Reason why a worker did not carry out a request.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::plugin) enum LinkError {
    /// The library cannot be used.
    Load(LoadFault),
    /// The plugin stated a failure.
    Call(CallError),
    /// The worker ended; how it ended.
    Died(String),
    /// The plugin did not return in time, and its worker was ended.
    Hung(Duration),
    /// The system provided no process or no memory.
    System(String),
}

impl From<io::Error> for LinkError {
    fn from(error: io::Error) -> Self {
        Self::System(error.to_string())
    }
}

/// A worker with one plugin. Dropping it ends the worker.
pub(in crate::plugin) struct Link {
    name: String,
    /// `None` once the link is given up, so that the worker sees the end of the connection.
    socket: Option<Socket>,
    buffer: Vec<u8>,
    pool: SharedMemory,
    /// `None` for a thread of the host.
    process: Option<Process>,
    confinement: Confinement,
    opened: bool,
    /// Receives the progress of the job.
    progress: ProgressSink,
}

impl fmt::Debug for Link {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Link")
            .field("name", &self.name)
            .field("process", &self.process)
            .finish_non_exhaustive()
    }
}

/// Message to the host, or the reason why there is none.
enum Next {
    Message(ToHost),
    Late,
    Ended,
}

impl Link {
    /// Starts a worker and loads a library in it.
    pub(in crate::plugin) fn load(
        name: &str,
        library: &Path,
        place: Place,
        limits: &Limits,
    ) -> Result<(Self, LoadedLibrary), LinkError> {
        let pool = SharedMemory::new(usize::try_from(limits.pool).unwrap_or(usize::MAX / 2).max(1 << 20))?;
        let (process, socket) = match place {
            Place::Process => {
                let (process, socket) = Process::start(name, library)?;
                (Some(process), socket)
            }
            Place::Thread => {
                let (ours, theirs) = Socket::pair()?;
                // It ends with the connection; a thread that hangs is abandoned.
                thread::Builder::new().name(name.to_owned()).spawn(|| serve::serve(theirs, Place::Thread))?;
                (None, ours)
            }
        };
        let mut link = Self {
            name: name.to_owned(),
            socket: Some(socket),
            buffer: Vec::new(),
            pool,
            process,
            confinement: Confinement::default(),
            opened: false,
            progress: ProgressSink::default(),
        };
        let request = ToWorker::Load {
            protocol: PROTOCOL,
            library: library.to_owned(),
            limits: *limits,
            log_level: log_level(),
            pool_bytes: link.pool.len() as u64,
        };
        link.send_with_pool(&request)?;
        match link.answer(START_LIMIT)? {
            ToHost::Loaded(Ok(loaded)) => Ok((link, loaded)),
            ToHost::Loaded(Err(fault)) => Err(LinkError::Load(fault)),
            _ => Err(link.out_of_turn()),
        }
    }

    /// Creates the plugin.
    pub(in crate::plugin) fn create(
        &mut self,
        plugin: &str,
        values: &[OptionValue],
        confine: bool,
    ) -> Result<(), LinkError> {
        let confine = confine && self.process.is_some();
        self.send(&ToWorker::Create { plugin: plugin.to_owned(), values: values.to_vec(), confine }, &[])?;
        match self.answer(START_LIMIT)? {
            ToHost::Created(Ok(confinement)) => {
                self.confinement = confinement;
                Ok(())
            }
            ToHost::Created(Err(error)) => Err(LinkError::Call(error)),
            _ => Err(self.out_of_turn()),
        }
    }

    /// Returns the last line that the worker printed.
    pub(in crate::plugin) fn last_line(&self) -> Option<String> {
        self.process.as_ref().and_then(Process::last_line)
    }

    /// Ends the worker, and returns the last line that it printed.
    pub(in crate::plugin) fn end(mut self) -> Option<String> {
        self.socket = None;
        let mut process = self.process.take()?;
        process.end(GRACE);
        process.last_line()
    }

    pub(in crate::plugin) fn open(&mut self, limit: Duration) -> Result<(), LinkError> {
        self.send(&ToWorker::Open, &[])?;
        match self.answer(limit)? {
            ToHost::Opened(Ok(())) => {
                self.opened = true;
                Ok(())
            }
            ToHost::Opened(Err(error)) => Err(LinkError::Call(error)),
            _ => Err(self.out_of_turn()),
        }
    }

    pub(in crate::plugin) fn estimate_s(
        &mut self,
        window: Option<[f64; 4]>,
        limit: Duration,
    ) -> Result<Option<f64>, LinkError> {
        self.send(&ToWorker::Estimate(window), &[])?;
        match self.answer(limit)? {
            ToHost::Estimated(seconds) => Ok(seconds),
            _ => Err(self.out_of_turn()),
        }
    }

    pub(in crate::plugin) fn health(&mut self, limit: Duration) -> Result<Option<Health>, LinkError> {
        self.send(&ToWorker::Health, &[])?;
        match self.answer(limit)? {
            ToHost::Health(health) => Ok(health),
            _ => Err(self.out_of_turn()),
        }
    }

    pub(in crate::plugin) fn discover(&mut self, limit: Duration) -> Result<Vec<Device>, LinkError> {
        self.send(&ToWorker::Discover, &[])?;
        match self.answer(limit)? {
            ToHost::Discovered(found) => found.map_err(LinkError::Call),
            _ => Err(self.out_of_turn()),
        }
    }

    pub(in crate::plugin) fn is_open(&self) -> bool {
        self.opened
    }

    /// Makes the next job open the plugin again.
    pub(in crate::plugin) fn reopen(&mut self) {
        self.opened = false;
    }

    pub(in crate::plugin) fn confinement(&self) -> Confinement {
        self.confinement
    }

    /// Returns the process identifier; `None` for a thread of the host.
    pub(in crate::plugin) fn process_id(&self) -> Option<u32> {
        self.process.as_ref().map(Process::id)
    }

    /// Reads the messages of an idle worker; an error if it has ended.
    pub(in crate::plugin) fn check(&mut self) -> Result<(), LinkError> {
        match self.next(Instant::now()) {
            Next::Late => Ok(()),
            Next::Ended => Err(self.died()),
            Next::Message(_) => Err(self.out_of_turn()),
        }
    }

    /// Starts a job.
    pub(in crate::plugin) fn run(
        &mut self,
        job: Job,
        inputs: &[InputFrame],
        progress: ProgressSink,
    ) -> Result<(), LinkError> {
        self.progress = progress;
        let named = inputs.iter().map(|input| Input {
            format: input.format.to_string_lossy().into_owned(),
            role: input.role.map(|role| role.to_string_lossy().into_owned()),
            bytes: input.memory.len() as u64,
        });
        let beside: Vec<BorrowedFd<'_>> = inputs.iter().map(|input| input.memory.as_fd()).collect();
        self.send(&ToWorker::Run { job, inputs: named.collect() }, &beside)
    }

    /// Cancels a job; its remaining frames and its end follow.
    pub(in crate::plugin) fn cancel(&mut self, job: u64) {
        // A worker that has ended is detected at the next message.
        let _ = self.send(&ToWorker::Cancel(job), &[]);
    }

    /// Returns the next frame or the end of a job; `None` if none arrives in time.
    pub(in crate::plugin) fn next_of_job(
        &mut self,
        id: u64,
        until: Instant,
    ) -> Result<Option<JobEvent>, LinkError> {
        match self.next(until) {
            Next::Late => Ok(None),
            Next::Ended => Err(self.died()),
            Next::Message(ToHost::Frame { job, format, offset, bytes }) if job == id => {
                let too_large = || LinkError::Died(format!("it named {bytes} bytes at {offset} of its pool"));
                if offset.checked_add(bytes).is_none_or(|end| end > self.pool.len() as u64) {
                    return Err(too_large());
                }
                let mut copy = AlignedBuffer::new(bytes as usize);
                self.pool.copy(offset, bytes, copy.as_mut()).ok_or_else(too_large)?;
                pool::release(&self.pool);
                Ok(Some(JobEvent::Frame { format: printable(&format), buffer: copy }))
            }
            Next::Message(ToHost::Done { job, result }) if job == id => Ok(Some(JobEvent::Done(result))),
            Next::Message(_) => Err(self.out_of_turn()),
        }
    }

    fn send(&self, message: &ToWorker, beside: &[BorrowedFd<'_>]) -> Result<(), LinkError> {
        // The send to a worker that has ended fails; how it ended is found when the answer is read.
        match self.socket.as_ref().map(|socket| socket.send(message, beside)) {
            None | Some(Ok(())) => Ok(()),
            Some(Err(error)) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
            Some(Err(error)) if error.kind() == io::ErrorKind::ConnectionReset => Ok(()),
            Some(Err(error)) => Err(error.into()),
        }
    }

    fn send_with_pool(&self, message: &ToWorker) -> Result<(), LinkError> {
        self.send(message, &[self.pool.as_fd()])
    }

    fn answer(&mut self, limit: Duration) -> Result<ToHost, LinkError> {
        let start = Instant::now();
        match self.next(start + limit) {
            Next::Message(message) => Ok(message),
            Next::Late => Err(LinkError::Hung(start.elapsed())),
            Next::Ended => Err(self.died()),
        }
    }

    /// Returns the next message that is neither log nor progress.
    fn next(&mut self, until: Instant) -> Next {
        loop {
            let Some(socket) = &self.socket else { return Next::Ended };
            match socket.receive(Some(until), &mut self.buffer) {
                Received::Message(ToHost::Log { job, level, text }, _) => log(&self.name, job, level, &text),
                Received::Message(ToHost::Progress { fraction, phase, .. }, _) => {
                    self.progress.report(fraction, &printable(&phase));
                }
                Received::Message(message, _) => return Next::Message(message),
                Received::Late => return Next::Late,
                Received::Ended => return Next::Ended,
            }
        }
    }

    fn out_of_turn(&self) -> LinkError {
        LinkError::Died("it sent what nobody asked for".into())
    }

    /// Returns how the worker ended; the end of its connection is noticed before that of its process.
    fn died(&mut self) -> LinkError {
        self.socket = None;
        let how = match &mut self.process {
            None => "its thread ended".to_owned(),
            Some(process) => match (process.end(DEATH), process.last_line()) {
                (how, Some(line)) => format!("{how} (its last line: {line})"),
                (how, None) => how,
            },
        };
        self.process = None;
        LinkError::Died(how)
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        self.socket = None;
        if let Some(process) = &mut self.process {
            process.end(GRACE);
        }
    }
}

/// Event of a running job: a frame, or its end.
#[derive(Debug)]
pub(in crate::plugin) enum JobEvent {
    Frame { format: String, buffer: AlignedBuffer },
    Done(Result<(), CallError>),
}

/// Returns a number for a job that is unique in this host.
pub(in crate::plugin) fn new_job() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(1);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

/// Returns the most detailed level of the host's log for plugins.
fn log_level() -> i32 {
    use tracing::Level;
    match () {
        () if tracing::enabled!(target: "plugin", Level::TRACE) => 5,
        () if tracing::enabled!(target: "plugin", Level::DEBUG) => 4,
        () if tracing::enabled!(target: "plugin", Level::INFO) => 3,
        () if tracing::enabled!(target: "plugin", Level::WARN) => 2,
        () => 1,
    }
}

/// Logs a line of a plugin.
pub(in crate::plugin) fn log(plugin: &str, job: u64, level: i32, text: &str) {
    let text = printable(text);
    match level {
        1 => tracing::error!(target: "plugin", plugin, job, "{text}"),
        2 => tracing::warn!(target: "plugin", plugin, job, "{text}"),
        3 => tracing::info!(target: "plugin", plugin, job, "{text}"),
        4 => tracing::debug!(target: "plugin", plugin, job, "{text}"),
        _ => tracing::trace!(target: "plugin", plugin, job, "{text}"),
    }
}
