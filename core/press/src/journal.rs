//! The journal of the press side: a trait, and an implementation in memory for trials.

use crate::{Recalled, Record};

/// Remembers strokes of one press. Opened by one process at a time: a second host must fail to open it.
///
/// Called on a thread that may block.
pub trait Journal: Send + 'static {
    /// Why something could not be remembered.
    type Error: std::error::Error + Send + Sync + 'static;

    /// What was remembered last.
    ///
    /// # Errors
    /// When the journal cannot be read.
    fn recall(&mut self) -> Result<Recalled, Self::Error>;

    /// Remembers one step; returns when it would survive a power cut.
    ///
    /// Recording the same step of the same stroke again is no error and changes nothing.
    ///
    /// # Errors
    /// When it cannot be written. Later steps of the same stroke may still come.
    fn record(&mut self, record: &Record) -> Result<(), Self::Error>;
}

/// The journal of a trial: it remembers within this process only.
#[derive(Debug, Clone)]
pub struct MemoryJournal(Recalled);

impl MemoryJournal {
    /// An empty one of the installation `owner`, not 0.
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
