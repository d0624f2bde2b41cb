//! Reader of the record: the next messages after a cursor.
//!
//! The record is opened for reading while its host writes it. A record that was restored from a backup is another file
//! under the same name, and is opened anew.

use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

use platen_history::{Archive, Error, Owner};

use crate::message::{self, Message, Names};

/// The next changes of a record.
#[derive(Debug, Default)]
pub(crate) struct Batch {
    /// Their messages, in order.
    pub(crate) messages: Vec<Message>,
    /// Changes from which no message can be built, each with the reason.
    pub(crate) unreadable: Vec<(u64, String)>,
    /// Number of the last change: the cursor when all were sent.
    pub(crate) last: u64,
}

/// Backlog of a cursor: changes of the record after it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Backlog {
    pub(crate) changes: u64,
    /// Age of the oldest of them, seconds.
    pub(crate) oldest_s: Option<f64>,
}

/// Reader of the record of one host.
#[derive(Debug)]
pub(crate) struct Feed {
    path: PathBuf,
    names: Names,
    open: Option<(Archive, u64)>,
}

impl Feed {
    pub(crate) fn new(path: &Path, names: &Names) -> Self {
        Self { path: path.to_owned(), names: names.clone(), open: None }
    }

    /// Returns the owner numbers of the record, oldest first.
    pub(crate) fn owners(&mut self) -> Result<Vec<Owner>, Error> {
        self.archive()?.owners()
    }

    /// Returns up to `most` changes after a cursor.
    pub(crate) fn next(&mut self, after: u64, most: u32) -> Result<Batch, Error> {
        let names = self.names.clone();
        let archive = self.archive()?;
        let mut batch = Batch { last: after, ..Batch::default() };
        for change in archive.changes(after, most)? {
            match message::message(archive, &names, &change) {
                Ok(message) => batch.messages.extend(message),
                Err(error @ (Error::Damaged { .. } | Error::NoSuchRun { .. })) => {
                    batch.unreadable.push((change.n, error.to_string()));
                }
                Err(error) => return Err(error),
            }
            batch.last = change.n;
        }
        Ok(batch)
    }

    /// Returns the backlog of a cursor.
    pub(crate) fn backlog(&mut self, after: u64) -> Result<Backlog, Error> {
        let archive = self.archive()?;
        let changes = archive.last_change()?.saturating_sub(after);
        let oldest = archive.changes(after, 1)?.pop().and_then(|it| it.at.parse::<jiff::Timestamp>().ok());
        let oldest_s = oldest.map(|at| jiff::Timestamp::now().duration_since(at).as_secs_f64().max(0.0));
        Ok(Backlog { changes, oldest_s })
    }

    /// Returns the cursor before the first change of a stroke.
    pub(crate) fn before_run(&mut self, run_id: u32) -> Result<u64, Error> {
        self.before_first(|change| change.run_id.is_some_and(|run| run >= run_id))
    }

    /// Returns the cursor before the first change at this time or later.
    pub(crate) fn before(&mut self, at: jiff::Timestamp) -> Result<u64, Error> {
        self.before_first(|change| change.at.parse::<jiff::Timestamp>().is_ok_and(|it| it >= at))
    }

    fn before_first(&mut self, wanted: impl Fn(&platen_history::Change) -> bool) -> Result<u64, Error> {
        let archive = self.archive()?;
        let mut before = 0;
        loop {
            let changes = archive.changes(before, 1000)?;
            let Some(last) = changes.last() else { return Ok(before) };
            match changes.iter().position(&wanted) {
                Some(0) => return Ok(before),
                Some(k) => return Ok(changes[k - 1].n),
                None => before = last.n,
            }
        }
    }

    fn archive(&mut self) -> Result<&Archive, Error> {
        let unreachable = |source| Error::Unreachable { path: self.path.clone(), source };
        let inode = std::fs::metadata(&self.path).map_err(unreachable)?.ino();
        let open = match self.open.take() {
            Some(open) if open.1 == inode => open,
            _ => (Archive::open(&self.path)?, inode),
        };
        Ok(&self.open.insert(open).0)
    }
}
