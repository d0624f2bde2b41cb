//! Time and memory from a table scan to a full dome, columns as they come.
//!
//! Each lattice is measured in a process of its own, whose largest memory is what one measurement needs, the ray caster in
//! the same process included.

use std::f64::consts::{PI, TAU};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

use clap::ValueEnum;
use platen_scan::{Column, Window};
use platen_shape::extract::Extractor;
use platen_shape::measure::measure;
use platen_shape::outline::outline;
use serde::{Deserialize, Serialize};
use serde_json::{Value as Json, json};

use crate::bench::Command;
use crate::scene::Setting;
use crate::stages::ms;
use crate::{bench, machine, tables};
use platen_engine::plugin::Catalogue;
use platen_host::cli::{CliError, Common, output};
use platen_host::progress;

/// A lattice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Cells {
    /// 1.6 million: the plate and what is round it, at a quarter of the finest resolution
    Quarter,
    /// 6.4 million: the same at half the step
    Half,
    /// 44 million: everything that a scanner sees, at quarter resolution
    Dome,
}

impl Cells {
    fn name(self) -> String {
        self.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default()
    }

    fn step_deg(self) -> f64 {
        match self {
            Self::Quarter | Self::Dome => tables::QUARTER_DEG,
            Self::Half => 0.5 * tables::QUARTER_DEG,
        }
    }

    /// All round, from the scanner's own feet to the zenith; `None` for the plate and what is round it.
    fn window(self) -> Option<Window> {
        let step = self.step_deg().to_radians();
        (self == Self::Dome).then(|| Window {
            azimuth_start: -PI,
            azimuth_width: TAU - step,
            elevation_min: -PI,
            elevation_max: 0.5 * PI,
        })
    }
}

/// What one lattice took.
#[derive(Debug, Serialize, Deserialize)]
struct Row {
    lattice: String,
    rows: u32,
    columns: u32,
    plate_points: usize,
    /// On columns while they arrive.
    columns_ms: f64,
    /// From the last column to the plate's face.
    extract_ms: f64,
    /// From the plate's face to S(u, v).
    measure_ms: f64,
    /// Cells times the bytes of one sample of a column.
    raw_lattice_mb: f64,
    /// Largest memory of the whole process.
    peak_mb: Option<f64>,
}

pub(super) fn scale(common: &Common, command: &Command) -> Result<Json, CliError> {
    let mut rows = Vec::new();
    for cells in &command.cells {
        progress::phase(&format!("scanning the lattice `{}`", cells.name()));
        rows.push(match command.cells.len() {
            1 => here(&common.catalogue(), &command.out, command, *cells)?,
            _ => elsewhere(common, command, *cells)?,
        });
    }
    progress::done();
    if !common.json {
        print(&rows)?;
    }
    Ok(json!(rows))
}

/// Measures in a process of its own.
fn elsewhere(common: &Common, command: &Command, cells: Cells) -> Result<Row, CliError> {
    let failed = |what: String| CliError::Failed(format!("bench of the lattice `{}`: {what}", cells.name()));
    let mut child = std::process::Command::new(std::env::current_exe()?);
    child.args(["bench", "scale", "--json", "--cells", &cells.name()]);
    child.arg("--out").arg(command.out.join(cells.name()));
    child.args(["--seed", &command.seed.to_string(), "--threads", &command.threads.to_string()]);
    child.args(["--flattening", &command.flattening.join(",")]);
    if let Some(folder) = &common.plugins {
        child.arg("--plugins").arg(folder);
    }
    let output = child.stderr(std::process::Stdio::inherit()).output()?;
    if !output.status.success() {
        return Err(failed("it failed, see above".into()));
    }
    let document: Json = serde_json::from_slice(&output.stdout).map_err(|e| failed(e.to_string()))?;
    let row = document.pointer("/scale/0").cloned().unwrap_or_default();
    serde_json::from_value(row).map_err(|e| failed(e.to_string()))
}

/// Measures in this process.
fn here(catalogue: &Catalogue, folder: &Path, command: &Command, cells: Cells) -> Result<Row, CliError> {
    let failed = |e: &dyn std::fmt::Display| CliError::Failed(format!("lattice `{}`: {e}", cells.name()));
    let scene = tables::scene();
    let setting = Setting {
        step_deg: cells.step_deg(),
        margin_deg: tables::MARGIN_DEG,
        noise_mm: command.noise_mm.first().copied().unwrap_or(0.5),
        seed: command.seed,
        threads: command.threads,
    };
    let mut flattenings = bench::flattenings(catalogue, &command.flattening)?;
    let Some(flattening) = flattenings.first_mut() else {
        return Err(CliError::Usage("give at least one --flattening".into()));
    };
    let window = cells.window();
    let mut on_columns = Duration::ZERO;
    let mut wrong = None;
    let push = |extractor: &mut Extractor, column: &Column| {
        let start = machine::thread_time();
        let pushed = extractor.push(column);
        on_columns += machine::thread_time().saturating_sub(start);
        match pushed {
            Ok(()) => ControlFlow::Continue(()),
            Err(error) => {
                wrong = Some(error);
                ControlFlow::Break(())
            }
        }
    };
    let streamed = scene.stream(catalogue, folder, setting, window.as_ref(), push);
    if let Some(error) = wrong {
        return Err(failed(&error));
    }
    let (header, spec, extractor) = streamed?;
    let start = machine::cpu_time();
    let patch = extractor.finish().map_err(|e| failed(&e))?;
    let extracted = machine::cpu_time();
    let outline = outline(&patch, &spec).map_err(|e| failed(&e))?;
    measure(&patch, &outline, &spec, &spec.rectangle(), flattening, &mut machine::cpu_time)
        .map_err(|e| failed(&e))?;
    let measured = machine::cpu_time();
    Ok(Row {
        lattice: cells.name(),
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
    output::line("\nFrom a table scan to a full dome, columns as they come (CPU ms, MB)")?;
    let head = [
        "lattice",
        "cells",
        "on the plate",
        "columns ms",
        "extract ms",
        "measure ms",
        "raw lattice MB",
        "peak MB",
    ];
    let mut table = vec![head.map(str::to_owned).to_vec()];
    for row in rows {
        let peak = row.peak_mb.map_or("-".to_owned(), |mb| format!("{mb:.0}"));
        let times = [row.columns_ms, row.extract_ms, row.measure_ms].map(|ms| format!("{ms:.0}"));
        let [columns, extract, measure] = times;
        let cells = format!("{} x {}", row.rows, row.columns);
        let plate = row.plate_points.to_string();
        let raw = format!("{:.0}", row.raw_lattice_mb);
        table.push(vec![row.lattice.clone(), cells, plate, columns, extract, measure, raw, peak]);
    }
    output::table(&table)?;
    output::line(
        "columns: spent while they arrive, beside the scanner; extract: from the last column to the plate's face; measure: from there to \
         S(u, v). Peak memory: of the whole process, the ray caster included.",
    )
}
