//! Register map, Modbus link and handshake with the controller of a press.
//!
//! [`run_press`] is the entry: one task polls the press over a [`Link`], decodes its registers ([`PressImage`]), steps
//! the pure state machine [`Handshake`], passes its [`Command`]s to the host and writes the wanted registers
//! ([`HostImage`]) until they are echoed. Invariants, table of transitions, timing parameters and register map are in
//! the README of this crate.

mod advice_block;
mod codec;
mod handshake;
mod journal;
mod link;
mod probe;
mod program;
mod reconcile;
mod register_page;
mod replay;
mod runner;

pub use codec::{
    ADVICE_REGISTERS, AdviceImage, HostImage, PressImage, Torn, Wrong, describe_inputs, describe_outputs,
    saturates,
};
pub use handshake::{Command, Config, Effect, Event, Handshake, LinkState, State, Transition, Work};
pub use journal::{Journal, MemoryJournal};
pub use link::{
    Client, Consequence, Counts, Link, LinkError, ModbusLink, PressLink, ROUND_TRIP_LIMITS_MS, Request,
    Response, ServerLink, TransportError, consequence,
};
pub use probe::{Reading, readings};
pub use program::reference_program;
pub use register_page::{MapPage, MapRow, alarms_csv, map_csv, map_markdown, map_page};
pub use replay::{Replayed, Sample, Side, replay};
pub use runner::{
    Answer, Durations, HostSide, Metrics, Order, PressSide, RunError, Status, channels, run_press,
};

use platen_model::{
    Acknowledgement, Code, Entry, Figures, Measurement, Publication, Recalled, Record, Severity, Stage,
    StrokeData, StrokeKey, Timestamp, Verdict,
};
