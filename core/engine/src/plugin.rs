//! Plugin libraries: found by name, checked as data before any of their code runs, loaded once, never unloaded.
//!
//! | module | contents |
//! |---|---|
//! | `catalogue` | the plugin folders, and the libraries in them |
//! | `library`, `descriptor` | a loaded library, and a copy of its static description |
//! | `instance`, `job`, `host_table`, `values` | one configured plugin on a thread of its own; calls through the tables of `platen.h` |
//! | `scanner`, `flattening`, `comparison` | the three kinds behind safe types |
//! | `error` | reasons why a plugin cannot be used or has failed |
//!
//! All `unsafe` of the host is in this module.

mod catalogue;
mod comparison;
mod descriptor;
mod error;
mod flattening;
mod host_table;
mod instance;
mod job;
mod library;
mod scanner;
mod values;

pub use catalogue::{Catalogue, Listed};
pub use comparison::{Comparison, Surfaces};
pub use descriptor::{Descriptor, Kind};
pub use error::PluginError;
pub use flattening::Flattening;
pub use instance::{Emitted, Instance, RunningJob};
pub use job::{CancelToken, JobSpec};
pub use library::Library;
pub use scanner::{RunningScan, Scanner};
