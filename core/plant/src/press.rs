//! Table `[press]` of the plant file: link, register map, write permissions, time limits and policy.

mod allow;
mod field;
mod link;
mod map;
mod names;
mod pph1;
mod read;

pub use allow::{Refused, WriteAllow};
pub use field::{RegisterField, RegisterPlace, RegisterType, WordOrder};
pub use link::{Link, Parity, Quiet, Serial, Socket, Transport};
pub use map::{AddressBase, Block, Counter, Profile, RegisterMap, RegisterTable};
pub use names::{Input, Output};
pub use pph1::{INVALID_I16, INVALID_U16, MAP_VERSION, STATIONS};

use std::time::Duration;

/// Press of a plant file.
#[derive(Debug, Clone, PartialEq)]
pub struct Press {
    /// Name for people.
    pub name: String,
    /// Plant number; compared with the press's register where the map has one, against the wrong controller.
    pub press_id: u16,
    /// Modbus role of the host.
    pub role: Role,
    /// Operating mode.
    pub mode: Mode,
    /// Connection to the press.
    pub link: Link,
    /// Registers that may be written.
    pub write: WriteAllow,
    /// Register map.
    pub map: RegisterMap,
    /// Time limits of the handshake.
    pub timeouts: Timeouts,
    /// Reaction to faults.
    pub policy: Policy,
    /// Registers for the advice, if it is written there.
    pub advice: Option<AdviceBlock>,
}

/// Registers for the advice on the next stroke: for a display, apart from the registers of the handshake.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AdviceBlock {
    /// Address of the first, as on the wire.
    pub start: u16,
    /// The depth of the ram is written, too.
    pub depth: bool,
}

impl AdviceBlock {
    /// Number of registers.
    pub const COUNT: u16 = 24;

    /// Returns the registers as a block.
    #[must_use]
    pub fn block(&self) -> Block {
        Block { table: RegisterTable::Holding, start: self.start, count: Self::COUNT }
    }
}

impl Press {
    /// Makes a press with the built-in map in mode `measure`, with every default.
    pub fn pph1(name: impl Into<String>, press_id: u16, link: Link) -> Self {
        let map = RegisterMap::pph1();
        Self {
            name: name.into(),
            press_id,
            role: Role::Client,
            mode: Mode::Measure,
            link,
            write: WriteAllow::block(&map.write),
            map,
            timeouts: Timeouts::default(),
            policy: Policy::default(),
            advice: None,
        }
    }
}

/// Modbus role of the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Role {
    /// The host is the client, the press the server.
    #[default]
    Client,
    /// The press is the client, the host the server: for controllers that have client blocks only.
    Server,
}

/// Operating mode of the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mode {
    /// No connection.
    Off,
    /// Reads and decodes; never writes, never scans.
    Listen,
    /// Scans and judges; writes are only logged.
    DryRun,
    /// The whole handshake with results marked as simulated.
    Simulate,
    /// Scans, judges and writes.
    #[default]
    Measure,
}

impl Mode {
    /// All modes with their names in the plant file.
    pub const ALL: [(&'static str, Self); 5] = [
        ("off", Self::Off),
        ("listen", Self::Listen),
        ("dry-run", Self::DryRun),
        ("simulate", Self::Simulate),
        ("measure", Self::Measure),
    ];

    /// Returns whether registers may be written.
    pub fn writes(self) -> bool {
        matches!(self, Self::Simulate | Self::Measure)
    }
}

/// Time limits of the handshake.
#[derive(Debug, Clone, PartialEq)]
pub struct Timeouts {
    /// Longest scan; `None`: the driver's own estimate times 1.5.
    pub scan: Option<Duration>,
    /// Longest evaluation.
    pub evaluate: Duration,
    /// Longest wait for the press's acknowledge.
    pub ack: Duration,
    /// Longest wait for the press to drop its acknowledge.
    pub clear: Duration,
    /// Time between two heartbeats of the host.
    pub heartbeat: Duration,
    /// Time after which a press whose heartbeat has not changed counts as dead.
    pub heartbeat_in: Duration,
}

impl Default for Timeouts {
    fn default() -> Self {
        Self {
            scan: None,
            evaluate: Duration::from_secs(10),
            ack: Duration::from_secs(5),
            clear: Duration::from_secs(2),
            heartbeat: Duration::from_millis(500),
            heartbeat_in: Duration::from_secs(2),
        }
    }
}

/// Reaction to faults.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Policy {
    /// A stroke came while another was being measured, or the stroke number jumped.
    pub on_missed_stroke: OnMissed,
    /// Results cannot be recorded.
    pub on_storage_full: OnStorageFull,
    /// The press does not acknowledge a result.
    pub no_ack: NoAck,
}

/// Consequence of a missed stroke, which is counted in any case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum OnMissed {
    /// A warning.
    #[default]
    Warn,
    /// An error until error_reset; measuring continues.
    Error,
    /// An error, and no stroke is accepted until error_reset.
    Block,
}

/// Operation while results cannot be recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum OnStorageFull {
    /// Results still go to the press, marked as not recorded.
    #[default]
    Degrade,
    /// No stroke is accepted.
    Stop,
}

/// Treatment of a result that the press does not acknowledge.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum NoAck {
    /// The result stays until the next stroke, which acknowledges it.
    #[default]
    NextStroke,
    /// No stroke is accepted until it is acknowledged.
    Hold,
}
