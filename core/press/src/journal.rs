//! Journal of strokes: write-ahead record of the handshake, as a trait and as an implementation in memory for trials.

use crate::{Recalled, Record};

/// Journal of the strokes of one press. Exactly one process may open it: a second host must fail.
///
/// Called on a thread that may block.
pub trait Journal: Send + 'static {
    /// Reason why the journal cannot be read or written.
    type Error: std::error::Error + Send + Sync + 'static;

    /// Returns the state after the last record.
    ///
    /// # Errors
    /// When the journal cannot be read.
    fn recall(&mut self) -> Result<Recalled, Self::Error>;

    /// Writes one record and returns once it survives a power cut. Idempotent: the same stage of the same stroke may be
    /// recorded again.
    ///
    /// # Errors
    /// When the record cannot be written. Later stages of the same stroke may follow.
    fn record(&mut self, record: &Record) -> Result<(), Self::Error>;
}

/// Journal of a trial, lost at the end of the process.
#[derive(Debug, Clone)]
pub struct MemoryJournal(Recalled);

impl MemoryJournal {
    /// Makes an empty journal of the installation `owner`, which must not be 0.
    pub fn new(owner: u16) -> Self {
        Self(Recalled::empty(owner))
    }
}

impl Journal for MemoryJournal {
    type Error = std::convert::Infallible;

    fn recall(&mut self) -> Result<Recalled, Self::Error> {
        Ok(self.0.clone())
    }

    fn record(&mut self, record: &Record) -> Result<(), Self::Error> {
        self.0.replay(record);
        Ok(())
    }
}
