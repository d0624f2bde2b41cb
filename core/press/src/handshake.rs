//! The handshake with the press as a pure state machine.
//!
//! [`Handshake::step`] takes one event and the time and gives back effects; between two steps nothing happens. It knows
//! no socket, no clock, no journal and no scanner, so it can be tried with any order of events in virtual time.
//!
//! Two things go on at once and are two regions of one state: the link to the press ([`LinkState`]) and the stroke in hand
//! ([`Work`]). A cut link does not stop a scan; its result waits until the press is back. An event only changes what
//! the machine has seen; then transitions are taken, one `match` ([`transitions`]), until none is due. What the registers
//! shall say follows from the state ([`register_image`]) and is never edited by hand.

mod acceptance;
mod link_region;
mod machine;
mod register_image;
mod transitions;
mod trigger_edges;
mod work_region;

pub use machine::{Command, Config, Effect, Event, Handshake};

/// The link region: whether the press may be read and written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LinkState {
    /// Before the first step.
    #[default]
    Boot,
    /// No connection.
    Offline,
    /// Connected, reading only: is it the right press, does another host write to it, where do its strokes stand?
    Sync,
    /// In step with the press.
    Online,
    /// Latched until a reset.
    Fault(crate::Code),
    /// The end; `told` says whether the safe registers may still be written.
    Stopped {
        /// The press was in step at the end.
        writable: bool,
    },
}

/// The work region: the stroke in hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Work {
    /// None, ready for one.
    #[default]
    Idle,
    /// None, and none is accepted.
    Blocked,
    /// Seen; being journalled, then waiting for the press to be clear.
    Accepted,
    /// The scanner is at work.
    Scanning,
    /// The scan is being judged.
    Evaluating,
    /// Given up; that is being journalled.
    Aborted,
    /// The result is being journalled, then written.
    Publish,
    /// The result stands in the registers until the press acknowledges.
    WaitAck,
    /// Acknowledged; until the press takes its acknowledge back.
    Clear,
}

/// One of both regions, as one number for the register `host_state` and one word for people.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct State {
    /// The link region.
    pub link: LinkState,
    /// The work region.
    pub work: Work,
}

impl State {
    /// The number in `host_state`.
    pub fn number(self) -> u16 {
        match (self.link, self.work) {
            (LinkState::Boot, _) => 0,
            (LinkState::Offline, _) => 1,
            (LinkState::Sync, _) => 2,
            (LinkState::Online, Work::Idle) => 3,
            (LinkState::Online, Work::Blocked) => 4,
            (LinkState::Online, Work::Accepted) => 5,
            (LinkState::Online, Work::Scanning) => 6,
            (LinkState::Online, Work::Evaluating) => 7,
            (LinkState::Online, Work::Aborted) => 8,
            (LinkState::Online, Work::Publish) => 9,
            (LinkState::Online, Work::WaitAck) => 10,
            (LinkState::Online, Work::Clear) => 11,
            (LinkState::Fault(_), _) => 12,
            (LinkState::Stopped { .. }, _) => 13,
        }
    }

    /// The word for people, by [`number`](Self::number).
    pub const NAMES: [&'static str; 14] = [
        "boot",
        "offline",
        "sync",
        "idle",
        "blocked",
        "accepted",
        "scanning",
        "evaluating",
        "aborted",
        "publish",
        "wait for ack",
        "clear",
        "fault",
        "stopped",
    ];
}

impl std::fmt::Display for State {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(Self::NAMES[usize::from(self.number())])
    }
}

/// A transition of the handshake, named after the occurrence. The table is in the README of this crate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Transition {
    /// The handshake has started and waits for a connection.
    LinkStarted,
    /// A connection to the press is open; both blocks are read next.
    Connected,
    /// The register map version or the press number is wrong; nothing was written.
    PressRejected,
    /// Another live host writes to this press; nothing was written.
    SecondHostFound,
    /// The active stroke goes on after a reconnection, or its journalled result is published after a restart.
    StrokeResumed,
    /// A trigger that was up at the first read is accepted as a stroke.
    WaitingStrokeAccepted,
    /// A stroke that a restart interrupted is evaluated again, scanned again or reported as interrupted.
    InterruptedStrokeRecovered,
    /// The first read is the baseline of the stroke counter; no stroke is active.
    Synchronised,
    /// READY is withdrawn: press not enabled, scanner not ready, stale heartbeat, storage or missed stroke by policy.
    Blocked,
    /// The cause of the block is gone.
    Unblocked,
    /// A new stroke is accepted.
    StrokeAccepted,
    /// The press is clear and the acceptance is journalled; the scanner starts.
    ScanStarted,
    /// The acquisition is complete: the plate may move, the evaluation starts.
    ScanTaken,
    /// The scan is aborted, failed, not allowed or overdue.
    ScanGivenUp,
    /// The evaluation has a verdict.
    StrokeMeasured,
    /// The stroke ends without a measurement; the reason is published instead.
    StrokeNotMeasured,
    /// All words of the result were echoed by the press.
    ResultPublished,
    /// The press has acknowledged the result.
    ResultAcknowledged,
    /// The press has lowered its acknowledgement, or the time for it is over.
    AckWithdrawn,
    /// The press has not acknowledged in time; the result stays valid.
    AckTimedOut,
    /// The connection is lost.
    LinkLost,
    /// A fault is latched.
    Faulted,
    /// The fault is reset.
    FaultReset,
    /// The host ends.
    Stopped,
    /// The heartbeat of the press stands still.
    HeartbeatLost,
    /// A stroke came while another was active.
    StrokeMissed,
    /// The press requests another scan of its last stroke.
    RescanAccepted,
}

impl Transition {
    /// All transitions, in the order of the table.
    pub const ALL: [Self; 27] = [
        Self::LinkStarted,
        Self::Connected,
        Self::PressRejected,
        Self::SecondHostFound,
        Self::StrokeResumed,
        Self::WaitingStrokeAccepted,
        Self::InterruptedStrokeRecovered,
        Self::Synchronised,
        Self::Blocked,
        Self::Unblocked,
        Self::StrokeAccepted,
        Self::ScanStarted,
        Self::ScanTaken,
        Self::ScanGivenUp,
        Self::StrokeMeasured,
        Self::StrokeNotMeasured,
        Self::ResultPublished,
        Self::ResultAcknowledged,
        Self::AckWithdrawn,
        Self::AckTimedOut,
        Self::LinkLost,
        Self::Faulted,
        Self::FaultReset,
        Self::Stopped,
        Self::HeartbeatLost,
        Self::StrokeMissed,
        Self::RescanAccepted,
    ];
}
