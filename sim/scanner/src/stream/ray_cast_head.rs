//! Simulated scanner in a press shop: the [`Head`] that casts rays.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::ops::{ControlFlow, Range};

use platen_sim_plate::{Plate, PlateState};

use crate::scan::scan_range;
use crate::{
    Device, Faces, INTENSITY_MAX, Instrument, LOWEST_DEG, Scene, SimColumn, SimLattice, Surroundings,
};

use super::head::{Head, Plan, Receiver};
use super::message::{ScanLayout, ScanSettings, Values, Window};
use super::payload::column_payload;

/// Distance of the seeds of consecutive scans, so that no two bridges with neighbouring seeds share a scan.
const SEED_STRIDE: u64 = 0x9E37_79B9_7F4A_7C15;

/// Computing time of one cell on one core, seconds.
const SECONDS_PER_CELL: f64 = 2e-6;

/// Columns of a face that are cast and delivered at a time.
const TURNS: u32 = 64;

/// Source of the plate's state: a plate, an empty press, or the reason why the state is unknown.
pub type PlateSource = Box<dyn Fn() -> Result<Option<PlateState>, String> + Send + Sync>;

/// Simulated scanner and the shop in which it stands.
pub struct RayCastHead {
    /// Source of the plate's state, queried at the start of each scan.
    pub plate: PlateSource,
    /// Surroundings of the plate.
    pub surroundings: Surroundings,
    /// Error model of the scanner. Its `range_sigma` is replaced by `noise`, or by the device's where `noise` is
    /// `None`; its seed is that of the first scan; its faces follow from the window.
    pub instrument: Instrument,
    /// Standard deviation of a range at 10 m, metres; `None`: that of the device at its rate and compression.
    pub noise: Option<f64>,
    /// Errors of scans that need both faces.
    pub faces: Option<Faces>,
    /// Margin around the plate when no window is requested, radians; `None`: the whole dome.
    pub margin: Option<f64>,
    /// Content of records.
    pub values: Values,
    /// Clockwise rotation of the head: columns are counted clockwise, and row 0 is at the bottom.
    pub mirrored: bool,
    /// Number of threads.
    pub threads: usize,
}

impl std::fmt::Debug for RayCastHead {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RayCastHead").field("instrument", &self.instrument).finish_non_exhaustive()
    }
}

impl RayCastHead {
    /// Creates a scanner with the errors of its device in front of this plate.
    pub fn new(plate: PlateSource) -> Self {
        Self {
            plate,
            surroundings: Surroundings::default(),
            instrument: Instrument { warm_up_columns: 10, ..Instrument::default() },
            noise: None,
            faces: None,
            margin: Some(6_f64.to_radians()),
            values: Values::Range,
            mirrored: false,
            threads: std::thread::available_parallelism().map_or(1, usize::from),
        }
    }

    fn lattice(&self, device: &Device, window: Option<&Window>, plate: Option<&Plate>) -> SimLattice {
        let step = device.step();
        match (window, self.margin) {
            (Some(w), _) => {
                let low = w.elevation_min.max(LOWEST_DEG.to_radians());
                let high = w.elevation_max.min(FRAC_PI_2);
                SimLattice::covering(w.azimuth_start, w.azimuth_width.min(TAU - step), low, high, step)
                    .on_encoder()
            }
            (None, Some(margin)) => SimLattice::of_plate(plate, margin, step),
            (None, None) => {
                let [n_rows, n_columns] = device.full_lattice();
                SimLattice {
                    azimuth_start: -PI,
                    azimuth_step: step,
                    n_columns,
                    elevation_start: FRAC_PI_2,
                    elevation_step: step,
                    n_rows,
                }
            }
        }
    }

    /// Returns the error model of a scan.
    fn instrument(&self, device: &Device, lattice: &SimLattice, number: u32) -> Instrument {
        // Half a turn of the head covers everything once; columns beyond are measured by the back face.
        let half = (PI / lattice.azimuth_step).round() as u32;
        let both = half < lattice.n_columns;
        let seam = |half| if self.mirrored { lattice.n_columns - half } else { half };
        let faces = self.faces.filter(|_| both).map(|faces| Faces { seam_column: seam(half), ..faces });
        Instrument {
            range_sigma: self.noise.unwrap_or_else(|| device.range_sigma()),
            faces,
            clockwise: self.mirrored,
            seed: self.instrument.seed.wrapping_add(u64::from(number).wrapping_mul(SEED_STRIDE)),
            ..self.instrument
        }
    }
}

fn device(settings: &ScanSettings) -> Result<Device, String> {
    Device::new(settings.divisor, settings.rate_kpts, settings.compression).map_err(|error| error.to_string())
}

/// Returns width and height of the scanned area, radians: of the window, of a plate's surroundings, or of the dome.
fn extent(settings: &ScanSettings, margin: Option<f64>) -> (f64, f64) {
    match (settings.window, margin) {
        (Some(window), _) => (window.azimuth_width, window.elevation_max - window.elevation_min),
        // A plate of 5 m at 5 m distance.
        (None, Some(margin)) => (1.0 + 2.0 * margin, 0.6 + 2.0 * margin),
        (None, None) => (TAU, FRAC_PI_2 - LOWEST_DEG.to_radians()),
    }
}

impl Head for RayCastHead {
    fn plan(&self, settings: &ScanSettings) -> Result<Plan, String> {
        let device = device(settings)?;
        if let Some(w) = &settings.window {
            let reached = w.elevation_max > LOWEST_DEG.to_radians() && w.elevation_max > w.elevation_min;
            if !(reached && w.azimuth_width > 0.0) {
                return Err("the window lies outside the scanner's elevations, -62.5 to 90 degrees".into());
            }
        }
        let (width, height) = extent(settings, self.margin);
        let computing_s = width * height / device.step().powi(2) * SECONDS_PER_CELL;
        let duration_s = device.duration_s(width);
        Ok(Plan { settings: *settings, duration_s, computing_s, altered: Vec::new() })
    }

    fn scan(&self, plan: &Plan, number: u32, out: &mut dyn Receiver) -> Result<(), String> {
        let device = device(&plan.settings)?;
        let plate = (self.plate)()?.map(|state| Plate::new(&state)).transpose().map_err(|e| e.to_string())?;
        let lattice = self.lattice(&device, plan.settings.window.as_ref(), plate.as_ref());
        let instrument = self.instrument(&device, &lattice, number);
        let mut begin = begin(&lattice, &instrument, self.values);
        begin.altered.clone_from(&plan.altered);
        if self.mirrored {
            mirror(&mut begin);
        }
        let scene = Scene::new(plate, &self.surroundings);
        let shot = PreparedScan { shop: self, device, scene, lattice, instrument, begin };
        // The receiver that breaks off records the reason.
        let _ = shot.take(out);
        Ok(())
    }
}

fn begin(lattice: &SimLattice, instrument: &Instrument, values: Values) -> ScanLayout {
    let order = if instrument.faces.is_some() { "time" } else { "azimuth" };
    ScanLayout {
        rows: lattice.n_rows,
        columns: lattice.n_columns,
        azimuth_start: lattice.azimuth_start,
        azimuth_step: lattice.azimuth_step,
        elevation_start: lattice.elevation_start,
        elevation_step: -lattice.elevation_step,
        values,
        range_unit_m: 1e-6,
        intensity: [0, INTENSITY_MAX],
        seam_column: instrument.faces.map(|faces| faces.seam_column),
        warm_up_columns: instrument.warm_up_columns,
        order: order.to_owned(),
        instrument: "platen simulated scanner".to_owned(),
        acquired_unix_s: None,
        range_error_m: Some(instrument.range_error()),
        simulated: true,
        altered: Vec::new(),
    }
}

/// Reverses the order of rows and columns of the lattice.
fn mirror(begin: &mut ScanLayout) {
    let last = |n: u32| f64::from(n - 1);
    begin.azimuth_start += begin.azimuth_step * last(begin.columns);
    begin.azimuth_step = -begin.azimuth_step;
    begin.elevation_start += begin.elevation_step * last(begin.rows);
    begin.elevation_step = -begin.elevation_step;
    begin.seam_column = begin.seam_column.map(|seam| begin.columns - seam);
}

/// Scan prepared to be taken.
struct PreparedScan<'a> {
    shop: &'a RayCastHead,
    device: Device,
    scene: Scene,
    lattice: SimLattice,
    instrument: Instrument,
    begin: ScanLayout,
}

impl PreparedScan<'_> {
    fn take(&self, out: &mut dyn Receiver) -> ControlFlow<()> {
        out.begin(self.begin.clone())?;
        let all = self.lattice.n_columns;
        let [front, back] = match (self.instrument.faces, self.instrument.clockwise) {
            (None, _) => [0..all, 0..0],
            (Some(faces), false) => [0..faces.seam_column, faces.seam_column..all],
            (Some(faces), true) => [faces.seam_column..all, 0..faces.seam_column],
        };
        // Each turn of the mirror writes a column of each face.
        let turns = front.len() as u32;
        for start in (0..turns).step_by(TURNS as usize) {
            let mut backs = self.turns(&back, start)?.into_iter();
            for column in self.turns(&front, start)? {
                self.deliver(column, turns, out)?;
                if let Some(back) = backs.next() {
                    self.deliver(back, turns, out)?;
                }
            }
        }
        ControlFlow::Continue(())
    }

    /// Returns the columns that one face measures in [`TURNS`] turns of the mirror, in the order of measurement.
    fn turns(&self, face: &Range<u32>, start: u32) -> ControlFlow<(), Vec<SimColumn>> {
        let n = face.len() as u32;
        let [start, end] = [start, start + TURNS].map(|turn| turn.min(n));
        let clockwise = self.instrument.clockwise;
        let range =
            if clockwise { face.end - end..face.end - start } else { face.start + start..face.start + end };
        let mut columns = Vec::new();
        scan_range(&self.scene, &self.lattice, &self.instrument, self.shop.threads, range, |column| {
            columns.push(column);
            ControlFlow::Continue(())
        })?;
        if clockwise {
            columns.reverse();
        }
        ControlFlow::Continue(columns)
    }

    /// Delivers a column; `turns` is the number of mirror turns of the scan.
    fn deliver(&self, mut column: SimColumn, turns: u32, out: &mut dyn Receiver) -> ControlFlow<()> {
        let mut number = column.index;
        if self.shop.mirrored {
            number = self.lattice.n_columns - 1 - number;
            column.range_m.reverse();
            column.azimuth.reverse();
            column.elevation.reverse();
            column.intensity.reverse();
            column.state.reverse();
        }
        let width = self.lattice.azimuth_step * f64::from(self.lattice.n_columns);
        let time_s = self.device.column_s(width, f64::from(number % turns) / f64::from(turns));
        out.column(column_payload(&column, number, &self.begin, time_s))
    }
}
