//! Record of strokes and plates, and the press side's journal, in one SQLite database per host.
//!
//! [`History`] is the only writer. It holds an exclusive lock file for its lifetime, and each method that records a
//! step of a stroke returns only when the step would survive a power cut: SQLite's write-ahead log with
//! `synchronous = FULL`. [`Archive`] reads, from any process and at any time, also while the host runs;
//! `platen history` uses it.
//!
//! A stroke passes four stages, [`Stage`](platen_model::Stage); the time of each is recorded. [`History::record`] takes
//! the steps in order and refuses a step that does not follow from the recorded ones. A repeated step changes nothing,
//! so that the caller may repeat it after a crash. [`History::recall`] returns the state to continue from.
//!
//! Data of the press and results are stored as JSON, beside the few columns that queries need. [`Table`] exports
//! strokes as CSV and Parquet. This crate does not depend on Modbus, plugins or geometry, and reads no clock: callers
//! pass the time.

mod archive;
mod backup;
mod change;
mod compare;
mod error;
mod event;
mod export;
mod history;
mod journal;
mod list;
mod lock;
mod schema;
mod stroke;
mod table;

pub use archive::{Archive, Filter};
pub use backup::adopt;
pub use change::{Change, ChangeKind, Owner};
pub use compare::{Difference, compare};
pub use error::Error;
pub use event::Event;
pub use history::{Accepted, Finished, History};
pub use list::run_ids;
pub use stroke::{PlateRecord, Stroke};
pub use table::{Columns, Table};

use platen_model::{StrokeKey, Verdict};
