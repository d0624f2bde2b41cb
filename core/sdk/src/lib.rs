//! SDK for plugins in Rust: safe traits over the C boundary of `platen-abi`.
//!
//! A plugin is a crate of type `cdylib` that implements one of four traits and exports the implementation with
//! [`export!`]:
//!
//! | kind | trait | input | output |
//! |---|---|---|---|
//! | scanner | [`Scanner`] | trigger, window | lattice, column by column |
//! | flattening | `Flattening` (feature `flattening`) | mid-surface mesh | (u, v) of each vertex |
//! | comparison | `Comparison` (feature `comparison`) | surfaces, task | figures, verdicts, sentences, fields |
//! | advisor | `Advisor` (feature `comparison`) | surfaces, history of the plate | advice for the next stroke |
//!
//! # Example
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
//! # Options
//!
//! [`options!`] declares each option once; validation, `platen plugins describe` and the typed value are derived from
//! the declaration. A field of type `Option<T>` is optional; any other field without a default is required. The host
//! checks the plant file before the plugin is created.
//!
//! # Errors, panics, log
//!
//! An [`Error`] consists of a kind, a sentence (place and failure) and a hint (remedy). Panics are caught in the
//! exported functions and become errors of kind [`ErrorKind::Internal`]; the crate must be built with
//! `panic = "unwind"`. Events of `tracing` are forwarded to the host's log with the id of the job.
//!
//! # Threads and time
//!
//! All methods of one plugin instance are called one at a time, from the same thread. A job has a deadline and can be
//! cancelled at any time: call [`Job::check`] at least every 50 ms of work, or register [`Job::on_cancel`] around a
//! blocking call.
#![allow(unsafe_code, reason = "this crate is the plugin's side of the boundary")]

mod device;
mod error;
pub mod exchange;
mod health;
mod info;
mod job;
mod logging;
mod option;
mod scanner;
#[doc(hidden)]
pub mod shim;

#[cfg(feature = "comparison")]
mod advisor;
#[cfg(feature = "comparison")]
mod comparison;
#[cfg(feature = "flattening")]
mod flattening;
#[cfg(feature = "comparison")]
mod grid;

#[cfg(feature = "comparison")]
pub use advisor::{Advisor, AdvisorInputs};
#[cfg(feature = "comparison")]
pub use comparison::{Comparison, Inputs};
pub use device::Device;
pub use error::{Error, ErrorKind, Result};
#[cfg(feature = "flattening")]
pub use flattening::Flattening;
#[cfg(feature = "comparison")]
pub use grid::PlateGrid;
pub use health::Health;
pub use info::Info;
pub use job::{CancelGuard, Job};
pub use option::{OptionType, Options, Values};
pub use platen_abi as abi;
#[cfg(feature = "comparison")]
pub use platen_model::{
    Advice, Field, Figure, Findings, NodeState, PlateHistory, Report, Task, TemplateFinding, Verdict,
};
pub use platen_scan::{Column, Face, Outcome, ScanEnd, ScanHeader, State, Window};
#[cfg(feature = "comparison")]
pub use platen_shape::Surface;
#[cfg(feature = "flattening")]
pub use platen_shape::flatten::{cotangents, fixed_boundary};
#[cfg(feature = "flattening")]
pub use platen_shape::{Chart, DiskMesh};
pub use scanner::{ScanReceiver, ScanSink, Scanner};
