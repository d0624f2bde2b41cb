//! Words to and from the press.
//!
//! [`Link`] moves one request and one answer; [`Client`] is the only one who uses it. It puts a time limit on every
//! request, checks quantity and echo itself, refuses writes outside the allow-list, and drops the connection at any
//! error or timeout: after a late answer a Modbus connection is off by one for ever (TCP), or silently wrong (RTU).

mod any;
mod client;
mod error;
mod modbus;
mod rtu;
mod served;
mod tcp;

pub use any::PressLink;
pub use client::{Client, Counts, ROUND_TRIP_LIMITS_MS};
pub use error::{Consequence, LinkError, consequence};
pub use modbus::ModbusLink;
pub use served::ServedLink;

use std::fmt;

use platen_plant::press::RegisterTable;
use rtu::DRAIN_MAX;

/// One Modbus request. Nothing else is ever sent: functions 3, 4 and 16, and 43 by people's tools.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Request {
    /// Read consecutive registers.
    Read {
        /// Kind of the registers.
        table: RegisterTable,
        /// Address of the first.
        start: u16,
        /// How many.
        count: u16,
    },
    /// Write consecutive holding registers.
    Write {
        /// Address of the first.
        start: u16,
        /// What to write.
        words: Vec<u16>,
    },
    /// Ask the device who made it (function 43, type 14).
    Identify,
}

impl fmt::Display for Request {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (verb, table, start, count) = match self {
            Self::Identify => return f.write_str("asking who it is"),
            Self::Read { table, start, count } => ("reading", *table, *start, usize::from(*count)),
            Self::Write { start, words } => ("writing", RegisterTable::Holding, *start, words.len()),
        };
        let last = usize::from(start) + count.max(1) - 1;
        write!(f, "{verb} {} registers {start}..={last}", table.name())
    }
}

/// What came back, unchecked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Response {
    /// Registers.
    Words(Vec<u16>),
    /// A write was done, as the peer understood it.
    Written {
        /// Address of the first.
        start: u16,
        /// How many.
        count: u16,
    },
    /// Who made it, product and revision, as far as they are text.
    Identity(Vec<String>),
    /// The peer refused, with a Modbus exception code.
    Exception(u8),
}

/// Why no answer came, as the transport tells it.
#[derive(Debug, thiserror::Error)]
pub enum TransportError {
    /// There is no connection.
    #[error("not connected")]
    NotConnected,
    /// The connection failed.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// The peer does not speak the protocol.
    #[error("{0}")]
    Protocol(String),
    /// The task that owns the connection ended.
    #[error("the connection was given up in the middle of a request")]
    Abandoned,
}

/// Moves one request at a time to the press and brings its answer.
///
/// It has no time limits and checks nothing: [`Client`] does.
pub trait Link: Send {
    /// Where it leads, for messages.
    fn peer(&self) -> String;

    /// Builds a connection. Late answers to requests of an older one must not reach the new one.
    fn connect(&mut self) -> impl Future<Output = Result<(), TransportError>> + Send;

    /// Sends a request and waits for its answer, for ever if need be.
    fn call(&mut self, request: &Request) -> impl Future<Output = Result<Response, TransportError>> + Send;

    /// Drops the connection at once, whatever state it is in.
    fn disconnect(&mut self);
}
