//! Scan bridge of `scanner --serve` and `cell --serve`.

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

/// Options of the bridge.
#[derive(Debug, Clone, Args)]
pub(crate) struct BridgeOptions {
    /// Serve scans on this address by the scan bridge protocol; port 0 lets the system choose
    #[arg(long, value_name = "ADDRESS")]
    pub(crate) serve: Option<SocketAddr>,
    /// Set the duration of a scan relative to a real scanner; 0: as fast as the computer allows
    #[arg(long, default_value_t = 0.0, requires = "serve")]
    time_scale: f64,
    /// Send columns only after the end of a scan, as the vendor's software does
    #[arg(long, requires = "serve")]
    after_the_fact: bool,
    /// Inject a fault, with a column, a share (one in n) or milliseconds: drop-mid-scan=17; an unknown name lists all faults
    #[arg(long = "fault", value_name = "NAME[=NUMBER]", requires = "serve")]
    faults: Vec<Fault>,
    /// Record the frames of every scan in this folder
    #[arg(long, value_name = "FOLDER", requires = "serve")]
    record: Option<PathBuf>,
    /// Replay a recording, whatever is requested
    #[arg(long, value_name = "FILE", requires = "serve")]
    pub(crate) replay: Option<PathBuf>,
    /// Scan the whole dome when no window is requested, instead of the plate and `--margin-deg` around it
    #[arg(long, requires = "serve")]
    dome: bool,
}

impl BridgeOptions {
    /// Starts the bridge if `--serve` is given.
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

/// Returns the plate of a press as a source, queried on the control port.
pub(crate) fn plate_of_press(press: String) -> PlateSource {
    Box::new(move || {
        ControlClient::open(&press).and_then(|mut line| line.plate()).map_err(|error| error.to_string())
    })
}

/// Returns a fixed plate as a source.
pub(crate) fn fixed_plate(state: Option<PlateState>) -> PlateSource {
    Box::new(move || Ok(state.clone()))
}

/// Prints the counters of the bridge in one line.
pub(crate) fn print_counters(bridge: &Bridge) -> Result<(), Error> {
    let line = serde_json::json!({ "bridge": bridge.counters() });
    let mut out = std::io::stdout().lock();
    writeln!(out, "{line}")?;
    out.flush()?;
    Ok(())
}
