//! Records of the journal: the steps of a stroke that must survive a power cut.
//!
//! A commitment to the press is written to the disk before it is made. No stroke is echoed as accepted before
//! [`Record::Accepted`] is on the disk, and no result is published before [`Record::Finished`] is.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::{Publication, StrokeData, StrokeKey};

/// Step of a stroke that must survive a power cut.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Record {
    /// The stroke will be echoed as accepted, then scanned.
    Accepted {
        /// Its identity.
        key: StrokeKey,
        /// Key of its record.
        run_id: u32,
        /// Data of the press about it.
        data: Box<StrokeData>,
    },
    /// The scan is complete.
    #[allow(missing_docs, reason = "the stroke")]
    Scanned { key: StrokeKey },
    /// The result will be published.
    Finished(Box<Publication>),
    /// The stroke is closed.
    #[allow(missing_docs, reason = "the stroke and its acknowledgement")]
    Acked { key: StrokeKey, how: Acknowledgement },
}

impl Record {
    /// Returns the stroke.
    pub fn key(&self) -> StrokeKey {
        match self {
            Self::Accepted { key, .. } | Self::Scanned { key } | Self::Acked { key, .. } => *key,
            Self::Finished(publication) => publication.key,
        }
    }

    /// Returns the step.
    pub fn stage(&self) -> Stage {
        match self {
            Self::Accepted { .. } => Stage::Accepted,
            Self::Scanned { .. } => Stage::Scanned,
            Self::Finished(_) => Stage::Finished,
            Self::Acked { .. } => Stage::Acked,
        }
    }
}

/// Stage of a stroke, in order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// Accepted, not scanned.
    Accepted,
    /// Scanned, not judged.
    Scanned,
    /// Judged; the press may not have received the result.
    Finished,
    /// Closed.
    Acked,
}

/// Acknowledgement of a result by the press.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Acknowledgement {
    /// The press raised its acknowledge bit.
    Explicit,
    /// The press continued with the next stroke while the result was in the registers.
    NextStroke,
    /// The press gave no sign of having read the result: it continued or restarted before the result was in the
    /// registers, or its next trigger rose before that.
    Never,
}

/// Last stroke in the journal.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Its identity.
    pub key: StrokeKey,
    /// Key of its record.
    pub run_id: u32,
    /// Data of the press about it.
    pub data: StrokeData,
    /// Its stage.
    pub stage: Stage,
    /// Its result; `Some` from [`Stage::Finished`] on.
    pub publication: Option<Publication>,
}

/// State of the journal at the start of the host.
#[derive(Debug, Clone, PartialEq)]
pub struct Recalled {
    /// Random number of this installation, drawn once, never 0: identifies this host among the hosts of a press.
    pub owner: u16,
    /// `seq` of the last publication, 0 before the first.
    pub result_seq: u16,
    /// Run id of the last stroke, 0 before the first.
    pub run_id: u32,
    /// Last accepted stroke.
    pub last: Option<Entry>,
    /// Highest attempt for each stroke number in the session of [`last`](Self::last): these strokes are not scanned
    /// again.
    pub attempts: BTreeMap<u16, u16>,
}

impl Recalled {
    /// Returns the journal of a new installation.
    pub fn empty(owner: u16) -> Self {
        Self { owner, result_seq: 0, run_id: 0, last: None, attempts: BTreeMap::new() }
    }

    /// Applies the next record of a journal that is read from its beginning.
    pub fn replay(&mut self, record: &Record) {
        if let Record::Accepted { key, run_id, data } = record {
            if self.last.as_ref().is_some_and(|last| last.key.session != key.session) {
                self.attempts.clear();
            }
            self.attempts.insert(key.stroke, key.attempt);
            self.run_id = *run_id;
            let data = StrokeData::clone(data);
            let (key, run_id) = (*key, *run_id);
            self.last = Some(Entry { key, run_id, data, stage: Stage::Accepted, publication: None });
        }
        if let Record::Finished(publication) = record {
            self.result_seq = publication.seq;
        }
        if let Some(last) = self.last.as_mut().filter(|last| last.key == record.key()) {
            last.stage = record.stage();
            if let Record::Finished(publication) = record {
                last.publication = Some((**publication).clone());
            }
        }
    }
}

impl Acknowledgement {
    /// Returns the name in the record.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Explicit => "explicit",
            Self::NextStroke => "next_stroke",
            Self::Never => "never",
        }
    }
}
