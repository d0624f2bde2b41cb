//! Result document of one measurement, schema `platen.result/1`.
//!
//! Lengths for people are in millimetres, named `_mm`; positions in metres in the scanner frame, named `_m`; angles in
//! degrees, named `_deg`; curvatures in 1/m, named `_per_m`; times in milliseconds. Grids are row-major, v outer, u
//! inner. Unknown values are null, never 0. Uncertainties are expanded (95 %) unless named sigma. Inside the program
//! units are metres and radians.

mod checks;
mod clock;
mod fields;
mod grid;
mod lines;
mod next;
mod outline;
mod plate;
mod plugins;
mod trim;

pub use checks::{CheckRecord, EdgeRecord, ShapeChecksRecord};
pub use clock::ClockRecord;
pub use grid::GridRecord;
pub use lines::{LineRecord, PointRecord, TemplateRecord};
pub use next::{CURVATURE_DEFICIT, Next, NextPlace, NoNext};
pub use outline::{OutlineRecord, OutlineSource};
pub use plate::PlateRecord;
pub use plugins::PluginRecord;
pub use trim::{TrimLineRecord, TrimPointRecord};

use std::fmt::Display;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value as Json, json};

use platen_model::units::{mm, mm_pair, readable};
use platen_model::{Figure, Report, Task, Verdict};
use platen_plant::PlateFile;
use platen_shape::evaluate::{self, Place};
use platen_shape::{
    Blank, CUT_ERROR, Corner, EXPANDED, EdgeDoubt, Measured, RangeError, Scanned, ShapeChecks, Vec3,
    corners_seen, edge_doubts,
};

/// Version of the document.
pub const SCHEMA: &str = "platen.result/1";

/// One measurement.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ResultRecord {
    /// [`SCHEMA`].
    pub schema: String,
    /// Program and version that measured.
    pub software: String,
    /// Name of the plate.
    pub plate: String,
    /// Stroke, where there is one.
    pub stroke: Option<u64>,
    /// Verdict on the plate.
    pub verdict: Verdict,
    /// Sentences for the operator, most important first.
    pub says: Vec<String>,
    /// Supports of the plate.
    pub supports: Option<String>,
    /// Plate file at this stroke.
    pub plate_file: PlateRecord,
    /// Outline to which (u, v) refer; null in documents older than the baseline outline, which refer to the rectangle.
    #[serde(default)]
    pub outline: Option<OutlineRecord>,
    /// Calibration of the scanner.
    pub calibration: CalibrationRecord,
    /// Clock of the host; null without a host, where the system does not report it, and in documents older than this
    /// field.
    #[serde(default)]
    pub clock: Option<ClockRecord>,
    /// Scan.
    pub scan: ScanRecord,
    /// Corners (0,0), (W,0), (W,H), (0,H) on the scanned face, scanner frame.
    pub corners_m: [[f64; 3]; 4],
    /// Expanded uncertainty (95 %) of each corner, all directions together; null in documents older than it.
    #[serde(default)]
    pub corners_uncertainty_mm: Option<[f64; 4]>,
    /// Whether each corner was seen; false where it was extrapolated, where its uncertainty along an edge exceeds 2 mm,
    /// or where the length of an adjacent edge differs from the length that was cut.
    pub corners_seen: [bool; 4],
    /// Markers.
    pub markers: Vec<MarkerRecord>,
    /// Lines along which the formed plate is cut; none in documents older than it.
    #[serde(default)]
    pub trim_lines: Vec<TrimLineRecord>,
    /// Dimension checks, as by tape, square and sight line.
    pub shape_checks: ShapeChecksRecord,
    /// Reference lines and the templates on them.
    pub reference_lines: Vec<LineRecord>,
    /// Curvatures, positions and fields on an even grid.
    pub grid: GridRecord,
    /// S(u, v), the mid-surface.
    pub surface: SurfaceRecord,
    /// Findings of each comparison.
    pub comparisons: Vec<Json>,
    /// Place of the next hit; null in documents older than it.
    #[serde(default)]
    pub next: Option<Next>,
    /// Quality of the measurement.
    pub quality: QualityRecord,
    /// Plugins that took part; none in documents older than it.
    #[serde(default)]
    pub plugins: Vec<PluginRecord>,
    /// Time of each stage.
    pub timings_ms: TimingsRecord,
}

/// Calibration of the scanner at this measurement.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct CalibrationRecord {
    /// Correlated part of the level of detection, one sigma: from null pairs, else from the assumed range error.
    pub sigma_correlated_mm: f64,
    /// Systematic uncertainty against a known artefact, one sigma; null if none was measured.
    pub sigma_true_mm: Option<f64>,
    /// Range error used in place of a calibration, as a sentence; null with a calibration, and in documents older than
    /// this field.
    #[serde(default)]
    pub assumption: Option<String>,
}

/// Scan behind a measurement.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ScanRecord {
    /// Rows of the lattice.
    pub rows: u32,
    /// Columns of the lattice.
    pub columns: u32,
    /// Valid cells.
    pub valid: u64,
    /// Cells on the plate's scanned face.
    pub plate_points: usize,
    /// Maker, model, serial number.
    pub instrument: String,
    /// Range error of the instrument's data sheet as stated by the driver, one sigma; null if it states none.
    #[serde(default)]
    pub range_error_mm: Option<f64>,
    /// Whether the scan is simulated.
    pub simulated: bool,
    /// Notes of the driver on its decisions and corrections.
    pub notes: Vec<String>,
}

/// Marker with its measured position.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct MarkerRecord {
    /// Name.
    pub name: String,
    /// Along u.
    pub u_mm: f64,
    /// Along v.
    pub v_mm: f64,
    /// On the scanned face, scanner frame.
    pub position_m: [f64; 3],
    /// Expanded uncertainty (95 %), all directions together.
    pub uncertainty_mm: f64,
    /// False where the surface is interpolated across unseen area.
    pub seen: bool,
}

/// Spline S(u, v) of the mid-surface.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SurfaceRecord {
    /// Degree of the spline.
    pub degree: u32,
    /// Knots along u, metres.
    pub knots_u: Vec<f64>,
    /// Knots along v, metres.
    pub knots_v: Vec<f64>,
    /// Control points, one list a row of constant v.
    pub control_m: Vec<Vec<[f64; 3]>>,
    /// Root mean square distance of the samples from the surface.
    pub rms_mm: f64,
}

/// Quality of a measurement.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct QualityRecord {
    /// Share of the plate that was seen.
    pub coverage: f64,
    /// Range noise, one sigma, from the scan itself.
    pub noise_mm: f64,
    /// Mean distance of neighbouring samples.
    pub lattice_step_mm: f64,
    /// Root mean square membrane strain that is explained by the plate's double curvature.
    #[serde(default)]
    pub membrane_strain: Option<f64>,
    /// Largest distance between the chart's material points and those of an elastic membrane; included in the
    /// uncertainty of markers.
    #[serde(default)]
    pub chart_misplaced_mm: Option<f64>,
}

/// Time of each stage, milliseconds.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct TimingsRecord {
    /// Time from the start to the last column; extraction runs in parallel.
    pub acquire: f64,
    /// Time from the last column to the plate's face.
    pub extract: f64,
    /// Boundary loop, corners, edges.
    pub outline: f64,
    /// Smooth face, mid-surface, mesh.
    pub mesh: f64,
    /// Flattening.
    pub flatten: f64,
    /// S(u, v) and its covariance.
    pub surface: f64,
    /// All comparisons.
    pub compare: f64,
    /// Time from the last column to the verdict.
    pub total: f64,
}

/// Circumstances of a measurement: plate file, task, stroke, verdict, comparisons.
#[derive(Debug, Clone, Copy)]
pub struct Context<'a, E> {
    /// Plate file.
    pub plate: &'a PlateFile,
    /// Task of the comparisons.
    pub task: &'a Task,
    /// Range error used in place of a calibration, as a sentence.
    pub assumption: Option<&'a str>,
    /// Calibrated range error of the scanner in positions and lengths; none without a calibration.
    pub range_error: RangeError,
    /// Edges whose lengths are not explained.
    pub doubts: &'a [EdgeDoubt],
    /// Origin of the press in the scanner frame, where the plant file places it.
    pub press: Option<Vec3>,
    /// Stroke, where there is one.
    pub stroke: Option<u64>,
    /// Verdict on the plate.
    pub verdict: Verdict,
    /// Reports of the comparisons.
    pub reports: &'a [Result<Report, E>],
    /// Time of the comparisons.
    pub compare: std::time::Duration,
}

impl ResultRecord {
    /// Assembles the document of a measurement.
    pub fn new<E: Display>(scanned: &Scanned, measured: &Measured, context: Context<'_, E>) -> Self {
        let Measured { outline, measurement, .. } = measured;
        let checks = ShapeChecks::new(outline, &measurement.surface, context.range_error);
        let doubts = context.doubts;
        let sound: Vec<&Report> = context.reports.iter().filter_map(|report| report.as_ref().ok()).collect();
        Self {
            schema: SCHEMA.to_owned(),
            software: concat!("platen ", env!("CARGO_PKG_VERSION")).to_owned(),
            plate: context.plate.plate.id.clone(),
            stroke: context.stroke,
            verdict: context.verdict,
            says: sentences(context.reports)
                .into_iter()
                .chain(doubts.iter().map(doubt_sentence))
                .chain(outline.corners.iter().zip(checks::CORNERS).filter_map(corner_sentence))
                .chain(bevel_sentence(context.plate.plate.face_inset))
                .chain(context.assumption.map(str::to_owned))
                .collect(),
            supports: context.plate.plate.supports.clone(),
            plate_file: PlateRecord::new(context.plate, &measurement.surface, context.press),
            outline: Some(OutlineRecord::new(
                measured.blank.as_ref(),
                [context.plate.plate.width, context.plate.plate.height],
            )),
            calibration: CalibrationRecord {
                sigma_correlated_mm: mm(context.task.sigma_correlated),
                sigma_true_mm: context.task.sigma_true.map(mm),
                assumption: context.assumption.map(str::to_owned),
            },
            clock: None,
            scan: ScanRecord {
                rows: scanned.header.n_rows,
                columns: scanned.header.n_columns,
                valid: scanned.n_valid,
                plate_points: scanned.patch.samples.len(),
                instrument: scanned.header.instrument.clone(),
                range_error_mm: scanned.header.range_error_m.map(mm),
                simulated: scanned.header.simulated,
                notes: scanned.header.notes.clone(),
            },
            corners_m: measurement.corners.map(Into::into),
            corners_uncertainty_mm: Some(corner_uncertainties(measured, context.range_error)),
            corners_seen: corners_seen(outline, doubts),
            shape_checks: ShapeChecksRecord::new(&checks),
            markers: markers(measured, context.plate, context.range_error),
            trim_lines: trim::record(measurement, context.plate),
            reference_lines: lines::record(measurement, context.plate, &sound),
            grid: GridRecord::new(measurement, &sound),
            surface: surface(measured),
            comparisons: context.reports.iter().map(comparison).collect(),
            next: Some(Next::new(&sound, context.plate, context.verdict)),
            quality: QualityRecord {
                coverage: measurement.quality.coverage,
                noise_mm: mm(measurement.quality.noise),
                lattice_step_mm: mm(measurement.quality.lattice_step),
                membrane_strain: Some(measurement.misplacement.explained),
                chart_misplaced_mm: Some(mm(measurement.misplacement.largest())),
            },
            plugins: Vec::new(),
            timings_ms: timings(scanned, measured, context.compare),
        }
    }

    /// Adds the plugins that took part, and a sentence for each plugin whose job was repeated.
    pub fn name_plugins(&mut self, plugins: Vec<PluginRecord>) {
        let repeated = plugins.iter().filter(|plugin| plugin.retried);
        self.says.extend(
            repeated.map(|p| format!("{} failed once; this is its result in a fresh process", p.plugin)),
        );
        self.plugins = plugins;
    }

    /// Returns the extent of the plate along u and v, millimetres.
    pub fn extent_mm(&self) -> (f64, f64) {
        // Three knots lie beyond each end.
        let end =
            |knots: &[f64]| knots.len().checked_sub(4).and_then(|k| knots.get(k)).map_or(0.0, |x| mm(*x));
        (end(&self.surface.knots_u), end(&self.surface.knots_v))
    }
}

fn sentences<E: Display>(reports: &[Result<Report, E>]) -> Vec<String> {
    let mut says = Vec::new();
    for report in reports {
        match report {
            Ok(report) => says.extend(report.findings.says.iter().cloned()),
            Err(error) => says.push(format!("comparison failed: {error}")),
        }
    }
    if !reports.iter().flatten().any(|report| report.findings.verdict.is_some()) {
        says.push("nothing judged this plate: give it a [target] and a [[template]], or add a comparison that judges".into());
    }
    says
}

/// Returns the edges whose lengths differ from the lengths that were cut by more than is explained. The intervals
/// contain the uncertainty of locating the edges, which is in doubt here, and not the scanner's range error.
#[must_use]
pub fn doubts(measured: &Measured, plate: &PlateFile) -> Vec<EdgeDoubt> {
    let surface = &measured.measurement.surface;
    let ordered = Blank::rectangle(plate.plate.width, plate.plate.height);
    let cut = measured.blank.as_ref().unwrap_or(&ordered).face_edge_lengths(plate.plate.face_inset);
    edge_doubts(&ShapeChecks::new(&measured.outline, surface, RangeError::default()), surface, cut)
}

/// Returns the sentence on the lengths of a bevelled plate, `None` if its edges are square.
fn bevel_sentence(face_inset: f64) -> Option<String> {
    (face_inset > 0.0).then(|| {
        format!(
            "bevelled edges: edges, diagonals and angles are those of the scanned face, {:.1} mm inside of the plate's edges",
            mm(face_inset)
        )
    })
}

fn doubt_sentence(doubt: &EdgeDoubt) -> String {
    let EdgeDoubt { edge, length, sigma, cut } = *doubt;
    let (longer, by) = (if length > cut { "longer" } else { "shorter" }, mm((length - cut).abs()));
    format!(
        "the {} is {:.1} +- {:.1} mm long, {by:.1} mm {longer} than the plate file or the baseline says: it was located \
         wrongly, or cut otherwise; places along it may be off by as much",
        checks::EDGES[edge],
        mm(length),
        mm(EXPANDED * sigma),
    )
}

/// Returns the sentence on a corner that counts as not seen because its uncertainty exceeds the error of a cut.
fn corner_sentence((corner, name): (&Corner, &str)) -> Option<String> {
    (corner.seen && corner.uncertainty() > CUT_ERROR).then(|| {
        format!(
            "the corner {name} is located to +- {:.1} mm only: the samples of its edges lie too far apart; scan with \
             smaller steps, or from a place that sees its edges less obliquely",
            mm(corner.uncertainty())
        )
    })
}

/// Returns the expanded uncertainties of the corners: along their edges from the outline, along the normal from the
/// surface, along the beam from the scanner.
fn corner_uncertainties(measured: &Measured, range_error: RangeError) -> [f64; 4] {
    let surface = &measured.measurement.surface;
    let (w, h) = (surface.width(), surface.height());
    let places = [[0.0, 0.0], [w, 0.0], [w, h], [0.0, h]];
    std::array::from_fn(|k| {
        let [u, v] = places[k];
        let [leaving, arriving] = measured.outline.corners[k].sigma;
        let edges = leaving.hypot(arriving);
        mm(EXPANDED * edges.hypot(surface.sigma_point(u, v)).hypot(range_error.sigma()))
    })
}

fn markers(measured: &Measured, plate: &PlateFile, range_error: RangeError) -> Vec<MarkerRecord> {
    let location = measured.measurement.location.clone().with_range_error(range_error);
    let record = |marker: &platen_model::Marker| {
        let Place { u, v, position, sigma, seen } =
            evaluate::place(&measured.measurement.surface, &location, marker.at[0], marker.at[1]);
        let all = sigma.iter().map(|s| s * s).sum::<f64>().sqrt();
        MarkerRecord {
            name: marker.name.clone(),
            u_mm: mm(u),
            v_mm: mm(v),
            position_m: position.into(),
            uncertainty_mm: mm(EXPANDED * all),
            seen,
        }
    };
    plate.markers.iter().map(record).collect()
}

fn surface(measured: &Measured) -> SurfaceRecord {
    let parts = measured.measurement.surface.to_parts();
    // A bicubic spline over n knots has n - 4 control points in that direction.
    let n_u = parts.knots_u.len().saturating_sub(4).max(1);
    SurfaceRecord {
        degree: 3,
        control_m: parts.control.chunks(n_u).map(<[_]>::to_vec).collect(),
        knots_u: parts.knots_u,
        knots_v: parts.knots_v,
        rms_mm: mm(measured.measurement.quality.rms),
    }
}

fn comparison<E: Display>(report: &Result<Report, E>) -> Json {
    match report {
        Ok(report) => json!({
            "plugin": report.comparison,
            "verdict": report.findings.verdict,
            "says": report.findings.says,
            "figures": report.findings.figures.iter().map(figure).collect::<Vec<_>>(),
        }),
        Err(error) => json!({ "verdict": Verdict::CannotTell, "error": error.to_string() }),
    }
}

/// Converts a figure to JSON, lengths in millimetres.
pub fn figure(figure: &Figure) -> Json {
    let (suffix, factor) = readable(&figure.unit);
    let mut record = Map::new();
    record.insert("name".into(), json!(figure.name));
    record.insert(format!("value{suffix}"), json!(figure.value * factor));
    if suffix.is_empty() && figure.unit != "1" {
        record.insert("unit".into(), json!(figure.unit));
    }
    if let Some(uncertainty) = figure.uncertainty {
        record.insert(format!("uncertainty{suffix}"), json!(uncertainty * factor));
    }
    if let Some(at) = figure.at {
        record.insert("at_mm".into(), json!(mm_pair(at)));
    }
    Json::Object(record)
}

fn timings(scanned: &Scanned, measured: &Measured, compare: std::time::Duration) -> TimingsRecord {
    let ms = |time: std::time::Duration| (time.as_secs_f64() * 1e6).round() / 1e3;
    let stages = measured.measurement.timings;
    let extract = scanned.extract;
    TimingsRecord {
        acquire: ms(scanned.acquire),
        extract: ms(extract),
        outline: ms(measured.outline_time),
        mesh: ms(stages.mesh),
        flatten: ms(stages.flatten),
        surface: ms(stages.surface),
        compare: ms(compare),
        total: ms(extract + measured.outline_time + stages.mesh + stages.flatten + stages.surface + compare),
    }
}
