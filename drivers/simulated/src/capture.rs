//! Simulated scan, from the plate's state to delivered columns.

use crate::Options;
use crate::error::Error;
use crate::pace::Pace;
use platen_scan::{Column, Face, Outcome, ScanEnd, ScanHeader, State, Window};
use platen_sdk::{Result, ScanReceiver};
use platen_sim_plate::{Plate, PlateState};
use platen_sim_scanner::{
    Beam, CellCounts, Cyclic, Faces, INTENSITY_MAX, Instrument, LOWEST_DEG, Scene, SimColumn, SimLattice,
    SimState, Surroundings, WideErrors, scan, truth_document,
};
use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Instant;

/// Period of the cyclic range error, metres.
const CYCLIC_PERIOD: f64 = 1.2;

/// Distance of the seeds of consecutive scans, so that no two runs with neighbouring seeds share a scan.
const SEED_STRIDE: u64 = 0x9E37_79B9_7F4A_7C15;

/// Computing time of one cell on one core, seconds.
const SECONDS_PER_CELL: f64 = 2e-6;

/// Scan that is prepared but not yet taken.
#[derive(Debug)]
pub(crate) struct PreparedScan {
    scene: Scene,
    lattice: SimLattice,
    instrument: Instrument,
    threads: usize,
    pace: Option<Pace>,
    note: String,
    truth: Option<Truth>,
}

/// Destination of the ground truth, and the plate.
#[derive(Debug)]
struct Truth {
    path: PathBuf,
    state: PlateState,
}

impl PreparedScan {
    /// Prepares the `number`-th scan of a run, of a plate or an empty press; without a window, of the plate and its
    /// margin.
    pub(crate) fn new(
        options: &Options,
        state: Option<PlateState>,
        window: Option<&Window>,
        number: u64,
    ) -> std::result::Result<Self, Error> {
        let note = match &state {
            Some(state) => format!("simulated plate ({}), {} strokes", state.shape.name(), state.strokes),
            None => "simulated press without a plate".to_owned(),
        };
        let plate = state.as_ref().map(Plate::new).transpose()?;
        let lattice = lattice(options, plate.as_ref(), window)?;
        let surroundings = surroundings(options, plate.as_ref());
        Ok(Self {
            scene: Scene::new(plate, &surroundings).with_plate_reflectivity(options.plate_reflectivity),
            lattice,
            pace: Pace::new(options, width(&lattice))?,
            instrument: instrument(options, &lattice, number),
            threads: threads(options),
            note,
            truth: options.truth_file.clone().zip(state).map(|(path, state)| Truth { path, state }),
        })
    }

    /// Takes the scan and delivers it to `out`.
    pub(crate) fn take(&self, out: &mut impl ScanReceiver) -> Result<()> {
        let started = Instant::now();
        out.begin(&self.header())?;
        let (mut points, mut counts) = (0, CellCounts::default());
        let mut failed = None;
        let ended = scan(&self.scene, &self.lattice, &self.instrument, self.threads, |column| {
            let done = f64::from(column.index + 1) / f64::from(self.lattice.n_columns);
            points += column.state.iter().filter(|state| **state == SimState::Valid).count() as u64;
            counts.add(&column);
            match self.deliver(column, started, done, out) {
                Ok(()) => ControlFlow::Continue(()),
                Err(error) => {
                    failed = Some(error);
                    ControlFlow::Break(())
                }
            }
        });
        if let (ControlFlow::Break(()), Some(error)) = (ended, failed) {
            return Err(error);
        }
        if let Some(pace) = &self.pace {
            pace.wait_for_end(started, || progress(out, 1.0))?;
        }
        if let Some(truth) = &self.truth {
            let document = truth_document(&truth.state, &self.scene, &counts);
            std::fs::write(&truth.path, document.to_string())
                .map_err(|source| Error::Truth { path: truth.path.clone(), source })?;
        }
        out.end(&ScanEnd {
            columns: self.lattice.n_columns,
            points,
            warm_up_columns: self.instrument.warm_up_columns,
            outcome: Outcome::Complete,
        })
    }

    /// Delivers a column when it is due.
    fn deliver(
        &self,
        column: SimColumn,
        started: Instant,
        done: f64,
        out: &mut impl ScanReceiver,
    ) -> Result<()> {
        if let Some(pace) = &self.pace {
            pace.wait_for_column(started, done, || progress(out, done))?;
        }
        out.column(&converted(column))?;
        progress(out, done)
    }

    fn seam(&self) -> Option<u32> {
        let seam = self.instrument.faces?.seam_column;
        (seam < self.lattice.n_columns).then_some(seam)
    }

    fn header(&self) -> ScanHeader {
        ScanHeader {
            n_rows: self.lattice.n_rows,
            n_columns: self.lattice.n_columns,
            azimuth_start: self.lattice.azimuth_start,
            azimuth_step: self.lattice.azimuth_step,
            elevation_start: self.lattice.elevation_start,
            elevation_step: self.lattice.elevation_step,
            seam_column: self.seam(),
            intensity_range: (0, INTENSITY_MAX),
            simulated: true,
            instrument: "platen simulated scanner".to_owned(),
            acquired_unix_s: None,
            range_error_m: Some(self.instrument.range_error()),
            notes: vec![self.note.clone(), format!("seed {}", self.instrument.seed)],
        }
    }
}

/// Returns the estimated duration of a scan, seconds; `None` when the options are invalid.
pub(crate) fn estimate_s(options: &Options, window: Option<&Window>) -> Option<f64> {
    let step = options.step_deg.to_radians();
    // Without a window: a plate of 5 m at 5 m distance.
    let (width, height) = window.map_or((1.0, 1.0), |w| (w.azimuth_width, w.elevation_max - w.elevation_min));
    let computing = 1.0 + width * height / (step * step) * SECONDS_PER_CELL;
    let pace = Pace::new(options, width).ok()?;
    Some(pace.map_or(computing, |pace| pace.duration_s().max(computing)))
}

fn width(lattice: &SimLattice) -> f64 {
    lattice.azimuth_step * f64::from(lattice.n_columns)
}

fn lattice(
    options: &Options,
    plate: Option<&Plate>,
    window: Option<&Window>,
) -> std::result::Result<SimLattice, Error> {
    let step = options.step_deg.to_radians();
    let Some(w) = window else {
        return Ok(SimLattice::of_plate(plate, options.margin_deg.to_radians(), step));
    };
    let (low, high) = (w.elevation_min.max(LOWEST_DEG.to_radians()), w.elevation_max.min(FRAC_PI_2));
    if high <= low {
        return Err(Error::Options(
            "the window lies outside the scanner's elevations, -62.5 to 90 degrees".into(),
        ));
    }
    Ok(SimLattice::covering(w.azimuth_start, w.azimuth_width, low, high, step).on_encoder())
}

/// Smallest distance between the plate and the wall behind the press, metres.
const BEHIND_PLATE: f64 = 2.0;

fn surroundings(options: &Options, plate: Option<&Plate>) -> Surroundings {
    let height = options.scanner_m.as_ref().and_then(|position| position.get(2)).unwrap_or(&0.0);
    let all = Surroundings::default();
    let hides = |what: &str| options.hidden_by == what || options.hidden_by == "both";
    let corners = plate.map(|plate| plate.corners().map(|corner| corner.x)).into_iter().flatten();
    Surroundings {
        floor: all.floor - height,
        wall: corners.map(|x| x + BEHIND_PLATE).fold(all.wall, f64::max),
        person_in_front: hides("person"),
        person_at_corner: options.hidden_by == "person at corner",
        chain: hides("chain"),
        strip: (options.strip_deg > 0.0).then(|| options.strip_deg.to_radians()),
        ..all
    }
}

fn instrument(options: &Options, lattice: &SimLattice, number: u64) -> Instrument {
    let cyclic = Cyclic { amplitude: options.cyclic_mm * 1e-3, period: CYCLIC_PERIOD, phase: 0.0 };
    let wide_errors = WideErrors { share: options.wide_share, factor: options.wide_factor };
    Instrument {
        range_sigma: options.noise_mm * 1e-3,
        tail_dof: options.tail_dof,
        wide_errors: (options.wide_share > 0.0).then_some(wide_errors),
        footprint: options.footprint_mrad * 1e-3,
        beam: match options.beam.as_str() {
            "winged" => Beam::Winged,
            "few rays" => Beam::FewRays,
            _ => Beam::Truncated,
        },
        angular_sigma: options.angular_noise_urad * 1e-6,
        dropout: options.dropout,
        cyclic: (options.cyclic_mm > 0.0).then_some(cyclic),
        faces: options.back_face_from_deg.map(|azimuth_deg| faces(options, lattice, azimuth_deg)),
        warm_up_columns: u32::try_from(options.warm_up_columns).unwrap_or(0),
        seed: options.seed.unsigned_abs().wrapping_add(number.wrapping_mul(SEED_STRIDE)),
        ..Instrument::default()
    }
}

/// Returns the two faces, the back face starting at an azimuth. A seam outside the window leaves one face.
fn faces(options: &Options, lattice: &SimLattice, azimuth_deg: f64) -> Faces {
    let ahead = (azimuth_deg.to_radians() - lattice.azimuth_start).rem_euclid(TAU);
    let seam_column = (ahead / lattice.azimuth_step).ceil() as u32;
    Faces { seam_column, collimation: options.collimation_urad * 1e-6, trunnion: 0.0, moved: [0.0; 3] }
}

fn threads(options: &Options) -> usize {
    match usize::try_from(options.threads) {
        Ok(0) | Err(_) => std::thread::available_parallelism().map_or(1, usize::from),
        Ok(n) => n,
    }
}

/// Converts a column to that of the plugin interface. The direction of a lost echo is known.
fn converted(column: SimColumn) -> Column {
    let state = |state: &SimState| match state {
        SimState::Valid => State::Valid,
        SimState::NoEcho => State::DirectionOnly,
    };
    Column {
        index: column.index,
        face: if column.back_face { Face::Back } else { Face::Front },
        first_row: 0,
        state: column.state.iter().map(state).collect(),
        range_m: column.range_m.into_iter().map(f64::from).collect(),
        azimuth: column.azimuth,
        elevation: column.elevation,
        intensity: column.intensity,
    }
}

fn progress(out: &impl ScanReceiver, done: f64) -> Result<()> {
    out.progress(done, "scanning");
    out.check()
}
