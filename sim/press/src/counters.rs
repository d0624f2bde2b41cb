//! Counters of a press: the behaviour of its host as observed by the press, on which tests assert.
//!
//! [`WriteMonitor`] examines every write as it arrives. A result that is published twice or changes under its number is
//! therefore detected even between two cycles of the program.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::Serialize;

use crate::program::Cause;
use crate::registers::{HBlock, INVALID_I16, INVALID_U16, Verdict, h, status};

/// Largest number of messages kept; counting continues.
const MAX_MESSAGES: usize = 20;

/// Counters of a press since its start.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Counters {
    /// Milliseconds since the start.
    pub now_ms: u64,
    /// All strokes are made, or the plate has passed, and the last part has left.
    pub done: bool,
    /// Strokes made and triggered.
    pub strokes: u64,
    /// Baseline scans requested.
    pub baselines: u64,
    /// Rescans requested.
    pub rescans: u64,
    /// Stroke numbers skipped by a fault.
    pub skipped: u64,
    /// Triggers withdrawn before acceptance while the host was busy.
    pub lost_while_busy: u64,
    /// Requests superseded by a newer one.
    pub superseded: u64,
    /// Requests without a result within the limit.
    pub result_timeouts: u64,
    /// Requests dropped because the host was dead.
    pub host_deaths: u64,
    /// Requests accepted after the limit.
    pub accepted_late: u64,
    /// Parts started.
    pub parts: u64,
    /// Restarts of the controller.
    pub restarts: u64,
    /// Requests for the plate's shape: scans started.
    pub plates_served: u64,
    /// Missed strokes reported by the host.
    pub missed_reported: u16,

    /// Connections accepted.
    pub connections: u64,
    /// Reads received.
    pub reads: u64,
    /// Writes received.
    pub writes: u64,
    /// Writes with a word outside the H block and the registers for advice.
    pub writes_outside: u64,
    /// Writes on a connection that had not read both blocks before.
    pub writes_before_sync: u64,
    /// Writes on a connection that had last read cleared registers or another map version.
    pub writes_while_void: u64,
    /// Injected line faults, by name.
    pub line_faults: BTreeMap<String, u64>,

    /// Distinct results seen in the H block.
    pub published: u64,
    /// Results published again under another sequence number.
    pub duplicates: u64,
    /// Results whose words changed under the same sequence number.
    pub changed: u64,
    /// Inconsistencies between words.
    pub wrong_values: u64,
    /// Messages about inconsistencies, the first few.
    pub wrong: Vec<String>,
    /// Owner words seen; more than one indicates more than one host.
    pub owners: Vec<u16>,

    /// Accepted results, in order.
    pub taken: Vec<AcceptedResult>,
}

/// Result accepted by the press.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AcceptedResult {
    /// Cause of the request.
    pub cause: Cause,
    /// Stroke number.
    pub stroke_id: u16,
    /// Session.
    pub session_id: u16,
    /// Attempt.
    pub attempt: u16,
    /// Part.
    pub part_id: u32,
    /// Bends of the plate at that time.
    pub bends: u32,
    /// Time from trigger to the host's echo.
    pub accepted_ms: u64,
    /// Time from trigger to the result.
    pub result_ms: u64,
    /// Verdict.
    pub verdict: Verdict,
    /// H block.
    pub words: Vec<u16>,
}

impl Counters {
    /// Returns the counters without the list of results, and the number of results: cheap to request in a long run.
    #[must_use]
    pub fn counts(&mut self) -> (Self, usize) {
        let taken = std::mem::take(&mut self.taken);
        let counts = self.clone();
        self.taken = taken;
        (counts, self.taken.len())
    }

    /// Counts an inconsistency and keeps a message about it.
    pub fn wrong(&mut self, message: String) {
        self.wrong_values += 1;
        if self.wrong.len() < MAX_MESSAGES {
            self.wrong.push(message);
        }
    }

    /// Checks the words of a result that is about to be accepted.
    pub fn check_result(&mut self, host: &HBlock, recipe_id: u16) {
        let stroke = host.word(h::RESULT_STROKE_ID);
        if host.crc() != host.word(h::CRC16) {
            let (found, needed) = (host.word(h::CRC16), host.crc());
            self.wrong(format!("stroke {stroke}: checksum {found:#06x}, the words require {needed:#06x}"));
        }
        if host.word(h::RECIPE_ECHO) != recipe_id {
            let found = host.word(h::RECIPE_ECHO);
            self.wrong(format!("stroke {stroke}: recipe {found} echoed, {recipe_id} requested"));
        }
        let bits = host.word(h::STATUS);
        let verdicts = [status::PASS, status::FAIL, status::NOT_MEASURED, status::CANNOT_TELL];
        if verdicts.iter().filter(|&&bit| bits & bit != 0).count() != 1 {
            self.wrong(format!("stroke {stroke}: status {bits:#06x} does not contain exactly one verdict"));
        }
        if bits & status::BUSY != 0 {
            self.wrong(format!("stroke {stroke}: result_valid is set while busy"));
        }
        if host.status(status::NOT_MEASURED) {
            let gap = host.word(h::GAP_MAX);
            if gap != INVALID_U16 {
                self.wrong(format!("stroke {stroke}: not measured, but the gap is {gap}"));
            }
        }
        let [max, min] = [host.word(h::DEV_MAX), host.word(h::DEV_MIN)];
        if max != INVALID_I16 && min != INVALID_I16 && max.cast_signed() < min.cast_signed() {
            self.wrong(format!(
                "stroke {stroke}: largest deviation {max:#06x} below the smallest {min:#06x}"
            ));
        }
    }
}

/// Identity of a result: session, stroke, attempt.
type Identity = (u16, u16, u16);

/// Monitor of the H block from write to write.
#[derive(Clone, Debug, Default)]
pub struct WriteMonitor {
    published: BTreeMap<Identity, (u16, Vec<u16>)>,
    last_seq: Option<u16>,
}

impl WriteMonitor {
    /// Examines the H block after a write.
    pub fn observe(&mut self, host: &HBlock, counters: &mut Counters) {
        let owner = host.word(h::OWNER);
        if owner != 0 && !counters.owners.contains(&owner) {
            counters.owners.push(owner);
        }
        counters.missed_reported = host.word(h::MISSED_COUNT);
        if host.status(status::PASS) && host.status(status::FAIL) {
            counters.wrong(format!("status {:#06x}: pass and fail", host.word(h::STATUS)));
        }
        if !host.status(status::RESULT_VALID) {
            return;
        }
        let stroke = host.word(h::RESULT_STROKE_ID);
        if !host.whole() {
            let [head, tail] = [host.word(h::RESULT_SEQ), host.word(h::RESULT_SEQ_TAIL)];
            counters.wrong(format!("stroke {stroke}: valid, but sequence {head} and its copy {tail} differ"));
            return;
        }
        let identity = (host.word(h::SESSION_ECHO), stroke, host.word(h::ATTEMPT_ECHO));
        let seq = host.word(h::RESULT_SEQ);
        let words = result_words(host);
        match self.published.get(&identity) {
            None => {
                // Results lost during a restart of the press leave gaps; a decrease would indicate a lost journal of
                // the host.
                let step = self.last_seq.map_or(1, |last| seq.wrapping_sub(last));
                if step == 0 || step > u16::MAX / 2 {
                    counters.wrong(format!("stroke {stroke}: sequence {seq} after {:?}", self.last_seq));
                }
                self.last_seq = Some(seq);
                counters.published += 1;
                self.published.insert(identity, (seq, words));
            }
            Some((first, _)) if *first != seq => counters.duplicates += 1,
            Some((_, before)) if *before != words => counters.changed += 1,
            Some(_) => {}
        }
    }
}

/// Returns the words that belong to the result alone: figures, positions, times, identity.
fn result_words(host: &HBlock) -> Vec<u16> {
    host.0[10..=48].iter().chain(&host.0[50..=51]).chain(&host.0[55..=61]).copied().collect()
}

/// Returns the whole milliseconds of a duration.
#[must_use]
pub fn whole_ms(duration: Duration) -> u64 {
    u64::try_from(duration.as_millis()).unwrap_or(u64::MAX)
}
