//! Which file of a watched folder is the scan that this stroke waits for. Pure: it is told what lies in the folder.
//!
//! Network shares send no events, report sizes before the bytes arrive, vanish and come back, and their clock is
//! not ours. So the folder is listed again and again, what lay there before the trigger is told by name, size and
//! time and not by age, a file counts as written when it stays the same for some polls, and then its own structure
//! has the last word. A file that was refused is looked at again when it changes, and now and then when not.

use std::collections::BTreeMap;
use std::io;
use std::path::Path;
use std::time::SystemTime;

/// What a listing says of one entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Entry {
    /// Bytes.
    pub(crate) size: u64,
    /// Last change, by the clock of the share.
    pub(crate) modified: Option<SystemTime>,
    /// True for a folder.
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

/// Endings that programs give to files they are still writing.
const UNFINISHED: [&str; 6] = [".part", ".partial", ".tmp", ".temp", ".crdownload", ".filepart"];

/// Most polls between two looks at a refused file that does not change, in units of the polls for stability.
const MAX_PATIENCE: u32 = 16;

/// A file that may be the scan.
#[derive(Debug, Clone)]
struct Candidate {
    entry: Entry,
    same_for: u32,
    /// Polls after which it is looked at.
    due_after: u32,
    refused: Option<String>,
}

/// Waits for one scan.
#[derive(Debug)]
pub(crate) struct Watch {
    pattern: glob::Pattern,
    stable_polls: u32,
    before: Option<Listing>,
    candidates: BTreeMap<String, Candidate>,
    lost: Option<String>,
}

impl Watch {
    /// `before` lay in the folder before the trigger and is no candidate as long as it stays the same; when nobody
    /// could look then, it is what the first listing shows.
    pub(crate) fn new(pattern: glob::Pattern, stable_polls: u32, before: Option<Listing>) -> Self {
        Self { pattern, stable_polls, before, candidates: BTreeMap::new(), lost: None }
    }

    /// Takes a listing; gives the names that are due for a look, in order.
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

    /// Says that a file was looked at and is not the scan, or not yet.
    pub(crate) fn refuse(&mut self, name: &str, why: String) {
        if let Some(candidate) = self.candidates.get_mut(name) {
            let patience = (candidate.due_after / self.stable_polls).min(MAX_PATIENCE) * self.stable_polls;
            candidate.due_after += patience;
            candidate.refused = Some(why);
        }
    }

    /// Why there is no scan yet, for the person who waits.
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
