//! `platen verify`: dark discs painted on a plate against the markers that its plate file places there.

mod picture;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use platen_plant::PlateFile;
use platen_shape::inspection::marker_detection::{DetectedMarker, NoMarker, detect_marker};
use serde::Serialize;

use super::setup::Setup;
use super::{CliError, Common, measure, output};
use crate::progress;
use platen_engine::pipeline::Pipeline;
use platen_engine::stroke::Baseline;
use platen_model::units::{metres, mm};
use platen_report::output_folder;
use platen_shape::{Measured, Scanned};

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  platen verify scan.e57 --plate painted.toml\n  \
                        platen verify scan.e57 --plate painted.toml --limit-mm 1.5 --picture verify.svg\n\n\
                        Paint dark discs of 30 to 60 mm on the plate, best before it is bent, and write their middles as [[marker]] into \
                        the plate file. Each disc is looked for by its intensity near its virtual marker. The exit code is 1 when \
                        one is farther away than the limit or is not found.\n\n\
                        A disc is known to the rim that its cells show: 0.9 mm (95 %) for 40 mm at 5 mm between cells, 0.35 mm at \
                        2.5 mm. What is wanted better takes a finer scan or larger discs.")]
pub(super) struct Command {
    /// Scan file: structured E57, PTX, XYZ with row and column, XYB
    scan: PathBuf,
    #[command(flatten)]
    setup: Setup,
    /// How far from its marker a disc is looked for
    #[arg(long, value_name = "MM", default_value_t = 80.0, value_parser = length)]
    within_mm: f64,
    /// Largest distance of a disc from its marker
    #[arg(long, value_name = "MM", default_value_t = 3.0, value_parser = length)]
    limit_mm: f64,
    /// Picture of the virtual lines and markers over the intensities, as the scanner sees them
    #[arg(long, value_name = "FILE.svg")]
    picture: Option<PathBuf>,
}

/// Radius in standard deviations of the circle that holds 95 % of errors in a plane: sqrt(-2 ln 0.05).
const IN_PLANE: f64 = 2.448;

/// What was found.
#[derive(Debug, Serialize)]
struct Found {
    plate: String,
    markers: Vec<MarkerRecord>,
    /// Of the discs that were found; null when none was.
    mean_mm: Option<f64>,
    std_mm: Option<f64>,
    max_mm: Option<f64>,
    limit_mm: f64,
    within_limit: bool,
}

/// One marker and its disc.
#[derive(Debug, Serialize)]
struct MarkerRecord {
    name: String,
    u_mm: f64,
    v_mm: f64,
    /// Disc minus marker along u and v; null when it was not found.
    off_u_mm: Option<f64>,
    off_v_mm: Option<f64>,
    distance_mm: Option<f64>,
    /// What the cells' spacing leaves open of the disc's own place: 95 % of discs lie nearer.
    known_to_mm: Option<f64>,
    /// Dark cells of the disc, or why there is none.
    says: String,
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    let catalogue = common.catalogue();
    let (mut plant, plate) = command.setup.load()?;
    if plate.markers.is_empty() {
        let plate = command.setup.plate.display();
        return Err(CliError::Usage(format!(
            "{plate}: names no marker; add a [[marker]] for each painted disc"
        )));
    }
    plant.comparisons = Vec::new();
    let mut rig = Pipeline::of(&plant, &catalogue)?;
    let (scanned, measured) =
        measure::measure_file(&catalogue, &mut rig, &command.scan, &plate, None, Baseline::None)?;
    progress::done();

    let discs = look(command, &plate, &scanned, &measured);
    if let Some(file) = &command.picture {
        let drawn = picture::draw(&scanned.patch, &measured.measurement, &plate, &discs);
        let drawn = drawn.map_err(|e| CliError::Failed(format!("{}: {e}", file.display())))?;
        output_folder::replace(file, drawn.as_bytes())?;
    }
    let found = record(command, &plate, &discs);
    if common.json {
        output::json(&found)?
    } else {
        print(&found)?
    }
    Ok(if found.within_limit { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

fn look(
    command: &Command,
    plate: &PlateFile,
    scanned: &Scanned,
    measured: &Measured,
) -> Vec<Result<DetectedMarker, NoMarker>> {
    let reach = metres(command.within_mm);
    let surface = &measured.measurement.surface;
    plate.markers.iter().map(|marker| detect_marker(&scanned.patch, surface, marker.at, reach)).collect()
}

fn record(command: &Command, plate: &PlateFile, discs: &[Result<DetectedMarker, NoMarker>]) -> Found {
    let markers: Vec<MarkerRecord> = plate
        .markers
        .iter()
        .zip(discs)
        .map(|(marker, disc)| {
            let off = disc.ok().map(|disc| disc.offset.map(mm));
            MarkerRecord {
                name: marker.name.clone(),
                u_mm: mm(marker.at[0]),
                v_mm: mm(marker.at[1]),
                off_u_mm: off.map(|off| off[0]),
                off_v_mm: off.map(|off| off[1]),
                distance_mm: off.map(|[u, v]| u.hypot(v)),
                known_to_mm: disc.ok().map(|disc| IN_PLANE * mm(disc.sigma)),
                says: disc.map_or_else(|why| why.to_string(), |disc| format!("{} dark cells", disc.cells)),
            }
        })
        .collect();
    let distances: Vec<f64> = markers.iter().filter_map(|marker| marker.distance_mm).collect();
    let n = distances.len() as f64;
    let mean = (!distances.is_empty()).then(|| distances.iter().sum::<f64>() / n);
    let std = mean
        .filter(|_| n > 1.0)
        .map(|mean| (distances.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt());
    let max = distances.iter().copied().reduce(f64::max);
    Found {
        plate: plate.plate.id.clone(),
        within_limit: distances.len() == markers.len() && max.is_some_and(|max| max <= command.limit_mm),
        markers,
        mean_mm: mean,
        std_mm: std,
        max_mm: max,
        limit_mm: command.limit_mm,
    }
}

fn print(found: &Found) -> Result<(), CliError> {
    let head = ["marker", "u mm", "v mm", "off along u", "along v", "distance mm", "known to mm", "disc"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    let number =
        |value: Option<f64>, digits: usize| value.map(|v| format!("{v:.digits$}")).unwrap_or_default();
    for marker in &found.markers {
        rows.push(vec![
            marker.name.clone(),
            format!("{:.0}", marker.u_mm),
            format!("{:.0}", marker.v_mm),
            marker.off_u_mm.map(|v| format!("{v:+.2}")).unwrap_or_default(),
            marker.off_v_mm.map(|v| format!("{v:+.2}")).unwrap_or_default(),
            number(marker.distance_mm, 2),
            number(marker.known_to_mm, 2),
            marker.says.clone(),
        ]);
    }
    output::table(&rows)?;
    let there = found.markers.iter().filter(|marker| marker.distance_mm.is_some()).count();
    output::line(&format!(
        "{there} of {} discs found: mean {} mm, std {} mm, largest {} mm, limit {:.1} mm: {}",
        found.markers.len(),
        number(found.mean_mm, 2),
        number(found.std_mm, 2),
        number(found.max_mm, 2),
        found.limit_mm,
        if found.within_limit { "within" } else { "outside" }
    ))
}

fn length(text: &str) -> Result<f64, String> {
    let found = text.parse::<f64>().ok().filter(|mm| mm.is_finite() && *mm > 0.0);
    found.ok_or_else(|| "give a length in millimetres, above 0".to_owned())
}
