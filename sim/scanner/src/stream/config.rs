//! How a bridge serves.

use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;

use super::fault::Fault;

/// How a bridge serves.
#[derive(Debug, Clone)]
pub struct BridgeConfig {
    /// Where it listens; port 0 lets the system choose.
    pub address: SocketAddr,
    /// Serial number of its scanner.
    pub serial: String,
    /// Columns are sent while the head turns. The vendor's software gives none before the scan's file is closed.
    pub live: bool,
    /// So many scans are kept.
    pub kept_scans: usize,
    /// Share of a real scanner's time that a scan takes; 0: no longer than the computer needs.
    pub time_scale: f64,
    /// Folder in which every scan is kept as a recording, `scan-NUMBER.psb`.
    pub record: Option<PathBuf>,
    /// What goes wrong.
    pub faults: Vec<Fault>,
    /// Seed of what goes wrong by chance.
    pub seed: u64,
}

impl Default for BridgeConfig {
    /// Loopback, live, in no time, without faults.
    fn default() -> Self {
        Self {
            address: (Ipv4Addr::LOCALHOST, 0).into(),
            serial: "SIM0001".to_owned(),
            live: true,
            kept_scans: 3,
            time_scale: 0.0,
            record: None,
            faults: Vec::new(),
            seed: 1,
        }
    }
}
