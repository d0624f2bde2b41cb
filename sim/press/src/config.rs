//! Configuration of a simulated press, read from a TOML file.

use std::net::IpAddr;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::faults::{LineFaults, StrokeFaults};
use crate::forming_model::{PlateConfig, Strategy};
use crate::{Error, Result};

/// Configuration of a press. Every key has a default; an unknown key is an error.
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
    /// Map version of the P block; a host must not write when it is not 1.
    pub map_version: u16,
    /// Address of the P block.
    pub p_base: u16,
    /// Address of the H block.
    pub h_base: u16,
    /// Address of the 24 advice registers, which the program only displays.
    pub advice_base: Option<u16>,
    /// Modbus unit id.
    pub unit: u8,
    /// Link to the host.
    pub link: LinkConfig,
    /// Local address of both ports.
    pub bind: IpAddr,
    /// Control port; 0 lets the system choose.
    pub control_port: u16,
    /// Largest number of strokes per part.
    pub strokes: u32,
    /// Number of parts.
    pub parts: u32,
    /// Selection of the next bend.
    pub strategy: Strategy,
    /// Requests a baseline scan before the first stroke.
    pub baseline: bool,
    /// Starts strokes automatically; `false`: only on request.
    pub automatic: bool,
    /// Waits for the host's ready bit before a stroke.
    pub wait_ready: bool,
    /// Accepts results marked as simulated.
    pub take_simulated: bool,
    /// Number of the plate file.
    pub recipe_id: u16,
    /// Number of the first part.
    pub part_id: u32,
    /// Name of the part, 16 ASCII characters.
    pub part_name: String,
    /// Value of the stroke counter at the start.
    pub stroke_id: u16,
    /// Seed of sessions and faults.
    pub seed: u64,
    /// Durations.
    pub timings: Timings,
    /// Plate and forming programme.
    pub plate: PlateConfig,
    /// Faults of the line.
    pub line_faults: LineFaults,
    /// Faults of the PLC program.
    pub stroke_faults: StrokeFaults,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            press_id: 3,
            map_version: 1,
            p_base: 0,
            h_base: 100,
            advice_base: None,
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

/// Link between host and press.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum LinkConfig {
    /// Modbus TCP.
    Tcp {
        /// Port; 0 lets the system choose.
        #[serde(default)]
        port: u16,
    },
    /// RTU frames over a TCP connection, as forwarded by a serial device server.
    RtuOverTcp {
        /// Port; 0 lets the system choose.
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
    /// RTU on a pseudo terminal created by the press: a serial line without hardware. Cutting the connection simulates
    /// an adapter that is unplugged and returns under another name.
    Pty {
        /// Path of a symbolic link to the terminal, as in `/dev/serial/by-id`.
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

/// Durations of the press, in milliseconds.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct Timings {
    /// Cycle time of the controller.
    pub cycle_ms: u64,
    /// From the start of the program to the first action.
    pub start_ms: u64,
    /// Ram down.
    pub down_ms: u64,
    /// Ram up.
    pub up_ms: u64,
    /// From the end of a handshake to the next action.
    pub between_ms: u64,
    /// Time during which registers are 0 after a restart.
    pub restart_ms: u64,
    /// Interval of the press's heartbeat.
    pub heartbeat_ms: u64,
    /// Time without host heartbeat after which the host counts as dead.
    pub host_ms: u64,
    /// Time for acceptance, after which an alarm is raised.
    pub accept_ms: u64,
    /// Time for a result, after which the press continues without one.
    pub result_ms: u64,
    /// Delay from accepting a result to setting the acknowledge bit.
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
    /// Checks constraints beyond the types.
    ///
    /// # Errors
    /// [`Error::Config`] with the key and the limit.
    pub fn check(&self) -> Result<()> {
        let refuse = |key: &'static str, why: String| Err(Error::Config { key, why });
        let (p, h) = (u32::from(self.p_base), u32::from(self.h_base));
        if p < h + 64 && h < p + 32 {
            return refuse(
                "h_base",
                format!("the blocks at {p} and {h} overlap; reserve 32 words for P, 64 words for H"),
            );
        }
        if p.max(h) + 100 > 65_536 {
            return refuse(
                "p_base",
                format!("a block at {} exceeds the table of 65536 words; choose a lower address", p.max(h)),
            );
        }
        if let Some(a) = self.advice_base.map(u32::from)
            && ((a < p + 32 && p < a + 24) || (a < h + 64 && h < a + 24) || a + 24 > 65_536)
        {
            return refuse(
                "advice_base",
                format!("found {a}; 24 registers apart from both blocks are needed"),
            );
        }
        if self.timings.cycle_ms == 0 {
            return refuse("timings.cycle_ms", String::from("found 0; write at least 1 ms"));
        }
        let line = &self.line_faults;
        if !(0.0..=1.0).contains(&line.total()) {
            return refuse(
                "line_faults",
                format!("probabilities sum to {}; at most 1 is permitted", line.total()),
            );
        }
        if line.late_ms[0] > line.late_ms[1] {
            return refuse(
                "line_faults.late_ms",
                format!("{:?}: write the shortest delay first, then the longest", line.late_ms),
            );
        }
        Ok(())
    }
}
