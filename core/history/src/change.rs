//! Change log of the record, in the order of its commits, for programs that forward it.
//!
//! It exists from format 1.1 on.

use rusqlite::Row;

use crate::{Archive, Error};

/// A change of the record.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Change {
    /// Number, increasing with the commits; never used twice.
    pub n: u64,
    /// Owner number of the record at the time of the change; for a stroke, at its acceptance.
    pub owner: u16,
    /// The stroke; none for the end of a plate.
    pub run_id: Option<u32>,
    /// Its plate.
    pub plate: Option<u32>,
    /// The event; none for a stroke or a plate.
    pub event: Option<u32>,
    /// Kind of the change.
    pub kind: ChangeKind,
    /// Its time, RFC 3339 in UTC.
    pub at: String,
}

/// Kind of a change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChangeKind {
    /// A stroke was accepted.
    Accepted,
    /// The stroke has a result.
    Finished,
    /// The press has acknowledged the stroke, or never will.
    Acked,
    /// A plate has ended.
    Plate,
    /// An event was recorded.
    Event,
    /// A kind of a later minor format.
    Later,
}

impl ChangeKind {
    const NAMES: [(&str, Self); 5] = [
        ("accepted", Self::Accepted),
        ("finished", Self::Finished),
        ("acked", Self::Acked),
        ("plate", Self::Plate),
        ("event", Self::Event),
    ];

    /// Returns the name; none for [`Later`](Self::Later).
    #[must_use]
    pub fn name(self) -> Option<&'static str> {
        Self::NAMES.iter().find(|(_, kind)| *kind == self).map(|(name, _)| *name)
    }
}

/// Owner number of the record, and the change from which it applies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Owner {
    /// Owner number.
    pub owner: u16,
    /// It applies to changes after this number.
    pub after_change: u64,
}

impl Archive {
    /// Returns up to `most` changes after number `after`, oldest first; none for a record of format 1.0, which a host
    /// extends at its start.
    ///
    /// # Errors
    /// [`Error::Storage`].
    pub fn changes(&self, after: u64, most: u32) -> Result<Vec<Change>, Error> {
        if !self.has_changes()? {
            return Ok(Vec::new());
        }
        let sql = "SELECT n, run_id, plate, event, kind, at, \
                   (SELECT owner FROM owner WHERE after_change < ifnull((SELECT min(n) FROM change a \
                    WHERE a.run_id = c.run_id AND a.kind = 'accepted' AND c.kind IN ('accepted', 'finished', 'acked')), c.n) \
                    ORDER BY owner.n DESC LIMIT 1) \
                   FROM change c WHERE n > ?1 ORDER BY n LIMIT ?2";
        self.rows(sql, (signed(after), most), |row| {
            let kind: String = row.get(4)?;
            let known = ChangeKind::NAMES.iter().find(|(name, _)| *name == kind);
            Ok(Change {
                n: number(row, 0)?,
                run_id: row.get(1)?,
                plate: row.get(2)?,
                event: row.get(3)?,
                kind: known.map_or(ChangeKind::Later, |(_, kind)| *kind),
                at: row.get(5)?,
                owner: row.get(6)?,
            })
        })
        .map_err(Error::storage(self.path()))
    }

    /// Returns the number of the last change, 0 without one.
    ///
    /// # Errors
    /// [`Error::Storage`].
    pub fn last_change(&self) -> Result<u64, Error> {
        if !self.has_changes()? {
            return Ok(0);
        }
        let sql = "SELECT ifnull(max(n), 0) FROM change";
        let last = self.connection().query_row(sql, [], |row| number(row, 0));
        last.map_err(Error::storage(self.path()))
    }

    /// Returns the owner numbers of the record, oldest first; the last one applies now. None for a record of format
    /// 1.0.
    ///
    /// # Errors
    /// [`Error::Storage`].
    pub fn owners(&self) -> Result<Vec<Owner>, Error> {
        if !self.has_changes()? {
            return Ok(Vec::new());
        }
        let sql = "SELECT owner, after_change FROM owner ORDER BY n";
        self.rows(sql, [], |row| Ok(Owner { owner: row.get(0)?, after_change: number(row, 1)? }))
            .map_err(Error::storage(self.path()))
    }

    /// Returns whether the record has format 1.1 or later.
    fn has_changes(&self) -> Result<bool, Error> {
        let sql = "SELECT count(*) > 0 FROM sqlite_schema WHERE name = 'change'";
        self.connection().query_row(sql, [], |row| row.get(0)).map_err(Error::storage(self.path()))
    }
}

fn signed(number: u64) -> i64 {
    i64::try_from(number).unwrap_or(i64::MAX)
}

fn number(row: &Row<'_>, column: usize) -> rusqlite::Result<u64> {
    Ok(row.get::<_, i64>(column)?.unsigned_abs())
}
