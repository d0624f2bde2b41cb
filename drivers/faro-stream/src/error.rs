//! What can go wrong between driver and bridge, by who must act.

use platen_sdk::ErrorKind;

/// Result of talking to a bridge.
pub(crate) type Result<T> = std::result::Result<T, Error>;

/// Why a scan did not come.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(crate) enum Error {
    /// The connection is of no use any more; another may be.
    #[error("the connection broke: {0}")]
    Broken(String),
    /// The bridge will take the request later.
    #[error("the bridge is busy: {text}")]
    Busy {
        /// Its words.
        text: String,
        /// When to ask again, milliseconds.
        retry_ms: u64,
    },
    /// Another generation of the protocol.
    #[error("the bridge speaks version {}.{} of the protocol, this driver 1.0; update the older of the two", .bridge.0, .bridge.1)]
    Version {
        /// Its version.
        bridge: (u8, u8),
    },
    /// Not the scanner of this press.
    #[error("scanner {found} answers, {expected} is expected; check the address, or the option serial")]
    WrongScanner {
        /// Serial number that answers.
        found: String,
        /// Serial number in the plant file.
        expected: String,
    },
    /// The bridge or the scanner says no.
    #[error("the bridge refuses ({code}): {text}")]
    Refused {
        /// Code of the protocol.
        code: String,
        /// Its words.
        text: String,
    },
    /// The scan ended by itself.
    #[error("the scan ended as {outcome}: {reason}")]
    Ended {
        /// `aborted` or `failed`.
        outcome: String,
        /// Its words.
        reason: String,
    },
    /// The bridge does not keep to the protocol: no second try helps.
    #[error("the bridge is at fault: {0}; tell its maker")]
    Bridge(String),
    /// The time is over.
    #[error("no scan in time: {0}")]
    TooLate(String),
    /// The host's answer.
    #[error("{0}")]
    Host(#[from] platen_sdk::Error),
}

impl Error {
    /// The error as it crosses the boundary, with the bridge's address.
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
