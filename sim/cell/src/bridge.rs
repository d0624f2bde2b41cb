//! Scans over TCP: the bridge that `scanner --serve` and `cell --serve` run.

use crate::control_client::ControlClient;
use crate::error::Error;
use crate::scanner_options::ScannerOptions;
use clap::Args;
use platen_sim_plate::PlateState;
use platen_sim_scanner::Instrument;
use platen_sim_scanner::stream::{Bridge, BridgeConfig, Fault, Head, PlateSource, RayCastHead, Recording};
use std::io::Write;
use std::net::SocketAddr;
use std::path::PathBuf;

/// Where and how scans are served.
#[derive(Debug, Clone, Args)]
pub(crate) struct BridgeOptions {
    /// BridgeOptions scans here by the scan bridge protocol; port 0 lets the system choose
    #[arg(long, value_name = "ADDRESS")]
    pub(crate) serve: Option<SocketAddr>,
    /// Share of a real scanner's time that a scan takes; 0: no longer than the computer needs
    #[arg(long, default_value_t = 0.0, requires = "serve")]
    time_scale: f64,
    /// Send columns only when a scan has ended, as the vendor's software does
    #[arg(long, requires = "serve")]
    after_the_fact: bool,
    /// What goes wrong, with a column, a share or milliseconds: drop-mid-scan=17; a wrong name lists them all
    #[arg(long = "fault", value_name = "NAME[=NUMBER]", requires = "serve")]
    faults: Vec<Fault>,
    /// Keep the frames of every scan in this folder
    #[arg(long, value_name = "FOLDER", requires = "serve")]
    record: Option<PathBuf>,
    /// BridgeOptions the scan of such a file, whatever is asked for
    #[arg(long, value_name = "FILE", requires = "serve")]
    pub(crate) replay: Option<PathBuf>,
    /// Without a window scan the whole dome, not the plate and `--margin-deg` round it
    #[arg(long, requires = "serve")]
    dome: bool,
}

impl BridgeOptions {
    /// Starts the bridge, when one is pending.
    pub(crate) fn start(&self, device: &ScannerOptions, plate: PlateSource) -> Result<Option<Bridge>, Error> {
        let Some(address) = self.serve else { return Ok(None) };
        let head: Box<dyn Head> = match &self.replay {
            Some(path) => Box::new(Recording::open(path)?),
            None => Box::new(self.ray_cast_head(device, plate)),
        };
        let config = BridgeConfig {
            address,
            live: !self.after_the_fact,
            time_scale: self.time_scale.max(0.0),
            record: self.record.clone(),
            faults: self.faults.clone(),
            seed: device.scan_seed,
            ..BridgeConfig::default()
        };
        Ok(Some(Bridge::start(config, head)?))
    }

    fn ray_cast_head(&self, device: &ScannerOptions, plate: PlateSource) -> RayCastHead {
        let head = RayCastHead::new(plate);
        let warm_up_columns = head.instrument.warm_up_columns;
        RayCastHead {
            surroundings: device.surroundings(),
            instrument: Instrument { warm_up_columns, ..device.instrument() },
            noise: device.noise_mm.map(|mm| mm * 1e-3),
            margin: (!self.dome).then(|| device.margin_deg.to_radians()),
            ..head
        }
    }
}

/// The plate of a press, asked on its second port.
pub(crate) fn plate_of_press(press: String) -> PlateSource {
    Box::new(move || {
        ControlClient::open(&press).and_then(|mut line| line.plate()).map_err(|error| error.to_string())
    })
}

/// Always the same plate.
pub(crate) fn fixed_plate(state: Option<PlateState>) -> PlateSource {
    Box::new(move || Ok(state.clone()))
}

/// Says in one line what the bridge has done.
pub(crate) fn print_counters(bridge: &Bridge) -> Result<(), Error> {
    let line = serde_json::json!({ "bridge": bridge.counters() });
    let mut out = std::io::stdout().lock();
    writeln!(out, "{line}")?;
    out.flush()?;
    Ok(())
}
