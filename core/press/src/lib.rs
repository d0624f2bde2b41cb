//! Register map, Modbus link and handshake with the press.

mod alarm;
mod journal;
mod stroke;

pub use alarm::{Alarm, Code, Language, Severity, alarms_csv};
pub use journal::{Acked, Entry, Journal, Recalled, Record, Stage};
pub use stroke::{Figures, Measurement, Publication, StrokeData, StrokeKey, Timestamp, Verdict};
