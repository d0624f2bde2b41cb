//! Modbus link to the press (MODBUS Application Protocol Specification V1.1b3; MODBUS over Serial Line V1.02).
//!
//! | module | contents |
//! |---|---|
//! | `client` | the only user of a [`Link`]: time limits, check of quantity and echo, allow-list, counters |
//! | `press_link` | the link as described in the plant file |
//! | `modbus` | host as Modbus client over TCP, RTU or RTU over TCP (tokio-modbus) |
//! | `server` | host as Modbus TCP server |
//! | `tcp`, `rtu` | sockets and serial ports with the options that a press needs |
//! | `error` | errors, and the consequence of each exception code |
//!
//! [`Link`] transfers one request and one answer. The client drops the connection at any error or timeout: after a late
//! answer a Modbus TCP connection would assign every answer to the wrong request, and an RTU line would do so
//! undetected.

mod client;
mod error;
mod modbus;
mod press_link;
mod rtu;
mod server;
mod tcp;

pub use client::{Client, Counts, ROUND_TRIP_LIMITS_MS};
pub use error::{Consequence, LinkError, consequence};
pub use modbus::ModbusLink;
pub use press_link::PressLink;
pub use server::ServerLink;

use std::fmt;

use platen_plant::press::RegisterTable;
use rtu::DRAIN_MAX;

/// A Modbus request: functions 3, 4 and 16, and function 43 for the tools. No other function is sent.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Request {
    /// Read consecutive registers.
    #[allow(missing_docs, reason = "the protocol's own names")]
    Read { table: RegisterTable, start: u16, count: u16 },
    /// Write consecutive holding registers.
    #[allow(missing_docs, reason = "the protocol's own names")]
    Write { start: u16, words: Vec<u16> },
    /// Read device identification (function 43, MEI type 14).
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

/// A Modbus answer, unchecked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Response {
    /// Registers.
    Words(Vec<u16>),
    /// Echo of a write.
    #[allow(missing_docs, reason = "the protocol's own names")]
    Written { start: u16, count: u16 },
    /// Vendor, product and revision, as far as they are text.
    Identity(Vec<String>),
    /// Exception code.
    Exception(u8),
}

/// Error of the transport.
#[derive(Debug, thiserror::Error)]
pub enum TransportError {
    /// Not connected.
    #[error("not connected")]
    NotConnected,
    /// The connection failed.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// The peer violates the protocol.
    #[error("{0}")]
    Protocol(String),
    /// The task that owns the connection has ended.
    #[error("the connection was given up in the middle of a request")]
    Abandoned,
}

/// Transport of one request at a time, without time limits or checks, which [`Client`] adds.
pub trait Link: Send {
    /// Returns the address of the peer, for messages.
    fn peer(&self) -> String;

    /// Connects. A late answer to a request of an earlier connection must not reach the new one.
    fn connect(&mut self) -> impl Future<Output = Result<(), TransportError>> + Send;

    /// Sends a request and waits for its answer, without a time limit.
    fn call(&mut self, request: &Request) -> impl Future<Output = Result<Response, TransportError>> + Send;

    /// Drops the connection at once, in any state.
    fn disconnect(&mut self);
}
