//! The scanner of all verbs: its errors, its place, what stands before it; and one scan by it.

use crate::error::Error;
use clap::{Args, ValueEnum};
use platen_sim_plate::{Plate, PlateError, PlateState};
use platen_sim_scanner::{
    Cyclic, FileFormat, FileOrder, Instrument, Scene, SimLattice, SimScan, Surroundings, scan_all,
};
use std::path::Path;

/// Period of the cyclic range error, metres.
const CYCLIC_PERIOD: f64 = 1.2;

/// What stands before the plate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Occluder {
    Nothing,
    Person,
    Chain,
    Both,
}

/// The scanner and its place.
#[derive(Debug, Clone, Args)]
pub(crate) struct ScannerOptions {
    /// Angle between cells, degrees
    #[arg(long, default_value_t = 0.05)]
    step_deg: f64,
    /// What is scanned round the plate, degrees
    #[arg(long, default_value_t = 6.0)]
    pub(crate) margin_deg: f64,
    /// Standard deviation of a range at 10 m, millimetres; 0.5 in files, in streams that of the rate asked for
    #[arg(long)]
    pub(crate) noise_mm: Option<f64>,
    /// Amplitude of the cyclic range error of period 1.2 m, millimetres
    #[arg(long, default_value_t = 0.0)]
    cyclic_mm: f64,
    /// Half width of the plate's mirror lobe, in which echoes are lost, degrees; 0: mill scale, which has none
    #[arg(long, default_value_t = 0.0)]
    mirror_lobe_deg: f64,
    /// Seed of all errors
    #[arg(long, default_value_t = 1)]
    pub(crate) scan_seed: u64,
    /// What stands between scanner and plate
    #[arg(long, value_enum, default_value_t = Occluder::Nothing)]
    hidden_by: Occluder,
}

/// A scan with all that is known of it.
pub(crate) struct Capture {
    pub(crate) scene: Scene,
    pub(crate) scan: SimScan,
}

impl ScannerOptions {
    /// What stands round the plate.
    pub(crate) fn surroundings(&self) -> Surroundings {
        let hides = |what| self.hidden_by == what || self.hidden_by == Occluder::Both;
        Surroundings {
            person_in_front: hides(Occluder::Person),
            chain: hides(Occluder::Chain),
            ..Surroundings::default()
        }
    }

    /// Its errors.
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

    /// Scans; `number` tells the noise of repeated scans apart.
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
    /// Writes the scan in the format of the file's ending.
    pub(crate) fn write(&self, path: &Path) -> Result<(), Error> {
        let format = FileFormat::of(path).ok_or_else(|| Error::Format { path: path.into() })?;
        Ok(self.scan.write(path, format, FileOrder::default())?)
    }
}
