//! Verb `scanner`: one scan of a described plate.

use crate::error::Error;
use crate::{document, truth};
use clap::{Args, ValueEnum};
use platen_sim_plate::{Plate, PlateError, PlateState};
use platen_sim_scanner::{
    FileFormat, FileOrder, Instrument, Scene, SimLattice, SimScan, Surroundings, scan_all,
};
use std::path::{Path, PathBuf};

/// What stands before the plate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Hidden {
    Nothing,
    Person,
    Chain,
    Both,
}

/// The scanner and its place.
#[derive(Debug, Clone, Args)]
pub(crate) struct Device {
    /// Angle between cells, degrees
    #[arg(long, default_value_t = 0.05)]
    step_deg: f64,
    /// What is scanned round the plate, degrees
    #[arg(long, default_value_t = 6.0)]
    margin_deg: f64,
    /// Standard deviation of a range at 10 m, millimetres
    #[arg(long, default_value_t = 0.5)]
    noise_mm: f64,
    /// Seed of all errors
    #[arg(long, default_value_t = 1)]
    scan_seed: u64,
    /// What stands between scanner and plate
    #[arg(long, value_enum, default_value_t = Hidden::Nothing)]
    hidden_by: Hidden,
}

/// One scan.
#[derive(Debug, Args)]
pub(crate) struct Command {
    /// Description of the plate: blank, shape, pose
    plate: PathBuf,
    /// File to write: .e57, .ptx, .xyz or .xyb
    #[arg(long)]
    out: PathBuf,
    /// File for what a measurement should find, as JSON
    #[arg(long)]
    truth: Option<PathBuf>,
    #[command(flatten)]
    device: Device,
}

/// A scan with all that is known of it.
pub(crate) struct Shot {
    scene: Scene,
    scan: SimScan,
}

impl Device {
    /// Scans; `number` tells the noise of repeated scans apart.
    pub(crate) fn shot(&self, state: Option<&PlateState>, number: u64) -> Result<Shot, PlateError> {
        let plate = state.map(Plate::new).transpose()?;
        let hides = |what| self.hidden_by == what || self.hidden_by == Hidden::Both;
        let around = Surroundings {
            person_in_front: hides(Hidden::Person),
            chain: hides(Hidden::Chain),
            ..Surroundings::default()
        };
        let lattice =
            SimLattice::of_plate(plate.as_ref(), self.margin_deg.to_radians(), self.step_deg.to_radians());
        let instrument = Instrument {
            range_sigma: self.noise_mm * 1e-3,
            seed: self.scan_seed.wrapping_add(number << 32),
            ..Instrument::default()
        };
        let scene = Scene::new(plate, &around);
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let columns = scan_all(&scene, &lattice, &instrument, threads);
        Ok(Shot { scene, scan: SimScan { lattice, columns } })
    }
}

impl Shot {
    /// Writes the scan in the format of the file's ending.
    pub(crate) fn write(&self, path: &Path) -> Result<(), Error> {
        let format = FileFormat::of(path).ok_or_else(|| Error::Format { path: path.into() })?;
        Ok(self.scan.write(path, format, FileOrder::default())?)
    }
}

/// Scans once.
pub(crate) fn run(command: &Command) -> Result<(), Error> {
    if FileFormat::of(&command.out).is_none() {
        return Err(Error::Format { path: command.out.clone() });
    }
    let state: PlateState = document::read(&command.plate)?;
    let impossible = |source| Error::Plate { path: command.plate.clone(), source };
    let shot = command.device.shot(Some(&state), 0).map_err(impossible)?;
    shot.write(&command.out)?;
    if let (Some(path), Some(plate)) = (&command.truth, shot.scene.plate()) {
        let truth = truth::document(&state, plate, &shot.scene, &shot.scan.columns);
        std::fs::write(path, format!("{truth:#}\n"))?;
    }
    Ok(())
}
