//! Accuracy over many simulated scans: each scene with several seeds, measured with each flattening.
//!
//! The cases are distributed to threads; the results do not depend on the number of threads.

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use platen_engine::plugin::{Catalogue, Flattening};
use platen_engine::stroke::NotMeasured;
use platen_host::cli::bench::BenchArguments;
use platen_host::cli::{CliError, output};
use platen_host::progress;

use crate::accuracy::Accuracy;
use crate::figures::{self, OF_MEASUREMENT};
use crate::scene::{Scene, Setting};
use crate::stages;
use crate::strokes::{self, OF_STROKE, StrokeErrors};

use serde_json::{Value as Json, json};

/// Returns plates of a shop, 7 m away, with the scanned face concave.
pub(super) fn scenes() -> Vec<Scene> {
    let scene = |name: &str, size_mm: [f64; 3], yaw_deg: f64, shape: &str| Scene {
        name: name.into(),
        size_mm,
        shape: shape.into(),
        centre_mm: [6000.0, 0.0, -3600.0],
        bevel_mm: [0.0; 2],
        bows_mm: [0.0; 4],
        yaw_deg,
    };
    let usual = [3000.0, 2500.0, 36.0];
    vec![
        scene("cylinder", usual, 33.0, "shape = \"cylinder\"\nradius_mm = 9000.0\naxis_deg = 110.0"),
        scene(
            "cone",
            [3000.0, 2000.0, 36.0],
            15.0,
            "shape = \"cone\"\naxis_deg = 0.0\nradius_start_mm = 6000.0\nradius_end_mm = 9000.0",
        ),
        scene("sphere", usual, -48.0, "shape = \"sphere\"\nradius_mm = 11000.0"),
        scene(
            "torus",
            usual,
            20.0,
            "shape = \"torus\"\naxis_deg = 90.0\nradius_mm = 14000.0\ncross_radius_mm = 9000.0",
        ),
        scene(
            "half-bent",
            [4000.0, 2500.0, 40.0],
            -20.0,
            "shape = \"steps\"\naxis_deg = 90.0\ncurvature_per_m = 0.2\n\
             steps = [{ at_mm = 100.0, width_mm = 300.0, change_per_m = -0.2 }]",
        ),
        scene("bands", usual, 10.0, &strokes::bands(strokes::AFTER)),
    ]
}

/// Errors over all seeds.
struct Row {
    scene: String,
    noise_mm: f64,
    flattening: String,
    errors: Vec<Accuracy>,
}

/// Errors of pairs of scans over all seeds.
struct PairRow {
    noise_mm: f64,
    errors: Vec<StrokeErrors>,
}

pub(super) fn accuracy(
    catalogue: &Catalogue,
    folder: &Path,
    arguments: &BenchArguments,
    silent: bool,
) -> Result<Json, CliError> {
    let seeds: Vec<u64> = (0..arguments.seeds as u64).map(|k| arguments.seed.wrapping_add(k)).collect();
    let scenes = scenes();
    let cases: Vec<(&Scene, f64, u64)> = scenes
        .iter()
        .flat_map(|scene| arguments.noise_mm.iter().map(move |noise| (scene, *noise)))
        .flat_map(|(scene, noise)| seeds.iter().map(move |seed| (scene, noise, *seed)))
        .collect();
    let load = || stages::flattenings(catalogue, &arguments.flattening);
    let errors = shared(&cases, arguments.threads, load, |flattenings, (scene, noise_mm, seed)| {
        progress::phase(&format!("{} at {noise_mm} mm, seed {seed}", scene.name));
        let shot = scene.scan(catalogue, folder, Setting::of_accuracy(*noise_mm, *seed), &[])?;
        let failed =
            |e: NotMeasured| CliError::Failed(format!("{} at {noise_mm} mm, seed {seed}: {e}", scene.name));
        let seen = stages::see(&shot).map_err(failed)?;
        let of = |flattening: &mut Flattening| {
            let measurement = stages::shape(&shot, &seen, flattening).map_err(failed)?;
            Ok(Accuracy::of(&measurement, &shot.truth))
        };
        flattenings.iter_mut().map(of).collect::<Result<Vec<_>, CliError>>()
    })?;
    // Order of the cases: scene outer, then noise, seed inner.
    let mut rows = Vec::new();
    for (group, cases) in errors.chunks(seeds.len()).zip(cases.chunks(seeds.len())) {
        let Some((scene, noise_mm, _)) = cases.first() else { continue };
        rows.extend(arguments.flattening.iter().enumerate().map(|(k, flattening)| Row {
            scene: scene.name.clone(),
            noise_mm: *noise_mm,
            flattening: flattening.clone(),
            errors: group.iter().filter_map(|errors| errors.get(k).copied()).collect(),
        }));
    }
    let pairs = pairs(catalogue, folder, arguments, &seeds)?;
    progress::done();
    if !silent {
        print(&rows, &pairs, seeds.len())?;
    }
    Ok(json!({
        "seeds": seeds,
        "single": rows.iter().map(document).collect::<Vec<_>>(),
        "pairs": pairs.iter().map(pair_document).collect::<Vec<_>>(),
    }))
}

fn pairs(
    catalogue: &Catalogue,
    folder: &Path,
    arguments: &BenchArguments,
    seeds: &[u64],
) -> Result<Vec<PairRow>, CliError> {
    let cases: Vec<(f64, u64)> =
        arguments.noise_mm.iter().flat_map(|noise| seeds.iter().map(move |seed| (*noise, *seed))).collect();
    let load = || strokes::Tools::load(catalogue, &arguments.flattening);
    let errors = shared(&cases, arguments.threads, load, |tools, (noise_mm, seed)| {
        progress::phase(&format!("strokes at {noise_mm} mm, seed {seed}"));
        strokes::errors(catalogue, folder, tools, *noise_mm, *seed)
    })?;
    let rows = arguments.noise_mm.iter().zip(errors.chunks(seeds.len()));
    Ok(rows.map(|(noise_mm, errors)| PairRow { noise_mm: *noise_mm, errors: errors.to_vec() }).collect())
}

/// Runs `work` for every case on several threads, each with its own tools; returns the results in the order of the
/// cases.
pub(super) fn shared<C: Sync, T, R: Send>(
    cases: &[C],
    threads: usize,
    load: impl Fn() -> Result<T, CliError> + Sync,
    work: impl Fn(&mut T, &C) -> Result<R, CliError> + Sync,
) -> Result<Vec<R>, CliError> {
    let next = AtomicUsize::new(0);
    let worker = || -> Result<Vec<(usize, R)>, CliError> {
        let mut tools = load()?;
        let mut done = Vec::new();
        loop {
            let k = next.fetch_add(1, Ordering::Relaxed);
            let Some(case) = cases.get(k) else { return Ok(done) };
            done.push((k, work(&mut tools, case)?));
        }
    };
    let mut done = std::thread::scope(|scope| {
        let others: Vec<_> = (1..threads).map(|_| scope.spawn(worker)).collect();
        let mut done = worker()?;
        for other in others {
            match other.join() {
                Ok(more) => done.extend(more?),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        Ok::<_, CliError>(done)
    })?;
    done.sort_unstable_by_key(|(k, _)| *k);
    Ok(done.into_iter().map(|(_, result)| result).collect())
}

fn print(rows: &[Row], pairs: &[PairRow], n: usize) -> Result<(), CliError> {
    output::line(&format!("\nAccuracy over {n} simulated scans each, mean / worst (mm, degrees, 1/m)"))?;
    let mut table = vec![figures::head(&OF_MEASUREMENT, &["plate", "noise mm", "flattening"])];
    for row in rows {
        let of = [&row.scene, &format!("{}", row.noise_mm), &row.flattening];
        table.push(figures::row_of_many(&OF_MEASUREMENT, &of.map(String::as_str), &row.errors));
    }
    output::table(&table)?;
    output::line(&format!("\nStrokes: {n} pairs of scans each, mean / worst"))?;
    let mut table = vec![figures::head(&OF_STROKE, &["noise mm"])];
    table.extend(
        pairs.iter().map(|row| figures::row_of_many(&OF_STROKE, &[&row.noise_mm.to_string()], &row.errors)),
    );
    output::table(&table)
}

fn document(row: &Row) -> Json {
    let of = json!({ "plate": row.scene, "noise_mm": row.noise_mm, "flattening": row.flattening });
    figures::document_of_many(&OF_MEASUREMENT, of, &row.errors)
}

fn pair_document(row: &PairRow) -> Json {
    figures::document_of_many(&OF_STROKE, json!({ "noise_mm": row.noise_mm }), &row.errors)
}
