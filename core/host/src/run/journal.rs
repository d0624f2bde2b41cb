//! Journal of the press side, kept in the history.

use std::sync::{Arc, Mutex, PoisonError};

use jiff::Timestamp;
use platen_history::{Error, History};
use platen_model::{Recalled, Record};
use platen_press::Journal;

/// History as the press side's journal.
#[derive(Debug)]
pub(super) struct HistoryJournal(pub(super) Arc<Mutex<History>>);

impl Journal for HistoryJournal {
    type Error = Error;

    fn recall(&mut self) -> Result<Recalled, Error> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).recall()
    }

    fn record(&mut self, record: &Record) -> Result<(), Error> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).record(record, Timestamp::now())
    }
}
