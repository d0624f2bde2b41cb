//! What can go wrong between host and press, and what follows from it.

use std::time::Duration;

use platen_plant::press::Refused;

use super::{Request, TransportError};
use crate::Code;

/// Why a request to the press failed.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// No connection could be built.
    #[error("press {peer}: no connection: {source}; check that it is on, and host and port in [press.link]")]
    Connect {
        /// Where.
        peer: String,
        /// Why.
        source: TransportError,
    },
    /// No connection could be built in time.
    #[error("press {peer}: no connection in {} ms; check that it is on, and host and port in [press.link]", limit.as_millis())]
    ConnectTimeout {
        /// Where.
        peer: String,
        /// The limit.
        limit: Duration,
    },
    /// No answer came in time. The connection is dropped; a write may have been done.
    #[error("press {peer}: no answer to {request} in {} ms; check the cable or response_timeout_ms", limit.as_millis())]
    Timeout {
        /// Where.
        peer: String,
        /// What was asked.
        request: Request,
        /// The limit.
        limit: Duration,
    },
    /// The connection failed. It is dropped; a write may have been done.
    #[error("press {peer}: {request} failed: {source}; connecting again")]
    Broken {
        /// Where.
        peer: String,
        /// What was asked.
        request: Request,
        /// Why.
        source: TransportError,
    },
    /// The answer is not one to this request. The connection is dropped.
    #[error("press {peer}: wrong answer to {request}: {answer}; connecting again")]
    Mismatch {
        /// Where.
        peer: String,
        /// What was asked.
        request: Request,
        /// What came.
        answer: String,
    },
    /// The press refused. The connection stays.
    #[error("press {peer}: {request} refused with exception {code:02X} ({}); {}", exception_name(*code), exception_remedy(*code))]
    Exception {
        /// Where.
        peer: String,
        /// What was asked.
        request: Request,
        /// Modbus exception code.
        code: u8,
    },
    /// The allow-list or the mode forbids the write. Nothing was sent.
    #[error("press {peer}: writing holding registers {}..={} refused: not in [press.write] allow; nothing was sent",
        refused.start, u32::from(refused.start) + u32::from(refused.count.max(1)) - 1)]
    Refused {
        /// Where.
        peer: String,
        /// What was to be written.
        refused: Refused,
    },
}

fn exception_name(code: u8) -> &'static str {
    match code {
        0x01 => "illegal function",
        0x02 => "illegal address",
        0x03 => "illegal value",
        0x04 => "device failure",
        0x05 => "acknowledge",
        0x06 => "busy",
        0x08 => "memory parity",
        0x0A => "gateway path",
        0x0B => "gateway target",
        _ => "unknown",
    }
}

fn exception_remedy(code: u8) -> &'static str {
    match code {
        0x01 => "allow functions 3 and 16 on the controller",
        0x02 | 0x03 => "compare [press.map] with the controller's register table",
        0x0A | 0x0B => "check the line behind the gateway and the unit id",
        _ => "look at the controller's diagnostics",
    }
}

/// What follows from an exception.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Consequence {
    /// Ask again after a pause; after so many in a row it is a fault.
    Retry {
        /// Refusals in a row that are borne.
        limit: u32,
        /// Wait before the next request.
        pause: Duration,
        /// The fault it becomes.
        fault: Code,
    },
    /// A fault at once.
    Fault(Code),
    /// The gateway answers, the press behind it does not: off line, without dropping the gateway's connection.
    UnitLost,
}

/// What follows from a Modbus exception (Modbus Application Protocol V1.1b3, section 7).
pub fn consequence(exception: u8) -> Consequence {
    match exception {
        0x01 => Consequence::Fault(Code::IllegalFunction),
        0x02 | 0x03 => Consequence::Fault(Code::IllegalAddress),
        0x05 | 0x06 => {
            Consequence::Retry { limit: 50, pause: Duration::from_millis(100), fault: Code::DeviceBusy }
        }
        0x0A | 0x0B => Consequence::UnitLost,
        _ => Consequence::Retry { limit: 3, pause: Duration::ZERO, fault: Code::DeviceFailure },
    }
}
