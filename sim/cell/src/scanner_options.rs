//! Options of the scanner common to all commands, and one scan with them.

use crate::error::Error;
use clap::{Args, ValueEnum};
use platen_sim_plate::{Plate, PlateError, PlateState};
use platen_sim_scanner::{
    Cyclic, FileFormat, FileOrder, Instrument, Scene, SimLattice, SimScan, Surroundings, scan_all,
};
use std::path::Path;

/// Period of the cyclic range error, metres.
const CYCLIC_PERIOD: f64 = 1.2;

/// Object in front of the plate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Occluder {
    Nothing,
    Person,
    Chain,
    Both,
}

/// Options of the scanner.
#[derive(Debug, Clone, Args)]
pub(crate) struct ScannerOptions {
    /// Set the angle between cells, degrees
    #[arg(long, default_value_t = 0.05)]
    step_deg: f64,
    /// Scan this margin around the plate, degrees
    #[arg(long, default_value_t = 6.0)]
    pub(crate) margin_deg: f64,
    /// Set the standard deviation of a range at 10 m, millimetres; default: 0.5 in files, that of the requested rate in streams
    #[arg(long)]
    pub(crate) noise_mm: Option<f64>,
    /// Set the amplitude of the cyclic range error of period 1.2 m, millimetres
    #[arg(long, default_value_t = 0.0)]
    cyclic_mm: f64,
    /// Set the half width of the plate's specular lobe, in which echoes are lost, degrees; 0: mill scale, none
    #[arg(long, default_value_t = 0.0)]
    mirror_lobe_deg: f64,
    /// Set the seed of all errors
    #[arg(long, default_value_t = 1)]
    pub(crate) scan_seed: u64,
    /// Place an object between scanner and plate
    #[arg(long, value_enum, default_value_t = Occluder::Nothing)]
    hidden_by: Occluder,
}

/// Scan with its scene.
pub(crate) struct Capture {
    pub(crate) scene: Scene,
    pub(crate) scan: SimScan,
}

impl ScannerOptions {
    /// Returns the surroundings of the plate.
    pub(crate) fn surroundings(&self) -> Surroundings {
        let hides = |what| self.hidden_by == what || self.hidden_by == Occluder::Both;
        Surroundings {
            person_in_front: hides(Occluder::Person),
            chain: hides(Occluder::Chain),
            ..Surroundings::default()
        }
    }

    /// Returns the error model.
    pub(crate) fn instrument(&self) -> Instrument {
        Instrument {
            range_sigma: self.noise_mm.unwrap_or(0.5) * 1e-3,
            cyclic: (self.cyclic_mm > 0.0).then_some(Cyclic {
                amplitude: self.cyclic_mm * 1e-3,
                period: CYCLIC_PERIOD,
                phase: 0.0,
            }),
            specular_lobe: (self.mirror_lobe_deg > 0.0).then_some(self.mirror_lobe_deg.to_radians()),
            seed: self.scan_seed,
            ..Instrument::default()
        }
    }

    /// Takes a scan; `number` selects the noise of repeated scans.
    pub(crate) fn capture(&self, state: Option<&PlateState>, number: u64) -> Result<Capture, PlateError> {
        let plate = state.map(Plate::new).transpose()?;
        let lattice =
            SimLattice::of_plate(plate.as_ref(), self.margin_deg.to_radians(), self.step_deg.to_radians());
        let seed = self.scan_seed.wrapping_add(number << 32);
        let instrument = Instrument { seed, ..self.instrument() };
        let scene = Scene::new(plate, &self.surroundings());
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let columns = scan_all(&scene, &lattice, &instrument, threads);
        Ok(Capture { scene, scan: SimScan { lattice, columns } })
    }
}

impl Capture {
    /// Writes the scan in the format of the file's extension.
    pub(crate) fn write(&self, path: &Path) -> Result<(), Error> {
        let format = FileFormat::of(path).ok_or_else(|| Error::Format { path: path.into() })?;
        Ok(self.scan.write(path, format, FileOrder::default())?)
    }
}
