//! Example of a scanner driver: a level floor, `height` metres below the scanner.

use platen_sdk::{
    Column, Face, Info, Job, Outcome, Result, ScanEnd, ScanHeader, ScanSink, Scanner, State, options,
};

options! {
    /// Options of `my-plugin`.
    pub struct Options {
        /// Height of the scanner over the floor.
        height: f64 = 2.0, unit "m", min 0.1, max 100.0;
    }
}

struct MyPlugin(Options);

const ROWS: u32 = 60;
const COLUMNS: u32 = 80;
const STEP: f64 = 0.01;
const TOP: f64 = -0.3;

impl Scanner for MyPlugin {
    const INFO: Info = Info::new(c"my-plugin", c"Plane scanner", c"Sees a level floor.", c"0.1.0")
        .by(c"an integrator", c"MIT");
    type Options = Options;

    fn new(options: Options) -> Result<Self> {
        Ok(Self(options))
    }

    fn capture(&mut self, job: &Job<'_>, out: &mut ScanSink<'_>) -> Result<()> {
        out.begin(&ScanHeader {
            n_rows: ROWS,
            n_columns: COLUMNS,
            azimuth_start: 0.0,
            azimuth_step: STEP,
            elevation_start: TOP,
            elevation_step: STEP,
            intensity_range: (0, 2047),
            ..ScanHeader::default()
        })?;
        let elevation: Vec<f64> = (0..ROWS).map(|row| TOP - STEP * f64::from(row)).collect();
        for index in 0..COLUMNS {
            job.check()?; // cancelled, or past the deadline
            out.column(&Column {
                index,
                face: Face::Front,
                first_row: 0,
                range_m: elevation.iter().map(|elevation| self.0.height / -elevation.sin()).collect(),
                azimuth: vec![STEP * f64::from(index); ROWS as usize],
                elevation: elevation.clone(),
                intensity: vec![1000; ROWS as usize],
                state: vec![State::Valid; ROWS as usize],
            })?;
        }
        out.end(&ScanEnd {
            columns: COLUMNS,
            points: u64::from(ROWS * COLUMNS),
            warm_up_columns: 0,
            outcome: Outcome::Complete,
        })
    }
}

platen_sdk::export!(scanner MyPlugin);
