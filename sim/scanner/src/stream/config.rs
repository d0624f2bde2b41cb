//! Configuration of a bridge.

use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;

use super::fault::Fault;

/// Configuration of a bridge.
#[derive(Debug, Clone)]
pub struct BridgeConfig {
    /// Address of the port; port 0 lets the system choose.
    pub address: SocketAddr,
    /// Serial number of the scanner.
    pub serial: String,
    /// Columns are sent while the head rotates. The vendor's software delivers none before the scan's file is closed.
    pub live: bool,
    /// Number of scans kept for Resume.
    pub kept_scans: usize,
    /// Duration of a scan relative to a real scanner; 0: as fast as the computer allows.
    pub time_scale: f64,
    /// Folder in which every scan is recorded as `scan-NUMBER.psb`.
    pub record: Option<PathBuf>,
    /// Injected faults.
    pub faults: Vec<Fault>,
    /// Seed of random faults.
    pub seed: u64,
}

impl Default for BridgeConfig {
    /// Returns a bridge on loopback, live, at full speed, without faults.
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
