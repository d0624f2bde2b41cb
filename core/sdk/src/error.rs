//! Errors of plugins, by the person who must act.

use platen_abi::{error_flag, status};

/// Result of a plugin's method.
pub type Result<T> = std::result::Result<T, Error>;

/// Kind of an error; the status code on the boundary.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
pub enum ErrorKind {
    /// The job was cancelled.
    Cancelled = status::CANCELLED,
    /// The deadline passed, or a device did not answer in time.
    Timeout = status::TIMEOUT,
    /// The options contradict each other or the plant.
    Config = status::CONFIG,
    /// The plugin does not support the request.
    Unsupported = status::UNSUPPORTED,
    /// The named file, device or plugin does not exist.
    NotFound = status::NOT_FOUND,
    /// The device is not reachable.
    Disconnected = status::DISCONNECTED,
    /// The device or file is in use.
    Busy = status::BUSY,
    /// Access was refused.
    Denied = status::DENIED,
    /// Reading or writing failed.
    Io = status::IO,
    /// No data is available.
    NoData = status::NO_DATA,
    /// The input or the device's data is invalid.
    BadData = status::BAD_DATA,
    /// Memory is exhausted.
    Memory = status::MEMORY,
    /// The call is not allowed in this state.
    State = status::STATE,
    /// A fault of the plugin itself.
    Internal = status::INTERNAL,
}

/// Error: one sentence on the failure, and one on the remedy.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Error {
    pub(crate) kind: ErrorKind,
    pub(crate) message: String,
    pub(crate) hint: String,
    pub(crate) flags: u32,
}

impl Error {
    /// Makes an error; `message` states where and what, in one sentence.
    pub fn new(kind: ErrorKind, message: impl Into<String>) -> Self {
        Self { kind, message: message.into(), hint: String::new(), flags: 0 }
    }

    /// Adds the hint: the remedy in one sentence.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = hint.into();
        self
    }

    /// Marks the error as temporary: a retry may succeed.
    #[must_use]
    pub fn retryable(mut self) -> Self {
        self.flags |= error_flag::RETRYABLE;
        self
    }

    /// Returns the kind.
    pub fn kind(&self) -> ErrorKind {
        self.kind
    }
}

impl std::fmt::Display for Error {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.message)?;
        if self.hint.is_empty() { Ok(()) } else { write!(f, "; {}", self.hint) }
    }
}

impl std::error::Error for Error {}
