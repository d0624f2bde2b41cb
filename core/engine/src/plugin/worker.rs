//! Worker processes of plugins: `platen worker`, a hidden command of the same program, one process for each configured
//! plugin.
//!
//! ```text
//! host                                     worker
//! Link  -- control: a socket (wire) ----->  serve: one thread for the plugin's calls, one for cancellation
//!       <- frames: places in the pool ----  local: the library, behind its tables
//! ```
//! | module | contents |
//! |---|---|
//! | `wire` | messages, one datagram each |
//! | `memory`, `pool` | shared memory: inputs, read-only in the worker; a pool for the frames of the plugin |
//! | `process` | the child process: start, log, end |
//! | `link` | the host's end: requests, jobs, escalation after the deadline |
//! | `serve`, `outbox` | the worker's end |
//! | `confine` | limits, landlock, seccomp |
//!
//! With `isolation = "in-process"` the same worker runs in a thread of the host, for a debugger. Protocol and code path
//! are the same.

mod confine;
mod link;
mod memory;
mod outbox;
mod pool;
mod process;
mod serve;
mod wire;

use serde::{Deserialize, Serialize};

pub(super) use link::{JobEvent, Link, LinkError, Place, new_job};
pub(super) use memory::SharedMemory;
pub(super) use outbox::{Outbox, outbox};
pub(super) use pool::{Extent, Pool};
pub(super) use process::printable;
pub use serve::serve_stdin;
pub(super) use wire::{CallError, Device, Health, Job, LoadFault, LoadedLibrary, ToHost};

/// Resource limits of a worker.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Limits {
    /// Private memory, bytes (`RLIMIT_DATA`).
    pub memory: u64,
    /// Open files.
    pub files: u64,
    /// Pool for frames in transit to the host, bytes.
    pub pool: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { memory: 2 << 30, files: 256, pool: 64 << 20 }
    }
}

/// Sandbox of a worker, in force once its plugin is created.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Confinement {
    /// No file can be opened (landlock).
    pub landlock: bool,
    /// No socket, program or other process can be reached (seccomp).
    pub seccomp: bool,
}
