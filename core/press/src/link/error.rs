//! Errors between host and press, and the consequence of each Modbus exception.

use std::time::Duration;

use platen_plant::press::Refused;

use super::{Request, TransportError};
use crate::Code;

/// Reason why a request to the press failed.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the message of a variant names its fields")]
pub enum LinkError {
    /// Connecting failed.
    #[error("press {peer}: no connection: {source}; check that it is on, and host and port in [press.link]")]
    Connect { peer: String, source: TransportError },
    /// Connecting took too long.
    #[error("press {peer}: no connection in {} ms; check that it is on, and host and port in [press.link]", limit.as_millis())]
    ConnectTimeout { peer: String, limit: Duration },
    /// No answer in time. The connection is dropped; a write may have been executed.
    #[error("press {peer}: no answer to {request} in {} ms; check the cable or response_timeout_ms", limit.as_millis())]
    Timeout { peer: String, request: Request, limit: Duration },
    /// The connection failed and is dropped; a write may have been executed.
    #[error("press {peer}: {request} failed: {source}; connecting again")]
    Broken { peer: String, request: Request, source: TransportError },
    /// The answer does not fit the request. The connection is dropped.
    #[error("press {peer}: wrong answer to {request}: {answer}; connecting again")]
    Mismatch { peer: String, request: Request, answer: String },
    /// The press answered with an exception. The connection persists.
    #[error("press {peer}: {request} refused with exception {code:02X} ({}); {}", exception_name(*code), exception_remedy(*code))]
    Exception { peer: String, request: Request, code: u8 },
    /// The allow-list or the mode forbids the write. Nothing was sent.
    #[error("press {peer}: writing holding registers {}..={} refused: not in [press.write] allow; nothing was sent",
        refused.start, u32::from(refused.start) + u32::from(refused.count.max(1)) - 1)]
    Refused { peer: String, refused: Refused },
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

/// Consequence of an exception.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Consequence {
    /// Repeat after a pause; a fault after a number of exceptions in a row.
    Retry {
        /// Exceptions in a row before the fault.
        limit: u32,
        /// Pause before the next request.
        pause: Duration,
        /// The fault.
        fault: Code,
    },
    /// A fault at once.
    Fault(Code),
    /// The gateway answers, the press behind it does not: off line, with the connection to the gateway kept.
    UnitLost,
}

/// Returns the consequence of a Modbus exception (MODBUS Application Protocol V1.1b3, section 7).
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
