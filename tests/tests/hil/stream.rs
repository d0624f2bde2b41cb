//! Reference bridge of the simulator, and the real driver library loaded by the host's loader, over a real socket.

use std::net::SocketAddr;
use std::time::Duration;

use platen_engine::pipeline;
use platen_engine::plugin::{Catalogue, JobSpec, PluginError, Scanner};
use platen_plant::PlantFile;
use platen_scan::{Lattice, ScanEnd, Window};
use platen_sim_plate::{PlateState, Shape};
use platen_sim_scanner::stream::{Bridge, BridgeConfig, RayCastHead};

/// Longest scan for which a test waits; only a fault takes this long.
pub(crate) const LIMIT: Duration = Duration::from_secs(60);

/// Returns a bent plate of the size of recipe 9.
pub(crate) fn plate() -> PlateState {
    let shape = Shape::Cylinder { radius_mm: 9018.0, axis_deg: 90.0 };
    PlateState { shape, ..PlateState::flat(3000.0, 2500.0, 36.0) }
}

/// Returns a scanner before that plate.
pub(crate) fn head() -> RayCastHead {
    RayCastHead { threads: 2, ..RayCastHead::new(Box::new(|| Ok(Some(plate())))) }
}

/// Returns a bridge with these faults and a fixed seed.
pub(crate) fn bridge(faults: &[&str]) -> Bridge {
    start(faults, BridgeConfig::default(), head())
}

pub(crate) fn start(faults: &[&str], config: BridgeConfig, head: RayCastHead) -> Bridge {
    let faults = faults.iter().map(|fault| fault.parse().unwrap()).collect();
    Bridge::start(BridgeConfig { faults, ..config }, Box::new(head)).unwrap()
}

/// Returns the driver as specified in a plant file; `options` are further lines.
pub(crate) fn driver(address: SocketAddr, options: &str) -> Scanner {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("plant.toml");
    let text = format!(
        "[plant]\nname = \"test\"\n[scanner]\nplugin = \"faro-stream\"\n\
         [scanner.options]\naddress = \"{address}\"\n{options}\n"
    );
    std::fs::write(&file, text).unwrap();
    let plant = PlantFile::load(&file).unwrap();
    pipeline::scanner(&plant, &Catalogue::new(Some(platen_tests::built()))).unwrap()
}

/// 31 x 32 cells on the plate, at the coarsest resolution.
pub(crate) const COARSE: &str = "divisor = 32\nrate_kpts = 122";
pub(crate) const WINDOW: Window =
    Window { azimuth_start: -0.075, azimuth_width: 0.15, elevation_min: -0.65, elevation_max: -0.5 };

/// Returns one scan with every column in its place, or the reason why there is none.
pub(crate) fn scan(
    scanner: &Scanner,
    window: Option<&Window>,
    limit: Duration,
) -> Result<(Lattice, ScanEnd), PluginError> {
    let mut scan = scanner.start(JobSpec::untriggered(limit), window)?;
    let mut lattice = Lattice::new(scan.header().clone());
    for column in &mut scan {
        lattice.push(&column?).unwrap();
    }
    Ok((lattice, scan.finish()?))
}

/// Returns the whole content of a scan, so that two scans can be compared to the last bit.
pub(crate) fn cells(lattice: &Lattice) -> Vec<(Option<u64>, Option<[u64; 2]>, u16)> {
    let direction = |cell| lattice.direction(cell).map(|d| [d.azimuth.to_bits(), d.elevation.to_bits()]);
    (0..lattice.n_columns() * lattice.n_rows())
        .map(|cell| (lattice.range(cell).map(f64::to_bits), direction(cell), lattice.intensity(cell)))
        .collect()
}
