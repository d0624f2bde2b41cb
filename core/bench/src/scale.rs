//! Time and memory of one measurement with streamed columns, from the scan of the tables to a full dome.
//!
//! Each lattice is measured in a process of its own. Its peak memory is that of one measurement and of the ray caster
//! in the same process.

use std::f64::consts::{PI, TAU};
use std::path::Path;
use std::time::Duration;

use clap::ValueEnum;
use platen_engine::plugin::{Catalogue, JobSpec};
use platen_host::cli::bench::{BenchArguments, Cells, QUARTER_DEG};
use platen_host::cli::{CliError, Common, output};
use platen_host::progress;
use platen_scan::{Column, Window};
use platen_shape::extract::Extractor;
use platen_shape::measure::measure;
use platen_shape::outline::outline;

use crate::scene::{SCAN_LIMIT, Setting};
use crate::stages::{self, ms};
use crate::{machine, tables};

use serde::{Deserialize, Serialize};
use serde_json::{Value as Json, json};

fn name(cells: Cells) -> String {
    cells.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default()
}

fn step_deg(cells: Cells) -> f64 {
    match cells {
        Cells::Quarter | Cells::Dome => QUARTER_DEG,
        Cells::Half => 0.5 * QUARTER_DEG,
    }
}

/// Returns the whole field of view for a dome; `None` for the plate and its surroundings.
fn window(cells: Cells) -> Option<Window> {
    let step = step_deg(cells).to_radians();
    (cells == Cells::Dome).then(|| Window {
        azimuth_start: -PI,
        azimuth_width: TAU - step,
        elevation_min: -PI,
        elevation_max: 0.5 * PI,
    })
}

/// Time and memory of one lattice.
#[derive(Debug, Serialize, Deserialize)]
struct Row {
    lattice: String,
    rows: u32,
    columns: u32,
    plate_points: usize,
    /// Time of extraction while columns arrive.
    columns_ms: f64,
    /// Time from the last column to the plate's face.
    extract_ms: f64,
    /// Time from the plate's face to S(u, v).
    measure_ms: f64,
    /// Size of all cells uncompressed.
    raw_lattice_mb: f64,
    /// Peak memory of the whole process.
    peak_mb: Option<f64>,
}

pub(super) fn scale(common: &Common, arguments: &BenchArguments) -> Result<Json, CliError> {
    let mut rows = Vec::new();
    for cells in &arguments.cells {
        progress::phase(&format!("scanning the lattice `{}`", name(*cells)));
        rows.push(match arguments.cells.len() {
            1 => here(&common.catalogue(), &arguments.out, arguments, *cells)?,
            _ => elsewhere(common, arguments, *cells)?,
        });
    }
    progress::done();
    if !common.json {
        print(&rows)?;
    }
    Ok(json!(rows))
}

/// Measures in a child process.
fn elsewhere(common: &Common, arguments: &BenchArguments, cells: Cells) -> Result<Row, CliError> {
    let failed = |what: String| CliError::Failed(format!("bench of the lattice `{}`: {what}", name(cells)));
    let mut child = std::process::Command::new(std::env::current_exe()?);
    child.args(["bench", "scale", "--json", "--cells", &name(cells)]);
    child.arg("--out").arg(arguments.out.join(name(cells)));
    child.args(["--seed", &arguments.seed.to_string(), "--threads", &arguments.threads.to_string()]);
    child.args(["--flattening", &arguments.flattening.join(",")]);
    if let Some(folder) = &common.plugins {
        child.arg("--plugins").arg(folder);
    }
    let output = child.stderr(std::process::Stdio::inherit()).output()?;
    if !output.status.success() {
        return Err(failed("failed, see above".into()));
    }
    let document: Json = serde_json::from_slice(&output.stdout).map_err(|e| failed(e.to_string()))?;
    let row = document.pointer("/scale/0").cloned().unwrap_or_default();
    serde_json::from_value(row).map_err(|e| failed(e.to_string()))
}

/// Measures in this process.
fn here(
    catalogue: &Catalogue,
    folder: &Path,
    arguments: &BenchArguments,
    cells: Cells,
) -> Result<Row, CliError> {
    let failed = |e: &dyn std::fmt::Display| CliError::Failed(format!("lattice `{}`: {e}", name(cells)));
    let scene = tables::scene();
    let setting = Setting {
        step_deg: step_deg(cells),
        margin_deg: tables::MARGIN_DEG,
        noise_mm: arguments.noise_mm.first().copied().unwrap_or(0.5),
        seed: arguments.seed,
        threads: arguments.threads,
    };
    let mut flattenings = stages::flattenings(catalogue, &arguments.flattening)?;
    let Some(flattening) = flattenings.first_mut() else {
        return Err(CliError::Usage("give at least one --flattening".into()));
    };
    let window = window(cells);
    let (spec, (scanner, _)) = (scene.spec(), scene.scanner(catalogue, folder, setting, &[])?);
    let mut scan = scanner.start(JobSpec::untriggered(SCAN_LIMIT), window.as_ref())?;
    let header = scan.header().clone();
    let mut extractor = Extractor::new(&header, &spec);
    let mut on_columns = Duration::ZERO;
    for column in &mut scan {
        let column = column?;
        let start = machine::thread_time();
        extractor.push(&column).map_err(|e| failed(&e))?;
        on_columns += machine::thread_time().saturating_sub(start);
    }
    scan.finish()?;
    drop(scan);
    // The scanner's memory does not belong to the measurement.
    drop(scanner);
    let start = machine::cpu_time();
    let patch = extractor.finish().map_err(|e| failed(&e))?;
    let extracted = machine::cpu_time();
    let outline = outline(&patch, &spec).map_err(|e| failed(&e))?;
    measure(&patch, &outline, &spec, &spec.rectangle(), flattening, &mut machine::cpu_time)
        .map_err(|e| failed(&e))?;
    let measured = machine::cpu_time();
    Ok(Row {
        lattice: name(cells),
        rows: header.n_rows,
        columns: header.n_columns,
        plate_points: patch.samples.len(),
        columns_ms: ms(on_columns),
        extract_ms: ms(extracted.saturating_sub(start)),
        measure_ms: ms(measured.saturating_sub(extracted)),
        raw_lattice_mb: f64::from(header.n_rows) * f64::from(header.n_columns) * Column::SAMPLE_BYTES as f64
            / f64::from(1 << 20),
        peak_mb: machine::peak_memory_mb(),
    })
}

fn print(rows: &[Row]) -> Result<(), CliError> {
    output::line("\nFrom a table scan to a full dome, columns streamed (CPU ms, MB)")?;
    let cells = |row: &Row| {
        let peak = row.peak_mb.map_or("-".to_owned(), |mb| format!("{mb:.0}"));
        let times = [row.columns_ms, row.extract_ms, row.measure_ms].map(|ms| format!("{ms:.0}"));
        let [columns, extract, measure] = times;
        let cells = format!("{} x {}", row.rows, row.columns);
        let plate = row.plate_points.to_string();
        let raw = format!("{:.0}", row.raw_lattice_mb);
        vec![row.lattice.clone(), cells, plate, columns, extract, measure, raw, peak]
    };
    output::titled(
        "lattice | cells | on the plate | columns ms | extract ms | measure ms | raw lattice MB | peak MB",
        rows.iter().map(cells),
    )?;
    output::line(
        "columns: while they arrive, parallel to the scanner; extract: from the last column to the plate's face; measure: from there to \
         S(u, v). Peak memory: of the whole process, ray caster included.",
    )
}
