//! Errors for the person who must act.

use platen_abi::{error_flag, status};

/// Result of a plugin's work.
pub type Result<T> = std::result::Result<T, Error>;

/// Whose turn it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
pub enum ErrorKind {
    /// The job was cancelled.
    Cancelled = status::CANCELLED,
    /// Something did not answer in time.
    Timeout = status::TIMEOUT,
    /// The options contradict each other or the plant.
    Config = status::CONFIG,
    /// Not something this plugin can do.
    Unsupported = status::UNSUPPORTED,
    /// The named thing does not exist.
    NotFound = status::NOT_FOUND,
    /// The device is not reachable.
    Disconnected = status::DISCONNECTED,
    /// The device or file is in use.
    Busy = status::BUSY,
    /// Access was refused.
    Denied = status::DENIED,
    /// Reading or writing failed.
    Io = status::IO,
    /// There is nothing to deliver.
    NoData = status::NO_DATA,
    /// The input or the device's data is wrong.
    BadData = status::BAD_DATA,
    /// No memory.
    Memory = status::MEMORY,
    /// The call does not fit the state.
    State = status::STATE,
    /// A fault of the plugin itself.
    Internal = status::INTERNAL,
}

/// What happened, in one sentence, and what to do, in another.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Error {
    pub(crate) kind: ErrorKind,
    pub(crate) message: String,
    pub(crate) hint: String,
    pub(crate) flags: u32,
}

impl Error {
    /// An error of this kind; `message` says where and what.
    pub fn new(kind: ErrorKind, message: impl Into<String>) -> Self {
        Self { kind, message: message.into(), hint: String::new(), flags: 0 }
    }

    /// Adds what to do about it.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = hint.into();
        self
    }

    /// Says that trying again may help.
    #[must_use]
    pub fn retryable(mut self) -> Self {
        self.flags |= error_flag::RETRYABLE;
        self
    }

    /// Says that the device is gone until it is opened again.
    #[must_use]
    pub fn device_lost(mut self) -> Self {
        self.flags |= error_flag::DEVICE_LOST;
        self
    }

    /// Whose turn it is.
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
