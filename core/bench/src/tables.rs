//! Benchmark tables: tables 1 to 4 of Masuda et al., "Point-based shape monitoring of plate bending for large-scale
//! storage tanks", on a simulated scan of the same size.
//!
//! The published times were measured on an Intel i7 at 3.07 GHz; the times beside them are processor time of this
//! machine.

use std::path::Path;
use std::time::Duration;

use platen_engine::plugin::{Catalogue, Flattening};
use platen_host::cli::bench::BenchArguments;
use platen_host::cli::{CliError, output};
use platen_host::progress;
use platen_model::units::mm;
use platen_shape::DiskMesh;
use platen_shape::mesh::SmoothFace;

use crate::accuracy::Accuracy;
use crate::scene::{Scene, Setting, Shot};
use crate::stages::{self, Run, Stages, median, ms, run};
use crate::{figures, machine};

use serde_json::{Value as Json, json};

/// Margin scanned round the plate, degrees: the lattice at quarter resolution then has 1.6 million cells.
pub(super) const MARGIN_DEG: f64 = 9.0;

const PAPER_POINTS: usize = 277_721;
const PAPER_VERTICES: usize = 10_188;
const PAPER_PITCH_MM: f64 = 6.3;
/// Extract, outline, mesh, flatten (ABF, harmonic), surface, total (ABF, harmonic), milliseconds.
const PAPER_STEPS: [[f64; 2]; 6] =
    [[1510.0, 1510.0], [120.0, 120.0], [30.0, 30.0], [710.0, 60.0], [50.0, 50.0], [2410.0, 1710.0]];
/// Vertices, ABF and harmonic map, milliseconds.
const PAPER_FLATTENING: [(usize, [f64; 2]); 5] = [
    (1_000, [40.0, 6.0]),
    (5_000, [280.0, 20.0]),
    (10_000, [710.0, 60.0]),
    (50_000, [5890.0, 400.0]),
    (100_000, [17_660.0, 840.0]),
];
/// ABF and harmonic map: standard deviation of d_u and d_v in millimetres and of the angle in degrees.
const PAPER_CELLS: [(&str, [f64; 3]); 2] =
    [("paper, abf", [0.8, 0.4, 0.14]), ("paper, harmonic", [0.8, 0.4, 0.15])];
/// Mean error of nine markers, millimetres.
const PAPER_MARKERS_MM: f64 = 1.0;

/// Meshes above this size are flattened at most three times.
const LARGE_MESH: usize = 20_000;

/// Returns the plate: 11 square metres, rolled with its straight lines oblique to its edges. The published pitch gives
/// the published number of points on it.
pub(super) fn scene() -> Scene {
    Scene {
        name: "rolled".into(),
        size_mm: [4000.0, 2755.0, 36.0],
        shape: "shape = \"cylinder\"\nradius_mm = 12000.0\naxis_deg = 110.0".into(),
        centre_mm: [6770.0, 0.0, -3600.0],
        bevel_mm: [0.0; 2],
        bows_mm: [0.0; 4],
        yaw_deg: 30.0,
    }
}

/// Times and accuracy with one flattening.
struct Outcome {
    name: String,
    stages: Stages,
    accuracy: Accuracy,
}

pub(super) fn tables(
    catalogue: &Catalogue,
    folder: &Path,
    arguments: &BenchArguments,
    silent: bool,
) -> Result<Json, CliError> {
    progress::phase("casting rays");
    let scene = scene();
    let noise_mm = arguments.noise_mm.first().copied().unwrap_or(0.5);
    let (step_deg, threads) = (arguments.step_deg, arguments.threads);
    let setting = Setting { step_deg, margin_deg: MARGIN_DEG, noise_mm, seed: arguments.seed, threads };
    let shot = scene.scan(catalogue, folder, setting, &[])?;
    let mut flattenings = stages::flattenings(catalogue, &arguments.flattening)?;
    let mut outcomes = Vec::new();
    let mut last = None;
    for flattening in &mut flattenings {
        progress::phase(&format!("measuring with {}", flattening.name()));
        let (stages, one) = repeated(&shot, flattening, arguments.repeat)?;
        let accuracy = Accuracy::of(&one.measurement, &shot.truth);
        outcomes.push(Outcome { name: flattening.name().to_owned(), stages, accuracy });
        last = Some(one);
    }
    let Some(one) = last else { return Err(CliError::Usage("give at least one --flattening".into())) };
    let meshes = meshes(&shot, &one, &mut flattenings, arguments)?;
    progress::done();
    let document = document(&shot, &one, &outcomes, &meshes);
    if !silent {
        print(&shot, &one, &outcomes, &meshes, noise_mm, arguments)?;
    }
    Ok(document)
}

/// Measures several times; returns the median of each stage and the last run.
fn repeated(shot: &Shot, flattening: &mut Flattening, repeat: usize) -> Result<(Stages, Run), CliError> {
    let failed = |e: platen_engine::stroke::NotMeasured| CliError::Failed(e.to_string());
    let mut last = run(shot, flattening).map_err(failed)?;
    let mut all = vec![last.stages];
    for _ in 1..repeat {
        last = run(shot, flattening).map_err(failed)?;
        all.push(last.stages);
    }
    let stage = |take: fn(&Stages) -> Duration| median(all.iter().map(take).collect());
    let stages = Stages {
        extract: stage(|s| s.extract),
        outline: stage(|s| s.outline),
        mesh: stage(|s| s.mesh),
        flatten: stage(|s| s.flatten),
        surface: stage(|s| s.surface),
    };
    Ok((stages, last))
}

/// Vertices of a mesh and the time of each flattening on it; `None` where it failed.
type MeshRow = (usize, Vec<Option<Duration>>);

/// Flattens meshes of several sizes over the same scanned plate through the plugin boundary.
fn meshes(
    shot: &Shot,
    one: &Run,
    flattenings: &mut [Flattening],
    arguments: &BenchArguments,
) -> Result<Vec<MeshRow>, CliError> {
    let failed = |e: &dyn std::fmt::Display| CliError::Failed(e.to_string());
    let face = SmoothFace::of(&one.seen.patch, &one.seen.outline, &shot.spec);
    let mut rows = Vec::new();
    for n in &arguments.meshes {
        progress::phase(&format!("flattening {n} vertices"));
        let (mesh, _) = face.mesh(&one.seen.outline, &shot.spec, &shot.blank, *n).map_err(|e| failed(&e))?;
        let repeat = if *n > LARGE_MESH { arguments.repeat.min(3) } else { arguments.repeat };
        let times = flattenings.iter_mut().map(|flattening| time(flattening, &mesh, repeat)).collect();
        rows.push((mesh.vertices.len(), times));
    }
    Ok(rows)
}

fn time(flattening: &mut Flattening, mesh: &DiskMesh, repeat: usize) -> Option<Duration> {
    use platen_shape::Flatten as _;
    let once = |_| {
        let start = machine::cpu_time();
        let flattened = flattening.flatten(mesh);
        flattened.map(|_| machine::cpu_time().saturating_sub(start))
    };
    let times: Result<Vec<Duration>, _> = (0..repeat).map(once).collect();
    match times {
        Ok(times) => Some(median(times)),
        Err(error) => {
            tracing::warn!(%error, vertices = mesh.vertices.len(), "flattening failed");
            None
        }
    }
}

/// Name of a step of table 2, and its time.
type Step = (&'static str, fn(&Stages) -> Duration);

const STEPS: [Step; 6] = [
    ("extract plate points", |s| s.extract),
    ("boundary loop, corners, edges", |s| s.outline),
    ("mid-surface and mesh", |s| s.mesh),
    ("flatten", |s| s.flatten),
    ("fit S(u, v), with covariance", |s| s.surface),
    ("total", Stages::total),
];

fn print(
    shot: &Shot,
    one: &Run,
    outcomes: &[Outcome],
    meshes: &[MeshRow],
    noise_mm: f64,
    arguments: &BenchArguments,
) -> Result<(), CliError> {
    output::line(&format!(
        "scan: rolled plate of 4000 x 2755 x 36 mm, R 12 m, straight lines 20 degrees oblique, about 8 m away; {} x {} cells, \
         noise {noise_mm} mm at 10 m, seed {}; simulated",
        shot.header.n_rows, shot.header.n_columns, arguments.seed
    ))?;
    output::line("\nTable 1: the scan and its mesh")?;
    let sized = |name: &str, here: String, paper: String| vec![name.to_owned(), here, paper];
    output::table(&[
        sized("", "here".into(), "paper".into()),
        sized("points on the plate", one.seen.patch.samples.len().to_string(), PAPER_POINTS.to_string()),
        sized(
            "vertices of the mesh",
            one.measurement.mesh.vertices.len().to_string(),
            PAPER_VERTICES.to_string(),
        ),
        sized(
            "mean pitch, mm",
            format!("{:.1}", mm(one.measurement.quality.lattice_step)),
            format!("{PAPER_PITCH_MM}"),
        ),
    ])?;

    let names = outcomes.iter().map(|f| f.name.clone());
    let paper = ["paper, abf".to_owned(), "paper, harmonic".to_owned()];
    output::line("\nTable 2: ms of each step")?;
    let mut rows =
        vec![["step".to_owned()].into_iter().chain(names.clone()).chain(paper.clone()).collect::<Vec<_>>()];
    for ((step, take), paper) in STEPS.iter().zip(PAPER_STEPS) {
        let here = outcomes.iter().map(|f| format!("{:.1}", ms(take(&f.stages))));
        rows.push(
            [(*step).to_owned()].into_iter().chain(here).chain(paper.map(|p| format!("{p:.0}"))).collect(),
        );
    }
    output::table(&rows)?;

    output::line("\nTable 3: ms of flattening meshes of this scan, through the plugin boundary")?;
    let mut rows = vec![["vertices".to_owned()].into_iter().chain(names).chain(paper).collect::<Vec<_>>()];
    for ((vertices, times), wanted) in meshes.iter().zip(&arguments.meshes) {
        let here = times.iter().map(|t| t.map_or("failed".to_owned(), |t| format!("{:.1}", ms(t))));
        let known = PAPER_FLATTENING.iter().find(|(n, _)| n == wanted);
        let paper = (0..2).map(|k| known.map_or("-".to_owned(), |(_, times)| format!("{:.0}", times[k])));
        rows.push([vertices.to_string()].into_iter().chain(here).chain(paper).collect());
    }
    output::table(&rows)?;

    output::line(
        "\nTable 4: cells of a lattice drawn on the plate, and other errors against the true shape (mm, degrees, 1/m)",
    )?;
    let mut rows = vec![figures::head(&figures::OF_MEASUREMENT, &["flattening"])];
    rows.extend(outcomes.iter().map(|f| figures::row(&f.name, &f.accuracy)));
    for (name, [du, dv, angle]) in PAPER_CELLS {
        let cells = [
            name.to_owned(),
            "-".into(),
            format!("{PAPER_MARKERS_MM:.1}"),
            "-".into(),
            "-".into(),
            "-".into(),
            format!("{du}"),
            format!("{dv}"),
            format!("{angle}"),
            "-".into(),
        ];
        rows.push(cells.to_vec());
    }
    output::table(&rows)?;
    output::line(
        "here: measured minus true sides and angles of cells W/20 x H/20, root mean square about zero; paper: their standard \
         deviation. The paper's 1.0 mm of nine markers is one experiment, not one per flattening. Paper: Masuda et al., \
         \"Point-based shape monitoring of plate bending for large-scale storage tanks\".",
    )
}

fn document(shot: &Shot, one: &Run, outcomes: &[Outcome], meshes: &[MeshRow]) -> Json {
    let paper_step = |k: usize| json!({ "abf": PAPER_STEPS[k][0], "harmonic": PAPER_STEPS[k][1] });
    let step = |k: usize| {
        let (name, take) = STEPS[k];
        let here: serde_json::Map<String, Json> =
            outcomes.iter().map(|f| (f.name.clone(), json!(ms(take(&f.stages))))).collect();
        json!({ "step": name, "here_ms": here, "paper_ms": paper_step(k) })
    };
    let mesh = |(vertices, times): &MeshRow| {
        let here: serde_json::Map<String, Json> =
            outcomes.iter().zip(times).map(|(f, t)| (f.name.clone(), json!(t.map(ms)))).collect();
        json!({ "vertices": vertices, "here_ms": here })
    };
    let paper_mesh = |(n, [abf, harmonic]): &(usize, [f64; 2])| json!({ "vertices": n, "abf_ms": abf, "harmonic_ms": harmonic });
    let paper_cells = |(name, [du, dv, angle]): &(&str, [f64; 3])| json!({ "of": name, "d_u_std_mm": du, "d_v_std_mm": dv, "theta_std_deg": angle });
    json!({
        "cells": shot.n_cells(),
        "table_1": {
            "here": {
                "plate_points": one.seen.patch.samples.len(),
                "vertices": one.measurement.mesh.vertices.len(),
                "pitch_mm": mm(one.measurement.quality.lattice_step),
            },
            "paper": { "plate_points": PAPER_POINTS, "vertices": PAPER_VERTICES, "pitch_mm": PAPER_PITCH_MM },
        },
        "table_2": (0..STEPS.len()).map(step).collect::<Vec<_>>(),
        "table_3": {
            "here": meshes.iter().map(mesh).collect::<Vec<_>>(),
            "paper": PAPER_FLATTENING.iter().map(paper_mesh).collect::<Vec<_>>(),
        },
        "table_4": {
            "here": outcomes.iter().map(|f| (f.name.clone(), figures::document(&f.accuracy).into())).collect::<serde_json::Map<String, Json>>(),
            "paper": PAPER_CELLS.iter().map(paper_cells).collect::<Vec<_>>(),
            "paper_markers_mean_mm": PAPER_MARKERS_MM,
        },
    })
}
