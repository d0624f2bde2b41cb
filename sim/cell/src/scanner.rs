//! Verb `scanner`: one scan of a plate into a file, or as many as are asked for over TCP.

use crate::error::Error;
use crate::{bridge, document, press};
use clap::{Args, ValueEnum};
use platen_sim_plate::{Plate, PlateError, PlateState};
use platen_sim_scanner::{
    CellCounts, Cyclic, FileFormat, FileOrder, Instrument, Scene, SimLattice, SimScan, Surroundings,
    scan_all, truth_document,
};
use std::path::{Path, PathBuf};

/// Period of the cyclic range error, metres.
const CYCLIC_PERIOD: f64 = 1.2;

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
    #[arg(long, value_enum, default_value_t = Hidden::Nothing)]
    hidden_by: Hidden,
}

/// One scan.
#[derive(Debug, Args)]
pub(crate) struct Command {
    /// Description of the plate: blank, shape, pose
    plate: Option<PathBuf>,
    /// File to write: .e57, .ptx, .xyz or .xyb
    #[arg(long, requires = "plate", required_unless_present = "serve", conflicts_with = "serve")]
    out: Option<PathBuf>,
    /// File for what a measurement should find, as JSON
    #[arg(long, requires = "out")]
    truth: Option<PathBuf>,
    #[command(flatten)]
    serve: bridge::Serve,
    /// Second port of a simulated press whose plate is scanned
    #[arg(long, value_name = "ADDRESS", requires = "serve", conflicts_with = "plate")]
    press: Option<String>,
    /// End when standard input closes
    #[arg(long, requires = "serve")]
    with_parent: bool,
    #[command(flatten)]
    device: Device,
}

/// A scan with all that is known of it.
pub(crate) struct Shot {
    scene: Scene,
    scan: SimScan,
}

impl Device {
    /// What stands round the plate.
    pub(crate) fn surroundings(&self) -> Surroundings {
        let hides = |what| self.hidden_by == what || self.hidden_by == Hidden::Both;
        Surroundings {
            person_in_front: hides(Hidden::Person),
            chain: hides(Hidden::Chain),
            ..Surroundings::default()
        }
    }

    /// Scans; `number` tells the noise of repeated scans apart.
    pub(crate) fn shot(&self, state: Option<&PlateState>, number: u64) -> Result<Shot, PlateError> {
        let plate = state.map(Plate::new).transpose()?;
        let lattice =
            SimLattice::of_plate(plate.as_ref(), self.margin_deg.to_radians(), self.step_deg.to_radians());
        let instrument = Instrument {
            range_sigma: self.noise_mm.unwrap_or(0.5) * 1e-3,
            cyclic: (self.cyclic_mm > 0.0).then_some(Cyclic {
                amplitude: self.cyclic_mm * 1e-3,
                period: CYCLIC_PERIOD,
                phase: 0.0,
            }),
            specular_lobe: (self.mirror_lobe_deg > 0.0).then_some(self.mirror_lobe_deg.to_radians()),
            seed: self.scan_seed.wrapping_add(number << 32),
            ..Instrument::default()
        };
        let scene = Scene::new(plate, &self.surroundings());
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

/// Scans once into a file, or serves scans until told to end.
pub(crate) async fn run(command: &Command) -> Result<(), Error> {
    match (&command.plate, &command.out) {
        (Some(plate), Some(out)) => write(command, plate, out),
        _ => serve(command).await,
    }
}

fn read(path: &Path) -> Result<PlateState, Error> {
    let state: PlateState = document::read(path)?;
    Plate::new(&state).map_err(|source| Error::Plate { path: path.into(), source })?;
    Ok(state)
}

async fn serve(command: &Command) -> Result<(), Error> {
    let plate = match &command.press {
        Some(press) => bridge::plate_of(press.clone()),
        None => bridge::one_plate(command.plate.as_deref().map(read).transpose()?),
    };
    if let Some(bridge) = command.serve.start(&command.device, plate)? {
        press::announce(None, Some(bridge.address()))?;
        press::told_to_end(command.with_parent).await?;
        bridge::report(&bridge)?;
    }
    Ok(())
}

fn write(command: &Command, plate: &Path, out: &Path) -> Result<(), Error> {
    if FileFormat::of(out).is_none() {
        return Err(Error::Format { path: out.into() });
    }
    let state = read(plate)?;
    let impossible = |source| Error::Plate { path: plate.into(), source };
    let shot = command.device.shot(Some(&state), 0).map_err(impossible)?;
    shot.write(out)?;
    if let Some(path) = &command.truth {
        let mut counts = CellCounts::default();
        shot.scan.columns.iter().for_each(|column| counts.add(column));
        let truth = truth_document(&state, &shot.scene, &counts);
        std::fs::write(path, format!("{truth:#}\n"))?;
    }
    Ok(())
}
