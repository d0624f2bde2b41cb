//! Command `platen inspect`: describes the content of a scan file and its orientation.

mod picture;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use platen_scan::{Column, ScanHeader, State};

use super::scan_source::{self, READ_LIMIT};
use super::{CliError, Common, output};
use picture::RangePicture;
use platen_formats::WriteError;

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  platen inspect scan.e57\n  platen inspect scan.ptx --picture scan.png\n\n\
                        The picture shows the scan as the scanner saw it: colour is distance, brightness the strength \
                        of the echo, black is where nothing came back."
)]
pub(super) struct Command {
    /// Scan file: structured E57, PTX, XYZ with row and column, XYB
    scan: PathBuf,
    /// Which scan of a file that holds several, from 1
    #[arg(long, value_name = "N")]
    cloud: Option<u32>,
    /// New file for a picture of the ranges
    #[arg(long, value_name = "OUT.png")]
    picture: Option<PathBuf>,
}

/// Counters of a pass over the columns.
#[derive(Debug, Default)]
struct Counts {
    columns: u32,
    valid: u64,
    direction_only: u64,
    nearest_m: f64,
    farthest_m: f64,
}

impl Counts {
    fn add(&mut self, column: &Column) {
        self.columns += 1;
        for (state, range) in column.state.iter().zip(&column.range_m) {
            match state {
                State::Valid => {
                    self.valid += 1;
                    self.nearest_m = self.nearest_m.min(*range);
                    self.farthest_m = self.farthest_m.max(*range);
                }
                State::DirectionOnly => self.direction_only += 1,
                State::NoReturn => {}
            }
        }
    }
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    if let Some(picture) = command.picture.as_ref().filter(|picture| picture.exists()) {
        return Err(WriteError::Exists(picture.clone()).into());
    }
    let scanner = scan_source::open(&common.catalogue(), &command.scan, command.cloud)?;
    let mut counts = Counts { nearest_m: f64::INFINITY, ..Counts::default() };
    let what = format!("reading {}", command.scan.display());
    let mut scan = scan_source::follow(&scanner, READ_LIMIT, None, &what, Some(&command.scan))?;
    let header = scan.header().clone();
    let mut picture = RangePicture::new(&header);
    for column in &mut scan {
        let column = column?;
        counts.add(&column);
        picture.add(&column);
    }
    scan.finish()?;
    if let Some(path) = &command.picture {
        let file = path.display();
        let failed =
            |e| CliError::Failed(format!("{file}: cannot be written: {e}; check the folder and its disk"));
        picture.write(path).map_err(failed)?;
    }
    if common.json {
        output::json(&json(&header, &counts))?;
    } else {
        print(&header, &counts)?;
        if let Some(path) = &command.picture {
            let (file, (width, height)) = (path.display(), picture.size());
            output::line(&format!(
                "wrote {file}: {width} x {height} pixels as the scanner saw it; dark violet is near, yellow far, black no echo"
            ))?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn json(header: &ScanHeader, counts: &Counts) -> serde_json::Value {
    serde_json::json!({
        "rows": header.n_rows, "columns": header.n_columns, "columns_sent": counts.columns,
        "valid": counts.valid, "direction_only": counts.direction_only,
        "azimuth_start_deg": header.azimuth_start.to_degrees(), "azimuth_step_deg": header.azimuth_step.to_degrees(),
        "elevation_start_deg": header.elevation_start.to_degrees(), "elevation_step_deg": header.elevation_step.to_degrees(),
        "seam_column": header.seam_column, "intensity": header.intensity_range, "instrument": header.instrument,
        "acquired_unix_s": header.acquired_unix_s, "simulated": header.simulated, "notes": header.notes,
        "range_m": (counts.valid > 0).then_some([counts.nearest_m, counts.farthest_m]),
    })
}

fn print(header: &ScanHeader, counts: &Counts) -> Result<(), CliError> {
    let cells = u64::from(header.n_rows) * u64::from(header.n_columns);
    let share = counts.valid as f64 / cells.max(1) as f64 * 100.0;
    output::line(&format!(
        "{} rows x {} columns, {} valid cells ({share:.0} %), range {:.2} to {:.2} m",
        header.n_rows, header.n_columns, counts.valid, counts.nearest_m, counts.farthest_m
    ))?;
    output::line(&format!(
        "columns from azimuth {:+.3} deg every {:.4} deg, rows from elevation {:+.3} deg down every {:.4} deg",
        header.azimuth_start.to_degrees(),
        header.azimuth_step.to_degrees(),
        header.elevation_start.to_degrees(),
        header.elevation_step.to_degrees()
    ))?;
    if counts.direction_only > 0 {
        output::line(&format!("{} cells of which only the direction is known", counts.direction_only))?;
    }
    let (low, high) = header.intensity_range;
    output::line(&format!("intensity {low} to {high}"))?;
    if let Some(seam) = header.seam_column {
        output::line(&format!("two faces: the other one begins at column {seam}"))?;
    }
    if !header.instrument.is_empty() {
        output::line(&format!("instrument: {}", header.instrument))?;
    }
    let acquired = header.acquired_unix_s.and_then(|time| jiff::Timestamp::from_second(time as i64).ok());
    if let Some(time) = acquired {
        output::line(&format!("scanned at {time}"))?;
    }
    if header.simulated {
        output::line("simulated: no real instrument stood there")?;
    }
    for note in &header.notes {
        output::line(&format!("  {note}"))?;
    }
    Ok(())
}
