//! Strokes, plates and journal in SQLite.
//!
//! [`History`] is the one writer: it holds the lock of its database for as long as it lives, and every method that
//! records a step of a stroke returns only when the step would survive a power cut (write-ahead log, full
//! synchronisation). [`Archive`] reads, in any process and at any time: it is what `platen history` uses, also while the
//! host runs.
//!
//! A stroke goes through four stages, [`Stage`]; the time of each is kept. What a press or an algorithm says about a
//! stroke is kept as JSON that this crate does not interpret, beside the few columns that its own questions need.
//!
//! This crate knows nothing of Modbus, plugins or geometry, and reads no clock: its caller says what time it is.

mod archive;
mod compare;
mod error;
mod export;
mod history;
mod journal;
mod lock;
mod schema;
mod stroke;

pub use archive::{Archive, Filter};
pub use compare::{Difference, compare};
pub use error::Error;
pub use export::StrokeTable;
pub use history::{Accepted, Finished, History};
pub use stroke::{Event, PlateRecord, Stroke};

use platen_model::{StrokeKey, Verdict};
