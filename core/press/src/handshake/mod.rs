//! The handshake with the press as a pure state machine.
//!
//! [`Handshake::step`] takes one event and the time and gives back effects; between two steps nothing happens. It knows
//! no socket, no clock, no journal and no scanner, so it can be tried with any order of events in virtual time.
//!
//! Two things go on at once and are two regions of one state: the link to the press ([`LinkState`]) and the stroke in hand
//! ([`Work`]). A cut link does not stop a scan; its result waits until the press is back. An event only changes what
//! the machine has seen; then transitions are taken, one `match` ([`advance`]), until none is due. What the registers
//! shall say follows from the state ([`image`]) and is never edited by hand.

mod advance;
mod edges;
mod image;
mod machine;
mod request;
mod stroke;
mod sync;

pub use machine::{Config, Effect, Event, Handshake};

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
        told: bool,
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

/// A transition, by its number in the handshake's table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[rustfmt::skip]
pub enum Transition {
    /// Boot to offline.
    T1,
    /// Connected.
    T2,
    /// Another press or another map: off line again.
    T3,
    /// A second host writes to the press.
    T4,
    /// A result from before waits for the press.
    T5,
    /// A stroke waits since before the connection.
    T6,
    /// A restart interrupted the stroke.
    T7,
    /// Nothing waits: ready.
    T8,
    /// Not ready any more.
    T9,
    /// Ready again.
    T10,
    /// A stroke is accepted.
    T11,
    /// The press is clear, the scan starts.
    T12,
    /// The scan is taken.
    T13,
    /// The scan is given up.
    T14,
    /// There is a result.
    T15,
    /// There is none, and why.
    T16,
    /// The result stands in the registers.
    T17,
    /// The press has acknowledged.
    T18,
    /// The press has taken its acknowledge back.
    T19,
    /// The press has not acknowledged in time.
    T20,
    /// The connection is gone.
    T21,
    /// A fault.
    T22,
    /// The fault is reset.
    T23,
    /// Stopped.
    T24,
    /// The press's heartbeat stands still.
    T25,
    /// A stroke came while another was in hand.
    T26,
    /// The press wants a stroke scanned again.
    T27,
}
