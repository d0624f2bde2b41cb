//! Errors between driver and bridge, by the person who must act.

use platen_sdk::ErrorKind;

/// Result of an exchange with a bridge.
pub(crate) type Result<T> = std::result::Result<T, Error>;

/// Error of a scan.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of a variant names its fields")]
pub(crate) enum Error {
    /// Broken connection; reconnecting may help.
    #[error("the connection broke: {0}")]
    Broken(String),
    /// Request refused for now; retrying later may help.
    #[error("the bridge is busy: {text}")]
    Busy {
        text: String,
        /// Time until the next attempt, milliseconds.
        retry_ms: u64,
    },
    /// Another major version of the protocol.
    #[error("the bridge uses version {}.{} of the protocol, this driver 1.0; update the older of the two", .bridge.0, .bridge.1)]
    Version { bridge: (u8, u8) },
    /// Another scanner than that of this press.
    #[error("scanner {found} answers, {expected} is expected; check the address, or the option serial")]
    WrongScanner {
        found: String,
        /// Serial number in the plant file, option `serial`.
        expected: String,
    },
    /// Request refused by bridge or scanner.
    #[error("the bridge refuses ({code}): {text}")]
    Refused { code: String, text: String },
    /// Scan ended by the bridge before it was complete.
    #[error("the scan ended as {outcome}: {reason}")]
    Ended { outcome: String, reason: String },
    /// Violation of the protocol by the bridge; retrying does not help.
    #[error("the bridge violates the protocol: {0}; report this to the supplier of the bridge")]
    Bridge(String),
    /// Deadline passed.
    #[error("no scan in time: {0}")]
    TooLate(String),
    /// Error returned by the host.
    #[error("{0}")]
    Host(#[from] platen_sdk::Error),
}

impl Error {
    /// Converts the error to that of the plugin interface, with the bridge's address.
    pub(crate) fn at(self, address: &str) -> platen_sdk::Error {
        let kind = match &self {
            Self::Host(error) => return error.clone(),
            Self::Broken(_) => ErrorKind::Disconnected,
            Self::Busy { .. } => ErrorKind::Busy,
            Self::Version { .. } | Self::WrongScanner { .. } => ErrorKind::Config,
            Self::Refused { .. } => ErrorKind::Denied,
            Self::Ended { .. } => ErrorKind::NoData,
            Self::Bridge(_) => ErrorKind::BadData,
            Self::TooLate(_) => ErrorKind::Timeout,
        };
        let error = platen_sdk::Error::new(kind, format!("scan bridge {address}: {self}"));
        match kind {
            ErrorKind::Disconnected | ErrorKind::Busy | ErrorKind::Timeout => error.retryable(),
            _ => error,
        }
    }
}
