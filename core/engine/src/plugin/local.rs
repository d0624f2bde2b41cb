//! Plugin library inside the worker's own process: the library, the calls through its tables, and the host's table for
//! it.

mod descriptor;
mod host_table;
mod instance;
mod job;
mod library;
mod values;

pub(super) use instance::{Canceller, Input, Instance};
pub(super) use job::{Listed, begin, find};
pub(super) use library::Library;
pub use library::exported_symbols;
