//! Plugins: found by name, checked before anything of theirs runs, loaded once, never unloaded.
//!
//! All `unsafe` of the host is in this module. The rest sees [`Scanner`], [`Flattening`] and [`Comparison`], which
//! could as well be served from another process.

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
pub use scanner::{ScanEvent, Scanner};
