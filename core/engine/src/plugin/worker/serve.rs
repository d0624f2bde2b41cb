//! Worker's end of the connection: loads a library, creates one plugin, and carries out the host's requests one after
//! another.
//!
//! The plugin's `[inst]` calls all come from this thread; a second one reads the socket and cancels jobs. The worker
//! ends when the socket closes, so no worker outlives its host.
#![allow(unsafe_code, reason = "cancels through the plugin's table")]

use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use platen_abi::payload;

use super::memory::SharedMemory;
use super::outbox::Outbox;
use super::pool::Pool;
use super::wire::{CallError, Job, LoadFault, PROTOCOL, Received, Socket, ToHost, ToWorker};
use super::{Confinement, confine};
use crate::plugin::local::{self, Canceller, Input, Instance, Library};

/// Time for a plugin to return and to close after the host has ended.
const LAST_GRACE: Duration = Duration::from_millis(500);

/// Process that the worker runs in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::plugin) enum Place {
    /// A process of its own: limits and confinement apply.
    Process,
    /// A thread of the host.
    Thread,
}

/// Serves the host at standard input (command `platen worker`).
///
/// # Errors
/// Standard input is not such a socket.
pub fn serve_stdin() -> io::Result<()> {
    let socket = io::stdin().as_fd().try_clone_to_owned()?;
    if rustix::net::sockopt::socket_type(&socket).ok() != Some(rustix::net::SocketType::SEQPACKET) {
        return Err(io::Error::other("platen starts its workers itself"));
    }
    serve(Socket::of(socket), Place::Process);
    Ok(())
}

pub(super) fn serve(socket: Socket, place: Place) {
    let socket = Arc::new(socket);
    let mut buffer = Vec::new();
    // The host sends no other request before the library is reported as loaded.
    let Received::Message(ToWorker::Load { protocol, library, limits, log_level, pool_bytes }, beside) =
        socket.receive(None, &mut buffer)
    else {
        return;
    };
    let outbox = Outbox::new(Arc::clone(&socket), log_level);
    if place == Place::Process {
        outbox.publish();
        confine::limit(&limits);
    }
    let loaded = if protocol == PROTOCOL {
        Library::load(&library)
    } else {
        let why =
            format!("the worker speaks protocol {PROTOCOL}, the host {protocol}: both must be of one build");
        Err(LoadFault::FailedToLoad(why))
    };
    let about = loaded.as_ref().map(|library| library.about().clone()).map_err(Clone::clone);
    if outbox.send(&ToHost::Loaded(about)).is_err() {
        return;
    }
    let Ok(library) = loaded else { return };
    let pool = beside.into_iter().next().map(|fd| SharedMemory::attach(fd, pool_bytes, true).map(Pool::new));
    let Some(Ok(pool)) = pool else { return };
    let Received::Message(ToWorker::Create { plugin, values, confine }, _) =
        socket.receive(None, &mut buffer)
    else {
        return end(&library, place);
    };
    let instance = Instance::create(&library, &plugin, &values);
    let confinement = if confine { confine::files() } else { Confinement::default() };
    match instance {
        Err(why) => drop(outbox.send(&ToHost::Created(Err(why)))),
        Ok(instance) => {
            Worker { socket, outbox, pool: Arc::new(pool), place }.work(instance, confinement, confine)
        }
    }
    end(&library, place);
}

fn end(library: &Library, place: Place) {
    if place == Place::Process {
        library.end();
    }
}

/// Request for the plugin's thread.
enum Request {
    Open,
    Estimate(Option<[f64; 4]>),
    Health,
    Discover,
    Run(Job, Vec<Input>, local::Listed),
}

struct Worker {
    socket: Arc<Socket>,
    outbox: Arc<Outbox>,
    pool: Arc<Pool>,
    place: Place,
}

impl Worker {
    /// Carries out requests until the host has ended.
    fn work(&self, mut instance: Instance, mut confinement: Confinement, confine: bool) {
        let canceller = Mutex::new(Some(instance.canceller()));
        let (requests, inbox) = channel();
        thread::scope(|scope| {
            let reader = thread::Builder::new().name("requests".into());
            let reader = reader.spawn_scoped(scope, || self.read(requests, &canceller));
            if reader.is_err() {
                return;
            }
            if confine {
                // All threads, and all threads that they start.
                confinement.seccomp = confine::system_calls();
            }
            if self.outbox.send(&ToHost::Created(Ok(confinement))).is_ok() {
                self.carry_out(&mut instance, &inbox);
            }
            *canceller.lock().unwrap_or_else(PoisonError::into_inner) = None;
            drop(instance);
        });
    }

    fn carry_out(&self, instance: &mut Instance, inbox: &Receiver<Request>) {
        for request in inbox {
            let answer = match request {
                Request::Open => ToHost::Opened(instance.open()),
                Request::Estimate(window) => {
                    ToHost::Estimated(instance.estimate_s(window.map(raw_window).as_ref()))
                }
                Request::Health => ToHost::Health(instance.health()),
                Request::Discover => ToHost::Discovered(instance.discover()),
                Request::Run(job, inputs, listed) => {
                    let result = instance.run(&job, &inputs);
                    drop(listed);
                    ToHost::Done { job: job.id, result }
                }
            };
            if self.outbox.send(&answer).is_err() {
                if self.place == Place::Process {
                    // The plugin closed the socket; the thread that reads from it would not notice.
                    confine::end_at_once();
                }
                return;
            }
        }
    }

    /// Reads requests and passes them on; cancels at once.
    fn read(&self, requests: Sender<Request>, canceller: &Mutex<Option<Canceller>>) {
        let mut buffer = Vec::new();
        let mut newest = 0;
        let cancel = |id: u64| {
            if let Some(job) = local::find(id) {
                job.cancel();
                if let Some(canceller) = *canceller.lock().unwrap_or_else(PoisonError::into_inner) {
                    // SAFETY: the instance lives as long as its canceller is there.
                    unsafe { canceller.cancel(id) };
                }
            }
        };
        while let Received::Message(message, beside) = self.socket.receive::<ToWorker>(None, &mut buffer) {
            let request = match message {
                ToWorker::Open => Request::Open,
                ToWorker::Estimate(window) => Request::Estimate(window),
                ToWorker::Health => Request::Health,
                ToWorker::Discover => Request::Discover,
                ToWorker::Run { job, inputs } => {
                    newest = job.id;
                    let listed = local::begin(
                        job.id,
                        job.deadline_ns,
                        Arc::clone(&self.pool),
                        Arc::clone(&self.outbox),
                    );
                    match attach(inputs, beside) {
                        Ok(inputs) => Request::Run(job, inputs, listed),
                        Err(why) => {
                            let result = Err(no_memory(&why));
                            let _ = self.outbox.send(&ToHost::Done { job: job.id, result });
                            continue;
                        }
                    }
                }
                ToWorker::Cancel(job) => {
                    cancel(job);
                    continue;
                }
                ToWorker::Load { .. } | ToWorker::Create { .. } => break,
            };
            if requests.send(request).is_err() {
                break;
            }
        }
        drop(requests);
        if self.place == Place::Process {
            thread::spawn(|| {
                thread::sleep(LAST_GRACE);
                confine::end_at_once();
            });
        }
        cancel(newest);
    }
}

fn attach(inputs: Vec<super::wire::Input>, beside: Vec<OwnedFd>) -> io::Result<Vec<Input>> {
    if inputs.len() != beside.len() {
        return Err(io::Error::other("an input came without its memory"));
    }
    let attach = |(input, fd): (super::wire::Input, OwnedFd)| {
        let memory = SharedMemory::attach(fd, input.bytes, false)?;
        Ok(Input { format: input.format, role: input.role, memory })
    };
    inputs.into_iter().zip(beside).map(attach).collect()
}

fn no_memory(why: &io::Error) -> CallError {
    let message = format!("its inputs cannot be mapped: {why}");
    CallError { status: platen_abi::status::MEMORY, retryable: true, message }
}

fn raw_window([azimuth_start, azimuth_width, elevation_min, elevation_max]: [f64; 4]) -> payload::Window {
    payload::Window {
        struct_size: size_of::<payload::Window>() as u32,
        reserved: 0,
        azimuth_start,
        azimuth_width,
        elevation_min,
        elevation_max,
    }
}
