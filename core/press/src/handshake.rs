//! Handshake with the press: a pure state machine (Mealy machine).
//!
//! [`Handshake::step`] maps state, one event and the time to the next state and a list of effects. It has no socket,
//! clock, journal or scanner, so that any order of events can be tested in virtual time.
//!
//! The state has two orthogonal regions: the link to the press ([`LinkState`]) and the active stroke ([`Work`]). A lost
//! link does not stop a scan; its result waits for the reconnection. One step runs in this order:
//!
//! 1. [`machine`] stores the event ([`messages`]): it changes observations only.
//! 2. [`transitions`] takes transitions in order of urgency until none is due. [`link_region`] and [`work_region`]
//!    contain their actions, [`acceptance`] the conditions under which a stroke is accepted, blocked or missed.
//!    For a press without stroke numbers, [`trigger_edges`] counts the strokes.
//! 3. [`register_image`] derives the wanted registers from the state; they are never edited directly.
//!
//! The table of transitions with conditions, effects and deadlines is in the README of this crate.

mod acceptance;
mod link_region;
mod machine;
mod messages;
mod register_image;
mod transitions;
mod trigger_edges;
mod work_region;

pub use machine::{Config, Handshake};
pub use messages::{Command, Effect, Event};

/// Link region: whether the press may be read and written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LinkState {
    /// Before the first step.
    #[default]
    Boot,
    /// No connection.
    Offline,
    /// Connected, reads only: checks press and map, looks for another host, reads the stroke counter.
    Sync,
    /// Synchronised with the press.
    Online,
    /// Latched until a reset.
    Fault(crate::Code),
    /// Ended; only the safe registers may still be written.
    Stopped {
        /// The press was connected and known at the end.
        writable: bool,
    },
}

/// Work region: the active stroke.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Work {
    /// No active stroke; the next one is accepted.
    #[default]
    Idle,
    /// No active stroke; none is accepted.
    Blocked,
    /// Accepted: being journalled, then waiting for `clear_to_scan`.
    Accepted,
    /// Acquisition by the scanner.
    Scanning,
    /// Evaluation of the scan.
    Evaluating,
    /// Given up; the reason is being journalled.
    Aborted,
    /// The result is being journalled, then written.
    Publish,
    /// The result is valid in the registers; waits for the acknowledgement.
    WaitAck,
    /// Acknowledged; waits until the press lowers its acknowledgement.
    Clear,
}

/// State of both regions; one number in the register `host_state`, one word in logs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct State {
    /// The link region.
    pub link: LinkState,
    /// The work region.
    pub work: Work,
}

impl State {
    /// Returns the number in `host_state`.
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

    /// Words by [`number`](Self::number).
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
    /// The active stroke continues after a reconnection, or its journalled result is published after a restart.
    StrokeResumed,
    /// A trigger that was up at the first read is accepted as a stroke.
    WaitingStrokeAccepted,
    /// A stroke that a restart interrupted is evaluated again or reported as interrupted.
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
    /// The heartbeat of the press no longer changes.
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
