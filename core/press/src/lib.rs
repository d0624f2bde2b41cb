//! Register map, Modbus link and handshake with the press.

mod alarm;
mod codec;
mod handshake;
mod journal;
mod link;
mod page;
mod probe;
mod program;
mod reconcile;
mod replay;
mod runner;
mod stroke;

pub use alarm::{Alarm, Code, Language, Severity, alarms_csv};
pub use codec::{HostImage, PressImage, Torn, Wrong, describe_inputs, describe_outputs, saturates};
pub use handshake::{Config, Effect, Event, Handshake, LinkState, State, Transition, Work};
pub use journal::{Acked, Entry, Journal, MemoryJournal, Recalled, Record, Stage};
pub use link::{
    Client, Consequence, Counts, Link, LinkError, ModbusLink, PressLink, ROUND_TRIP_LIMITS_MS, Request,
    Response, ServedLink, TransportError, consequence,
};
pub use page::{MapPage, MapRow, map_csv, map_markdown, map_page};
pub use probe::{Reading, readings};
pub use program::reference_program;
pub use replay::{Replayed, Sample, Side, replay};
pub use runner::{
    Answer, Durations, HostSide, Metrics, Order, PressSide, RunError, Status, channels, run_press,
};
pub use stroke::{Figures, Measurement, Publication, StrokeData, StrokeKey, Timestamp, Verdict};
