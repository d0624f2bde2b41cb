//! Selection of the stroke's scan among the files of a watched folder, by polling; a pure function of the listings.
//!
//! Network shares send no events, report sizes before the bytes arrive, disappear and come back, and have another
//! clock. Files present before the trigger are therefore identified by name, size and time, not by age. A file counts
//! as completely written if it stays the same for some polls; the final check is that of its own structure. A refused
//! file is due again when it changes; if it does not change, it is examined again with exponential back-off.

use std::collections::BTreeMap;
use std::io;
use std::path::Path;
use std::time::SystemTime;

/// Properties of one entry of a listing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Entry {
    /// Bytes.
    pub(crate) size: u64,
    /// Last change, by the clock of the share.
    pub(crate) modified: Option<SystemTime>,
    pub(crate) folder: bool,
}

/// Names and entries of a folder, sorted by name.
pub(crate) type Listing = BTreeMap<String, Entry>;

/// Lists a folder; entries that vanish meanwhile are left out.
pub(crate) fn list(folder: &Path) -> io::Result<Listing> {
    let mut listing = Listing::new();
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        // Follows links, unlike the entry's own metadata.
        if let Ok(data) = std::fs::metadata(entry.path()) {
            let name = entry.file_name().to_string_lossy().into_owned();
            let modified = data.modified().ok();
            listing.insert(name, Entry { size: data.len(), modified, folder: data.is_dir() });
        }
    }
    Ok(listing)
}

/// Endings of files that are still being written.
const UNFINISHED: [&str; 6] = [".part", ".partial", ".tmp", ".temp", ".crdownload", ".filepart"];

/// Largest number of polls between two examinations of an unchanged file, in units of the polls for stability.
const MAX_PATIENCE: u32 = 16;

/// File that may be the scan.
#[derive(Debug, Clone)]
struct Candidate {
    entry: Entry,
    same_for: u32,
    /// Polls after which it is due.
    due_after: u32,
    refused: Option<String>,
}

/// Wait for one scan.
#[derive(Debug)]
pub(crate) struct Watch {
    pattern: glob::Pattern,
    stable_polls: u32,
    before: Option<Listing>,
    candidates: BTreeMap<String, Candidate>,
    lost: Option<String>,
}

impl Watch {
    /// Starts a wait. Files of `before`, the listing before the trigger, are not candidates while they stay the same;
    /// without it the first listing replaces it.
    pub(crate) fn new(pattern: glob::Pattern, stable_polls: u32, before: Option<Listing>) -> Self {
        Self { pattern, stable_polls, before, candidates: BTreeMap::new(), lost: None }
    }

    /// Evaluates a listing; returns the names that are due for examination, in order.
    pub(crate) fn poll(&mut self, listing: io::Result<Listing>) -> Vec<String> {
        let listing = match listing {
            Ok(listing) => listing,
            Err(error) => {
                self.lost = Some(error.to_string());
                return Vec::new();
            }
        };
        self.lost = None;
        if self.before.is_none() {
            self.before = Some(listing.clone());
        }
        self.candidates.retain(|name, _| listing.contains_key(name));
        let mut due = Vec::new();
        for (name, entry) in listing {
            if !self.may_be_it(&name, &entry) {
                self.candidates.remove(&name);
                continue;
            }
            let fresh = || Candidate { entry, same_for: 0, due_after: self.stable_polls, refused: None };
            let candidate = self.candidates.entry(name.clone()).or_insert_with(fresh);
            if candidate.entry != entry {
                let refused = candidate.refused.take();
                *candidate = Candidate { refused, ..fresh() };
            }
            candidate.same_for += 1;
            if candidate.same_for == candidate.due_after {
                due.push(name);
            }
        }
        due
    }

    fn may_be_it(&self, name: &str, entry: &Entry) -> bool {
        let lower = name.to_lowercase();
        let hidden = name.starts_with(['.', '~']) || UNFINISHED.iter().any(|end| lower.ends_with(end));
        let options = glob::MatchOptions { case_sensitive: false, ..glob::MatchOptions::new() };
        let old = self.before.as_ref().is_some_and(|before| before.get(name) == Some(entry));
        !hidden && !old && self.pattern.matches_with(name, options)
    }

    /// Records that a file was examined and is not the scan, or not yet.
    pub(crate) fn refuse(&mut self, name: &str, why: String) {
        if let Some(candidate) = self.candidates.get_mut(name) {
            let patience = (candidate.due_after / self.stable_polls).min(MAX_PATIENCE) * self.stable_polls;
            candidate.due_after += patience;
            candidate.refused = Some(why);
        }
    }

    /// Returns the reason why there is no scan yet, for the operator.
    pub(crate) fn why(&self) -> String {
        if let Some(error) = &self.lost {
            return format!("the folder cannot be read: {error}");
        }
        let mut reasons = self.candidates.iter().map(|(name, candidate)| match &candidate.refused {
            Some(why) => format!("{name}: {why}"),
            None if candidate.entry.size == 0 => format!("{name} is empty so far"),
            None => format!("{name} is still changing"),
        });
        let none = || format!("no new file matches {}", self.pattern.as_str());
        let first = reasons.next().unwrap_or_else(none);
        match reasons.count() {
            0 => first,
            more => format!("{first} (and {more} more)"),
        }
    }
}
