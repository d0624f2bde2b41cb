//! What a simulated press is told at its start: one table of a TOML file.

use std::net::IpAddr;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::faults::{LineFaults, StrokeFaults};
use crate::forming_model::{PlateConfig, Strategy};
use crate::{Error, Result};

/// A press. Every key has a default; an unknown key is an error.
///
/// ```toml
/// press_id = 3
/// strokes = 12
/// strategy = "closed_loop"
/// seed = 7
/// [link]
/// type = "tcp"
/// port = 1502
/// [timings]
/// down_ms = 400
/// [line_faults]
/// late = 0.02
/// [stroke_faults]
/// bounce = 0.1
/// ```
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Plant number of the press.
    pub press_id: u16,
    /// Map version the press claims; anything but 1 must keep a host from writing.
    pub map_version: u16,
    /// Address of the P block.
    pub p_base: u16,
    /// Address of the H block.
    pub h_base: u16,
    /// Unit id it answers to.
    pub unit: u8,
    /// Where it listens for its host.
    pub link: LinkConfig,
    /// Address of both loopback ports.
    pub bind: IpAddr,
    /// Port of the plate's and the tests' lines; 0: the system chooses.
    pub control_port: u16,
    /// Strokes of one part, at most.
    pub strokes: u32,
    /// Parts pressed one after the other.
    pub parts: u32,
    /// How the next bend is chosen.
    pub strategy: Strategy,
    /// The host scans the blank before the first stroke.
    pub baseline: bool,
    /// Strokes come by themselves; `false`: only on request.
    pub automatic: bool,
    /// The press waits for the host's ready bit before a stroke.
    pub wait_ready: bool,
    /// Results marked as simulated are taken.
    pub take_simulated: bool,
    /// Number of the plate file.
    pub recipe_id: u16,
    /// Number of the first part.
    pub part_id: u32,
    /// Name of the part, 16 ASCII characters.
    pub part_name: String,
    /// Last stroke number before the first stroke.
    pub stroke_id: u16,
    /// Seed of sessions and faults.
    pub seed: u64,
    /// Times.
    pub timings: Timings,
    /// The plate and its bends.
    pub plate: PlateConfig,
    /// Faults of the line.
    pub line_faults: LineFaults,
    /// Faults of the controller's program.
    pub stroke_faults: StrokeFaults,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            press_id: 3,
            map_version: 1,
            p_base: 0,
            h_base: 100,
            unit: 1,
            link: LinkConfig::default(),
            bind: IpAddr::from([127, 0, 0, 1]),
            control_port: 0,
            strokes: 20,
            parts: 1,
            strategy: Strategy::default(),
            baseline: true,
            automatic: true,
            wait_ready: true,
            take_simulated: true,
            recipe_id: 17,
            part_id: 1,
            part_name: String::from("A17"),
            stroke_id: 0,
            seed: 1,
            timings: Timings::default(),
            plate: PlateConfig::default(),
            line_faults: LineFaults::default(),
            stroke_faults: StrokeFaults::default(),
        }
    }
}

/// How a host reaches the press.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum LinkConfig {
    /// Modbus TCP.
    Tcp {
        /// 0: the system chooses.
        #[serde(default)]
        port: u16,
    },
    /// RTU frames through a TCP connection, as a serial device server passes them.
    RtuOverTcp {
        /// 0: the system chooses.
        #[serde(default)]
        port: u16,
    },
    /// RTU on a serial line, 8 data bits, even parity, 1 stop bit.
    Rtu {
        /// Serial port or pseudo terminal.
        device: PathBuf,
        /// Bits per second.
        #[serde(default = "default_baud")]
        baud: u32,
    },
    /// RTU on a pseudo terminal that the press makes: a serial line without hardware. A connection that is cut is an
    /// adapter that is pulled and comes back under another name.
    Pty {
        /// A link to the terminal is put here, as `/dev/serial/by-id` has them.
        device: PathBuf,
    },
}

impl Default for LinkConfig {
    fn default() -> Self {
        Self::Tcp { port: 0 }
    }
}

fn default_baud() -> u32 {
    19_200
}

/// Times of the press, in milliseconds.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct Timings {
    /// One cycle of the controller.
    pub cycle_ms: u64,
    /// From the start of the program to the first action.
    pub start_ms: u64,
    /// Ram down.
    pub down_ms: u64,
    /// Ram up.
    pub up_ms: u64,
    /// From the end of one stroke's handshake to the next action.
    pub between_ms: u64,
    /// Registers are 0 for this long after a restart.
    pub restart_ms: u64,
    /// Own heartbeat.
    pub heartbeat_ms: u64,
    /// Host dead after this long without its heartbeat.
    pub host_ms: u64,
    /// Alarm when the host takes longer to accept.
    pub accept_ms: u64,
    /// The press goes on without a result after this long.
    pub result_ms: u64,
    /// From taking a result to raising the acknowledge bit.
    pub ack_ms: u64,
}

impl Default for Timings {
    fn default() -> Self {
        Self {
            cycle_ms: 5,
            start_ms: 0,
            down_ms: 200,
            up_ms: 200,
            between_ms: 100,
            restart_ms: 500,
            heartbeat_ms: 250,
            host_ms: 2_000,
            accept_ms: 500,
            result_ms: 180_000,
            ack_ms: 0,
        }
    }
}

impl Config {
    /// Checks what the types cannot say.
    ///
    /// # Errors
    /// [`Error::Config`] with the key and the limit.
    pub fn check(&self) -> Result<()> {
        let refuse = |key: &'static str, why: String| Err(Error::Config { key, why });
        let (p, h) = (u32::from(self.p_base), u32::from(self.h_base));
        if p < h + 64 && h < p + 32 {
            return refuse(
                "h_base",
                format!("the blocks at {p} and {h} overlap; keep 32 words for the first, 64 for the other"),
            );
        }
        if p.max(h) + 100 > 65_536 {
            return refuse("p_base", format!("a block at {} leaves the table of 65536 words", p.max(h)));
        }
        if self.timings.cycle_ms == 0 {
            return refuse("timings.cycle_ms", String::from("a cycle takes at least 1 ms"));
        }
        let line = &self.line_faults;
        if !(0.0..=1.0).contains(&line.total()) {
            return refuse("line_faults", format!("probabilities add up to {}, at most 1", line.total()));
        }
        if line.late_ms[0] > line.late_ms[1] {
            return refuse("line_faults.late_ms", format!("{:?} is not shortest, longest", line.late_ms));
        }
        Ok(())
    }
}
