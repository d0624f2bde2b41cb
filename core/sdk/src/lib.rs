//! For authors of plugins in Rust: a safe skin over the C boundary of `platen-abi`.
//!
//! A plugin is a crate of type `cdylib` that implements one of three traits and exports it with one line:
//!
//! | kind | trait | turns |
//! |---|---|---|
//! | scanner | [`Scanner`] | a trigger into a lattice, column by column |
//! | flattening | `Flattening` (feature `flattening`) | a mid-surface mesh into (u, v) |
//! | comparison | `Comparison` (feature `comparison`) | surfaces and a task into findings and fields |
//!
//! ```
//! use platen_sdk::{Info, Job, Result, ScanSink, Scanner, options};
//!
//! options! {
//!     /// Options of the example.
//!     pub struct Options {
//!         /// Address of the scanner.
//!         address: String;
//!         /// Returns farther than this are dropped.
//!         range_max: f64 = 30.0, unit "m", min 0.6, max 130.0;
//!         /// Which echo to keep.
//!         echo: String = "strongest", choices ["first", "strongest", "last"];
//!         /// Serial number to insist on.
//!         serial: Option<String>;
//!     }
//! }
//!
//! struct Example(Options);
//!
//! impl Scanner for Example {
//!     const INFO: Info = Info::new(c"example", c"Example", c"Scans nothing.", c"1.0.0");
//!     type Options = Options;
//!     fn new(options: Options) -> Result<Self> {
//!         Ok(Self(options))
//!     }
//!     fn capture(&mut self, job: &Job<'_>, out: &mut ScanSink<'_>) -> Result<()> {
//!         job.check()?; // cancelled, or past the deadline
//!         # let _ = out;
//!         Ok(())
//!     }
//! }
//!
//! platen_sdk::export!(scanner Example);
//! # fn main() {}
//! ```
//!
//! A field of type `Option<T>` need not be given; one without default must be. Panics are caught in the shim and
//! become errors. What a plugin logs with `tracing` arrives in the host's log with the job's id.
#![allow(unsafe_code, reason = "this crate is the plugin's side of the boundary")]

mod error;
mod info;
mod job;
mod logging;
mod option;
mod scanner;
#[doc(hidden)]
pub mod shim;
mod sink;

#[cfg(feature = "comparison")]
mod comparison;
#[cfg(feature = "flattening")]
mod flattening;
#[cfg(feature = "comparison")]
mod grid;

#[cfg(feature = "comparison")]
pub use comparison::{Comparison, Inputs};
pub use error::{Error, ErrorKind, Result};
#[cfg(feature = "flattening")]
pub use flattening::Flattening;
#[cfg(feature = "comparison")]
pub use grid::PlateGrid;
pub use info::Info;
pub use job::{CancelGuard, Job};
pub use option::{OptionType, Options, Values};
pub use platen_abi as abi;
#[cfg(feature = "comparison")]
pub use platen_model::{Field, NodeState, Report};
pub use scanner::{ScanSink, Scanner};
