//! Events recorded besides the strokes: alarms, jumps of the clock.

use jiff::Timestamp;

use crate::archive::{self, text};
use crate::history::History;
use crate::{Archive, Error};

/// Recorded event.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Event {
    /// Number, increasing.
    pub event: u32,
    /// Its time.
    pub at: Timestamp,
    /// Kind: `alarm`, `clock`.
    pub kind: String,
    /// Stroke to which it belongs.
    pub run_id: Option<u32>,
    /// Sentence for people.
    pub text: String,
}

impl History {
    /// Records an event.
    ///
    /// # Errors
    /// [`Error::Storage`].
    pub fn note(&mut self, kind: &str, run_id: Option<u32>, said: &str, now: Timestamp) -> Result<(), Error> {
        let sql = "INSERT INTO event (at, kind, run_id, text) VALUES (?1, ?2, (SELECT run_id FROM stroke WHERE run_id = ?3), ?4)";
        let noted = self.archive().connection().execute(sql, (text(now), kind, run_id, said));
        noted.map(drop).map_err(self.storage())
    }
}

impl Archive {
    /// Returns up to `most` events after number `after`, oldest first.
    ///
    /// # Errors
    /// [`Error::Storage`].
    pub fn events(&self, after: u32, most: u32) -> Result<Vec<Event>, Error> {
        let sql = "SELECT event, at, kind, run_id, text FROM event WHERE event > ?1 ORDER BY event LIMIT ?2";
        self.rows(sql, (after, most), |row| {
            Ok(Event {
                event: row.get(0)?,
                at: archive::time(row, 1)?,
                kind: row.get(2)?,
                run_id: row.get(3)?,
                text: row.get(4)?,
            })
        })
        .map_err(Error::storage(self.path()))
    }
}
