//! Messages between host and worker: one datagram each (`SOCK_SEQPACKET`), in postcard's encoding.
//!
//! No pointers and no large data are sent. Frames lie in shared memory, and a message contains their offset. Shared
//! memory itself is passed as descriptors beside a message (`SCM_RIGHTS`).

use std::io::{self, IoSlice, IoSliceMut};
use std::mem::MaybeUninit;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::PathBuf;
use std::time::{Duration, Instant};

use platen_plant::OptionValue;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::net::{
    AddressFamily, RecvAncillaryBuffer, RecvAncillaryMessage, RecvFlags, SendAncillaryBuffer,
    SendAncillaryMessage, SendFlags, SocketFlags, SocketType, recvmsg, sendmsg, socketpair,
};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::{Confinement, Limits};
use crate::plugin::Descriptor;

/// Protocol version; it changes with every change of a message. Host and worker are of one build.
pub(super) const PROTOCOL: u32 = 1;

/// Largest message; the system's default for a socket's buffer is 208 KiB.
const MESSAGE_BYTES: usize = 192 << 10;
/// Largest number of descriptors passed with a message.
const DESCRIPTORS: usize = 8;

/// Host to worker.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum ToWorker {
    /// First message. The pool is passed with it.
    Load {
        protocol: u32,
        library: PathBuf,
        limits: Limits,
        log_level: i32,
        pool_bytes: u64,
    },
    Create {
        plugin: String,
        values: Vec<OptionValue>,
        confine: bool,
    },
    Open,
    /// Start and width of the azimuth, smallest and largest elevation, radians.
    Estimate(Option<[f64; 4]>),
    Health,
    Discover,
    /// The inputs are passed with it, in order.
    Run {
        job: Job,
        inputs: Vec<Input>,
    },
    Cancel(u64),
}

/// A job; times are of `CLOCK_MONOTONIC` unless named utc.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(in crate::plugin) struct Job {
    pub(in crate::plugin) id: u64,
    pub(in crate::plugin) stroke: u64,
    pub(in crate::plugin) trigger_ns: i64,
    pub(in crate::plugin) trigger_utc_ns: i64,
    pub(in crate::plugin) deadline_ns: i64,
}

#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Input {
    pub(super) format: String,
    pub(super) role: Option<String>,
    pub(super) bytes: u64,
}

/// Worker to host.
#[derive(Debug, Serialize, Deserialize)]
pub(in crate::plugin) enum ToHost {
    Loaded(Result<LoadedLibrary, LoadFault>),
    Created(Result<Confinement, CallError>),
    Opened(Result<(), CallError>),
    Estimated(Option<f64>),
    Health(Option<Health>),
    Discovered(Result<Vec<Device>, CallError>),
    /// Offset in the pool.
    Frame {
        job: u64,
        format: String,
        offset: u64,
        bytes: u64,
    },
    Done {
        job: u64,
        result: Result<(), CallError>,
    },
    Log {
        job: u64,
        level: i32,
        text: String,
    },
    Progress {
        job: u64,
        fraction: f64,
        phase: String,
    },
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub(in crate::plugin) struct LoadedLibrary {
    pub(in crate::plugin) abi_minor: u32,
    /// SHA-256 of the file, hexadecimal.
    pub(in crate::plugin) sha256: String,
    pub(in crate::plugin) plugins: Vec<Descriptor>,
}

/// Reason why a library cannot be used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(in crate::plugin) enum LoadFault {
    NotAPlugin(String),
    WrongAbi(String),
    FailedToLoad(String),
}

/// Failure that a plugin reported.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(in crate::plugin) struct CallError {
    pub(in crate::plugin) status: i32,
    pub(in crate::plugin) retryable: bool,
    pub(in crate::plugin) message: String,
}

/// State of an instrument, as at the plugin boundary; NaN where it is unknown.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(in crate::plugin) struct Health {
    pub(in crate::plugin) flags: u32,
    pub(in crate::plugin) temperature_c: f64,
    pub(in crate::plugin) battery: f64,
    pub(in crate::plugin) tilt: f64,
}

/// A device in reach of a driver.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(in crate::plugin) struct Device {
    pub(in crate::plugin) option: String,
    pub(in crate::plugin) value: String,
    pub(in crate::plugin) about: String,
}

/// One end of the connection. Any thread may send; one thread receives.
#[derive(Debug)]
pub(super) struct Socket(OwnedFd);

/// Outcome of waiting for a message.
#[derive(Debug)]
pub(super) enum Received<T> {
    Message(T, Vec<OwnedFd>),
    /// No message arrived in time.
    Late,
    /// The other side has ended, or has sent an invalid message.
    Ended,
}

impl Socket {
    pub(super) fn pair() -> io::Result<(Self, Self)> {
        let (a, b) = socketpair(AddressFamily::UNIX, SocketType::SEQPACKET, SocketFlags::CLOEXEC, None)?;
        Ok((Self(a), Self(b)))
    }

    pub(super) fn of(fd: OwnedFd) -> Self {
        Self(fd)
    }

    pub(super) fn into_fd(self) -> OwnedFd {
        self.0
    }

    /// Sends a message; waits while the other side does not read.
    pub(super) fn send(&self, message: &impl Serialize, beside: &[BorrowedFd<'_>]) -> io::Result<()> {
        let bytes = postcard::to_stdvec(message).map_err(io::Error::other)?;
        let mut space = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(DESCRIPTORS))];
        let mut control = SendAncillaryBuffer::new(&mut space);
        if !beside.is_empty() && !control.push(SendAncillaryMessage::ScmRights(beside)) {
            return Err(io::Error::other("too many inputs for one job"));
        }
        loop {
            match sendmsg(&self.0, &[IoSlice::new(&bytes)], &mut control, SendFlags::NOSIGNAL) {
                Err(rustix::io::Errno::INTR) => {}
                sent => return sent.map(drop).map_err(Into::into),
            }
        }
    }

    /// Waits for a message until `until`, or without limit if it is `None`. `buffer` is reused from call to call.
    pub(super) fn receive<T: DeserializeOwned>(
        &self,
        until: Option<Instant>,
        buffer: &mut Vec<u8>,
    ) -> Received<T> {
        buffer.resize(MESSAGE_BYTES, 0);
        match self.wait(until) {
            Ok(true) => {}
            Ok(false) => return Received::Late,
            Err(_) => return Received::Ended,
        }
        let mut space = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(DESCRIPTORS))];
        let mut control = RecvAncillaryBuffer::new(&mut space);
        let received = loop {
            let into = &mut [IoSliceMut::new(buffer)];
            match recvmsg(&self.0, into, &mut control, RecvFlags::CMSG_CLOEXEC) {
                Err(rustix::io::Errno::INTR) => {}
                other => break other,
            }
        };
        let Ok(received) = received else { return Received::Ended };
        let mut beside = Vec::new();
        for message in control.drain() {
            if let RecvAncillaryMessage::ScmRights(fds) = message {
                beside.extend(fds);
            }
        }
        match postcard::from_bytes(&buffer[..received.bytes]) {
            Ok(message) if received.bytes > 0 => Received::Message(message, beside),
            _ => Received::Ended,
        }
    }

    /// Returns whether data or the end of the connection can be read.
    fn wait(&self, until: Option<Instant>) -> io::Result<bool> {
        loop {
            let left = until.map(|until| until.saturating_duration_since(Instant::now()));
            let timeout = left.map(timespec);
            let mut fds = [PollFd::new(&self.0, PollFlags::IN)];
            match poll(&mut fds, timeout.as_ref()) {
                Err(rustix::io::Errno::INTR) => {}
                ready => return Ok(ready? > 0),
            }
        }
    }
}

impl AsFd for Socket {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}

pub(in crate::plugin) fn timespec(time: Duration) -> Timespec {
    Timespec {
        tv_sec: i64::try_from(time.as_secs()).unwrap_or(i64::MAX),
        tv_nsec: i64::from(time.subsec_nanos()),
    }
}
