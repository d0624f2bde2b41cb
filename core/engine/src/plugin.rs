//! Plugin host: plugins are found by name, run in a process of their own, and started again after a fault.
//!
//! | module | contents |
//! |---|---|
//! | `catalogue` | the plugin folders, and the libraries in them |
//! | `library`, `descriptor` | a plugin of a library, and its description |
//! | `scanner`, `flattening`, `comparison`, `advisor` | the four kinds behind safe types |
//! | `instance`, `job` | one configured plugin, and the specification of a job |
//! | `faults`, `quarantine` | pause before the restart of a plugin, and its exclusion after too many faults |
//! | `worker` | the plugin's process: messages, shared memory, limits; both ends |
//! | `local` | the plugin's library inside the worker: the calls through the tables of `platen.h` |
//! | `error` | reasons why a plugin cannot be used or has failed |
//!
//! All `unsafe` of the host is in this module; nearly all of it runs in workers.

mod advisor;
mod catalogue;
mod clock;
mod comparison;
mod descriptor;
mod error;
mod faults;
mod flattening;
mod instance;
mod job;
mod library;
mod local;
mod quarantine;
mod scanner;
mod worker;

pub use advisor::Advisor;
pub use catalogue::{Catalogue, Listed};
pub use comparison::{Comparison, Surfaces};
pub use descriptor::{Descriptor, Kind};
pub use error::PluginError;
pub use flattening::Flattening;
use instance::InputFrame;
pub use instance::{Emitted, Instance, RunningJob, WorkerState};
pub use job::{CancelToken, JobSpec, ProgressSink};
pub use library::{Isolation, Library, LoadFacts, Settings};
pub use local::exported_symbols;
pub use platen_sdk::{Device, Health};
pub use quarantine::{Quarantine, Quarantined};
pub use scanner::{RunningScan, Scanner};
pub use worker::{Confinement, Limits, serve_stdin};
