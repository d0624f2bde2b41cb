//! Fault injection into outgoing frames.

use std::collections::BTreeSet;
use std::time::Duration;

use rand_pcg::Pcg64;
use rand_pcg::rand_core::RngCore;

use super::fault::{Fault, FaultKind};
use super::frame::{self, Frame};
use super::payload;

/// Step of sending a frame through the fault injection.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// Sends the frame.
    Send(Frame),
    /// Sends the frame with this bit of its payload flipped.
    SendCorrupted(Frame, usize),
    /// Sends a header alone, with this length, and with this bit flipped, if any.
    Header(u32, Option<usize>),
    /// Sends nothing for this time.
    Wait(Duration),
    /// Cuts the connection.
    Cut,
    /// Cuts the connection and discards all scans, as a restart of the bridge does.
    Die,
}

/// Configured faults and their state.
#[derive(Debug)]
pub(super) struct FrameFaults {
    faults: Vec<Fault>,
    spent: BTreeSet<usize>,
    /// Columns already considered by `missing-column`.
    considered: BTreeSet<(u32, u32)>,
    random: Pcg64,
}

impl FrameFaults {
    pub(super) fn new(faults: &[Fault], seed: u64) -> Self {
        let random = Pcg64::new(u128::from(seed), 7);
        Self { faults: faults.to_vec(), spent: BTreeSet::new(), considered: BTreeSet::new(), random }
    }

    /// Returns the parameter of a persistent fault, if configured.
    pub(super) fn persistent(&self, kind: FaultKind) -> Option<u32> {
        self.faults.iter().find(|fault| fault.kind == kind).map(|fault| fault.number)
    }

    /// Returns the parameter of a one-time fault the first time that `now` holds for it.
    pub(super) fn once(&mut self, kind: FaultKind, now: impl Fn(u32) -> bool) -> Option<u32> {
        let at = self.faults.iter().position(|fault| fault.kind == kind && now(fault.number))?;
        self.spent.insert(at).then(|| self.faults[at].number)
    }

    fn one_in(&mut self, kind: FaultKind) -> bool {
        match self.persistent(kind) {
            Some(share) => self.below(share) == 0,
            None => false,
        }
    }

    /// Draws a random number below `end`.
    pub(super) fn below(&mut self, end: u32) -> u32 {
        (self.random.next_u64() % u64::from(end.max(1))) as u32
    }

    /// Returns the steps of sending a frame; `sent` columns were sent on this connection before.
    pub(super) fn apply(&mut self, frame: Frame, sent: u32) -> Vec<Step> {
        match frame.kind {
            frame::COLUMN => self.column(frame, sent),
            frame::SCAN_END => self.end(frame, sent),
            _ => vec![Step::Send(frame)],
        }
    }

    fn cut(&mut self, sent: u32) -> Option<Step> {
        if self.once(FaultKind::DropMidScan, |at| sent >= at).is_some() {
            return Some(Step::Cut);
        }
        if self.persistent(FaultKind::DropOften).is_some_and(|at| sent >= at) {
            return Some(Step::Cut);
        }
        self.once(FaultKind::BridgeKilled, |at| sent >= at).map(|_| Step::Die)
    }

    fn column(&mut self, frame: Frame, sent: u32) -> Vec<Step> {
        if let Some(cut) = self.cut(sent) {
            return vec![cut];
        }
        let number = payload::number(&frame.payload).unwrap_or(0);
        let mut steps = self.before(&frame, sent);
        if self.persistent(FaultKind::MissingColumn).is_some()
            && self.considered.insert((frame.scan, number))
            && self.one_in(FaultKind::MissingColumn)
        {
            return steps;
        }
        if self.one_in(FaultKind::CorruptFrame) {
            let bit = self.below(8 * frame.payload.len() as u32) as usize;
            steps.push(Step::SendCorrupted(frame, bit));
            return steps;
        }
        if self.one_in(FaultKind::Repeated) {
            steps.push(Step::Send(frame.clone()));
        }
        let torn = self.once(FaultKind::TornColumn, |at| sent >= at).map(|_| altered_copy(&frame));
        steps.push(Step::Send(frame));
        steps.extend(torn.map(Step::Send));
        steps
    }

    /// Returns the faults injected before a column.
    fn before(&mut self, frame: &Frame, sent: u32) -> Vec<Step> {
        let mut steps = Vec::new();
        let mut once = |kind, step: Step| {
            if self.once(kind, |at| sent >= at).is_some() {
                steps.push(step);
            }
        };
        let empty = |kind| Step::Send(Frame { kind, scan: frame.scan, payload: Vec::new() });
        once(FaultKind::CorruptHeader, Step::Header(frame.payload.len() as u32, Some(77)));
        once(FaultKind::Oversize, Step::Header(2 << 20, None));
        once(FaultKind::ZeroLength, empty(frame::COLUMN));
        once(FaultKind::UnknownFrame, empty(0x0777));
        once(FaultKind::UnknownCommand, empty(0x0777 | frame::CRITICAL));
        if let Some(ms) = self.persistent(FaultKind::Slow) {
            steps.push(Step::Wait(Duration::from_millis(ms.into())));
        }
        if sent == 3
            && let Some(ms) = self.once(FaultKind::Stalled, |_| true)
        {
            steps.push(Step::Wait(Duration::from_millis(ms.into())));
        }
        if self.persistent(FaultKind::LateFrames).is_some() && sent.is_multiple_of(5) {
            let scan = frame.scan - 1;
            let end = r#"{"outcome":"aborted","columns":0,"points":0,"digest":0}"#;
            steps.push(Step::Send(Frame { scan, ..altered_copy(frame) }));
            steps.push(Step::Send(Frame { kind: frame::SCAN_END, scan, payload: end.into() }));
        }
        steps
    }

    fn end(&mut self, frame: Frame, sent: u32) -> Vec<Step> {
        if let Some(cut) = self.cut(sent) {
            return vec![cut];
        }
        if self.persistent(FaultKind::EventLost).is_some() {
            return Vec::new();
        }
        if self.once(FaultKind::CorruptEnd, |_| true).is_some() {
            return vec![Step::SendCorrupted(frame, 40)];
        }
        vec![Step::Send(frame)]
    }
}

/// Returns the column with other content and a valid checksum.
fn altered_copy(frame: &Frame) -> Frame {
    let mut payload = frame.payload.clone();
    if let Some(last) = payload.last_mut() {
        *last ^= 1;
    }
    Frame { payload, ..*frame }
}
