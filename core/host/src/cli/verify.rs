//! Command `platen verify`: offsets of dark discs painted on a plate from the markers of its plate file.

mod picture;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use platen_engine::pipeline::Pipeline;
use platen_engine::stroke::Baseline;
use platen_model::Marker;
use platen_model::units::{metres, mm};
use platen_plant::PlateFile;
use platen_report::output_folder;
use platen_shape::inspection::marker_detection::{DetectedMarker, NoMarker, detect_marker};

use super::setup::Setup;
use super::{CliError, Common, measure, output};
use crate::progress;

use serde::Serialize;

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  platen verify scan.e57 --plate painted.toml\n  \
                        platen verify scan.e57 --plate painted.toml --limit-mm 1.5 --picture verify.svg\n\n\
                        Paint dark discs of 30 to 60 mm on the plate, best before it is bent, and write their centres as [[marker]] into \
                        the plate file. Each disc is searched by its intensity near its virtual marker. The exit code is 1 when \
                        one is farther away than the limit or is not found.\n\n\
                        The centre of a disc of 40 mm is found to 0.9 mm (95 %) at 5 mm between cells and to 0.35 mm at 2.5 mm. \
                        Scan finer or paint larger discs for less.")]
pub(super) struct Command {
    /// Scan file: structured E57, PTX, XYZ with row and column, XYB
    scan: PathBuf,
    #[command(flatten)]
    setup: Setup,
    /// Radius round a marker in which its disc is searched
    #[arg(long, value_name = "MM", default_value_t = 80.0, value_parser = length)]
    within_mm: f64,
    /// Largest accepted distance of a disc from its marker
    #[arg(long, value_name = "MM", default_value_t = 3.0, value_parser = length)]
    limit_mm: f64,
    /// Draw the virtual lines and markers over the scan's intensities, from the scanner's place
    #[arg(long, value_name = "FILE.svg")]
    picture: Option<PathBuf>,
}

/// Radius in standard deviations of the circle that holds 95 % of errors in a plane: sqrt(-2 ln 0.05).
const IN_PLANE: f64 = 2.448;

/// Offsets of all discs, and whether they are within the limit.
#[derive(Debug, Serialize)]
struct Summary {
    plate: String,
    markers: Vec<MarkerRecord>,
    /// Mean over the discs found; null without any.
    mean_mm: Option<f64>,
    std_mm: Option<f64>,
    max_mm: Option<f64>,
    limit_mm: f64,
    within_limit: bool,
}

#[derive(Debug, Serialize)]
struct MarkerRecord {
    name: String,
    u_mm: f64,
    v_mm: f64,
    /// Disc minus marker along u and v; null where no disc was found.
    off_u_mm: Option<f64>,
    off_v_mm: Option<f64>,
    distance_mm: Option<f64>,
    /// Uncertainty of the disc's own centre from the spacing of the cells, radius of 95 %.
    known_to_mm: Option<f64>,
    /// Number of dark cells, or the reason why no disc was found.
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

    let surface = &measured.measurement.surface;
    let detect = |m: &Marker| detect_marker(&scanned.patch, surface, m.at, metres(command.within_mm));
    let discs: Vec<_> = plate.markers.iter().map(detect).collect();
    if let Some(file) = &command.picture {
        let drawn = picture::draw(&scanned.patch, &measured.measurement, &plate, &discs);
        let drawn = drawn.map_err(|e| CliError::Failed(format!("{}: {e}", file.display())))?;
        output_folder::replace(file, drawn.as_bytes())?;
    }
    let summary = summarize(command, &plate, &discs);
    if common.json {
        output::json(&summary)?
    } else {
        print(&summary)?
    }
    Ok(if summary.within_limit { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

fn summarize(command: &Command, plate: &PlateFile, discs: &[Result<DetectedMarker, NoMarker>]) -> Summary {
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
    Summary {
        plate: plate.plate.id.clone(),
        within_limit: distances.len() == markers.len() && max.is_some_and(|max| max <= command.limit_mm),
        markers,
        mean_mm: mean,
        std_mm: std,
        max_mm: max,
        limit_mm: command.limit_mm,
    }
}

fn print(summary: &Summary) -> Result<(), CliError> {
    let offset = |value: Option<f64>| value.map(|v| format!("{v:+.2}")).unwrap_or_default();
    let row = |marker: &MarkerRecord| {
        vec![
            marker.name.clone(),
            format!("{:.0}", marker.u_mm),
            format!("{:.0}", marker.v_mm),
            offset(marker.off_u_mm),
            offset(marker.off_v_mm),
            output::number(marker.distance_mm, 2),
            output::number(marker.known_to_mm, 2),
            marker.says.clone(),
        ]
    };
    output::titled(
        "marker | u mm | v mm | off along u | along v | distance mm | known to mm | disc",
        summary.markers.iter().map(row),
    )?;
    let n_found = summary.markers.iter().filter(|marker| marker.distance_mm.is_some()).count();
    output::line(&format!(
        "{n_found} of {} discs found: mean {} mm, std {} mm, largest {} mm, limit {:.1} mm: {}",
        summary.markers.len(),
        output::number(summary.mean_mm, 2),
        output::number(summary.std_mm, 2),
        output::number(summary.max_mm, 2),
        summary.limit_mm,
        if summary.within_limit { "within" } else { "outside" }
    ))
}

fn length(text: &str) -> Result<f64, String> {
    let length = text.parse::<f64>().ok().filter(|mm| mm.is_finite() && *mm > 0.0);
    length.ok_or_else(|| "give a length in millimetres, above 0".to_owned())
}
