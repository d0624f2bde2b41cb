//! Accuracy over random scenes of known truth: errors, coverage of the stated 95 % intervals, and gross errors with the
//! program's output.
//!
//! A scene depends on its seed alone ([`RandomScene::of`]). The properties are drawn from these ranges:
//!
//! - plate: 2 to 5 x 1.5 to 4 m, 25 to 50 mm thick, any shape of the simulator, concave or convex, at any heading
//! - position: the plate's middle 6 to 11 m away horizontally, the scanner 3 to 5 m above it
//! - scan: steps of 0.03 to 0.055 degrees, range noise of 0.3 to 1.5 mm at 10 m on mill scale, reflectivity of the
//!   plate 0.1 to 0.6
//! - disturbances: a person, or a chain, each in a third of the scenes; a cyclic range error of up to 0.3 mm in a third
//!
//! The truth is that of the simulator. Lengths and angles of the true outline follow the definitions of
//! [`ShapeChecks`], so that each figure is compared with the same figure.
//!
//! Families ([`Family`]) share these scenes and differ in one property:
//!
//! - square edges and normal range errors
//! - edges with a double-V bevel of 20 to 40 degrees, in half of the scenes with a root face of up to 6 mm
//! - edges bowed by their cut, as the prior of the edge curve states
//! - a share of wide range errors
//! - a table that is visible in one to two rows beyond the far edges
//! - a person before the nearest corner
//! - a beam with power beyond its 1/e^2 width
//! - a beam of 13 rays
//!
//! Several scans of each scene separate bias from scatter ([`repeated`]).

mod laid_template;
mod plate_scene;
mod repeated;
mod stated;

use std::path::Path;

use platen_engine::calibration::Calibration;
use platen_engine::plugin::{Catalogue, Comparison, Flattening};
use platen_engine::scanner_error::ScannerError;
use platen_engine::stroke::NotMeasured;
use platen_host::cli::bench::BenchArguments;
use platen_host::cli::{CliError, output};
use platen_host::progress;
use platen_model::units::mm;
use platen_numerics::normal_distribution::cdf;
use platen_shape::{EXPANDED, RangeError};

use crate::accuracy::rms;
use crate::scene::Shot;
use crate::seeds::shared;
use crate::stages;
use plate_scene::{Given, RandomScene, widest_spacing};
use repeated::Repeated;
use stated::{Errors, KINDS, Kind, Stated};

use serde_json::{Value as Json, json};

/// Errors of corners above this are far off, metres.
const FAR: f64 = 1e-3;

/// Measurement of one scene.
struct Outcome {
    seed: u64,
    /// Number of the scan of this scene, from 0; it is shown to people from 1.
    scan: u64,
    scene: String,
    /// Amplitude of the cyclic range error, millimetres.
    cyclic_mm: f64,
    /// Largest distance of samples across an edge, metres.
    spacing: f64,
    result: Result<Errors, String>,
}

/// Measures `n` random scenes and reports their errors.
pub(super) fn random(
    catalogue: &Catalogue,
    folder: &Path,
    arguments: &BenchArguments,
    n: usize,
    silent: bool,
) -> Result<Json, CliError> {
    let seeds: Vec<u64> = (0..n as u64).map(|k| arguments.seed.wrapping_add(k)).collect();
    let scans: Vec<(u64, u64)> =
        seeds.iter().flat_map(|seed| (0..arguments.scans).map(|scan| (*seed, scan))).collect();
    let load = || {
        let flattenings = stages::flattenings(catalogue, &arguments.flattening[..1])?;
        Ok((flattenings, laid_template::load(catalogue)?))
    };
    let given = Given { cyclic_mm: arguments.cyclic_mm, reflectivity: arguments.reflectivity };
    let calibration = arguments.calibration.as_deref().map(Calibration::load).transpose()?;
    let outcomes = shared(&scans, arguments.threads, load, |(flattenings, template), (seed, scan)| {
        progress::phase(&format!("random scene {seed}, scan {}", scan + 1));
        let scene = RandomScene::of(arguments.family, given, *seed).repeated(*scan);
        let shot = scene.scan(catalogue, folder)?;
        let flattening = flattenings.first_mut();
        let result = flattening.map_or(Err("no flattening".into()), |f| {
            errors(&scene, &shot, calibration.as_ref(), f, template)
        });
        let spacing = widest_spacing(&shot.truth, scene.setting.step_deg.to_radians());
        Ok(Outcome {
            seed: *seed,
            scan: *scan,
            scene: scene.words(),
            cyclic_mm: scene.cyclic_mm,
            spacing,
            result,
        })
    })?;
    progress::done();
    let repeated = over_scans(&outcomes);
    if !silent {
        print(&outcomes)?;
        print_repeated(&repeated)?;
    }
    let biases = |(seed, figures): &(u64, Vec<Repeated>)| json!({ "seed": seed, "figures": figures.iter().map(Repeated::document).collect::<Vec<_>>() });
    Ok(json!({
        "scenes": outcomes.iter().map(document).collect::<Vec<_>>(),
        "repeated": repeated.iter().map(biases).collect::<Vec<_>>(),
        "summary": KINDS.map(|kind| summary(&outcomes, kind).document()),
        "far_corners": far_corners(&outcomes).document(),
    }))
}

/// Returns the figures of each scene over its scans; none for a scene that was measured once.
fn over_scans(outcomes: &[Outcome]) -> Vec<(u64, Vec<Repeated>)> {
    let of_scene = |scans: &[Outcome]| {
        let measured: Vec<&[Stated]> =
            scans.iter().filter_map(|scan| Some(scan.result.as_ref().ok()?.stated.as_slice())).collect();
        (scans[0].seed, KINDS.iter().flat_map(|kind| Repeated::of(&measured, *kind)).collect())
    };
    let scenes = outcomes.chunk_by(|a, b| a.seed == b.seed).map(of_scene);
    scenes.filter(|(_, figures): &(u64, Vec<Repeated>)| !figures.is_empty()).collect()
}

fn errors(
    scene: &RandomScene,
    shot: &Shot,
    calibration: Option<&Calibration>,
    flattening: &mut Flattening,
    template: &Comparison,
) -> Result<Errors, String> {
    let refused = |e: NotMeasured| e.to_string();
    let seen = stages::see(shot).map_err(refused)?;
    let measurement = stages::shape(shot, &seen, flattening).map_err(refused)?;
    let surface = &measurement.surface;
    // Without a calibration the instrument's own figure is used.
    let own = || ScannerError::known(RangeError::new(shot.header.range_error_m.unwrap_or(0.0)), surface);
    let scanner = calibration.map_or_else(own, |of| ScannerError::calibrated(of, surface));
    let mut errors =
        Errors::of(&measurement, &seen.outline, &shot.truth, shot.spec.face_inset, scanner.range());
    errors.stated.extend(laid_template::errors(template, scene, shot, surface, &scanner)?);
    Ok(errors)
}

/// Errors of one kind over all scenes.
struct Summary {
    name: &'static str,
    n: usize,
    /// Median, 95th percentile and largest absolute error, in the unit of the name.
    quantiles: [f64; 3],
    /// Share of errors inside their 95 % interval: for all scenes, for those without and those with a cyclic range
    /// error.
    coverage: [f64; 3],
    /// Root mean square of error over standard deviation.
    ratio: f64,
}

fn summary(outcomes: &[Outcome], kind: Kind) -> Summary {
    let (name, unit) = kind.name_and_unit();
    let of = |cyclic: &[bool]| -> Vec<Stated> {
        let scenes = outcomes.iter().filter(|outcome| cyclic.contains(&(outcome.cyclic_mm > 0.0)));
        let measured = scenes.filter_map(|outcome| outcome.result.as_ref().ok());
        measured.flat_map(|errors| &errors.stated).filter(|s| s.kind == kind).copied().collect()
    };
    let coverage = |all: &[Stated]| {
        let inside = all.iter().filter(|s| s.error.abs() <= EXPANDED * s.sigma).count();
        inside as f64 / all.len() as f64
    };
    let all = of(&[false, true]);
    let mut errors: Vec<f64> = all.iter().map(|s| unit(s.error.abs())).collect();
    errors.sort_by(f64::total_cmp);
    let quantile =
        |share: f64| errors.get((share * errors.len().saturating_sub(1) as f64).round() as usize).copied();
    Summary {
        name,
        n: all.len(),
        quantiles: [0.5, 0.95, 1.0].map(|share| quantile(share).unwrap_or(f64::NAN)),
        coverage: [coverage(&all), coverage(&of(&[false])), coverage(&of(&[true]))],
        ratio: rms(all.iter().map(|s| s.error / s.sigma)),
    }
}

impl Summary {
    fn document(&self) -> Json {
        let [median, most, worst] = self.quantiles;
        json!({
            "of": self.name, "n": self.n, "median": median, "p95": most, "max": worst,
            "coverage": self.coverage[0], "coverage_without_cyclic": self.coverage[1],
            "coverage_with_cyclic": self.coverage[2], "rms_error_over_sigma": self.ratio,
        })
    }

    fn row(&self) -> Vec<String> {
        let quantiles = self.quantiles.map(|value| format!("{value:.3}"));
        let percent =
            |share: f64| if share.is_nan() { "-".into() } else { format!("{:.1} %", 100.0 * share) };
        let coverage = self.coverage.map(percent);
        let row = [self.name.to_owned(), self.n.to_string()].into_iter().chain(quantiles).chain(coverage);
        row.chain([format!("{:.2}", self.ratio)]).collect()
    }
}

/// Corner figures that are far off and outside of their 95 % interval.
struct FarCorners {
    found: usize,
    /// Expected number if all errors were normally distributed with the stated standard deviations: a twentieth of all
    /// figures is outside.
    expected: f64,
}

fn far_corners(outcomes: &[Outcome]) -> FarCorners {
    let measured = outcomes.iter().filter_map(|outcome| outcome.result.as_ref().ok());
    let corners: Vec<&Stated> =
        measured.flat_map(|errors| &errors.stated).filter(|s| s.kind == Kind::Corner).collect();
    let bound = |s: &Stated| (EXPANDED * s.sigma).max(FAR);
    FarCorners {
        found: corners.iter().filter(|s| s.error.abs() > bound(s)).count(),
        expected: corners.iter().map(|s| 2.0 * cdf(-bound(s) / s.sigma)).sum(),
    }
}

impl FarCorners {
    fn document(&self) -> Json {
        json!({ "found": self.found, "expected": self.expected })
    }
}

fn document(outcome: &Outcome) -> Json {
    let mut document = json!({ "seed": outcome.seed, "scan": outcome.scan + 1, "scene": outcome.scene, "cyclic_mm": outcome.cyclic_mm, "widest_spacing_mm": mm(outcome.spacing) });
    match &outcome.result {
        Err(refusal) => document["refused"] = json!(refusal),
        Ok(errors) => {
            document["corner_max_mm"] = json!(mm(errors.corner));
            document["marker_max_mm"] = json!(mm(errors.marker));
            document["corners_seen"] = json!(errors.corners_seen);
            document["figures"] = errors.stated.iter().map(Stated::document).collect();
        }
    }
    document
}

fn print(outcomes: &[Outcome]) -> Result<(), CliError> {
    let n_scenes = outcomes.chunk_by(|a, b| a.seed == b.seed).count();
    let scans = if n_scenes < outcomes.len() { format!(", {} scans", outcomes.len()) } else { String::new() };
    output::line(&format!("\nErrors on {n_scenes} random scenes{scans}, and stated 95 % intervals"))?;
    let head = ["", "n", "median", "95 %", "max", "inside", "not cyclic", "cyclic", "rms/sigma"]
        .map(str::to_owned)
        .to_vec();
    let rows = KINDS.iter().map(|kind| summary(outcomes, *kind).row());
    output::table(&std::iter::once(head).chain(rows).collect::<Vec<_>>())?;
    let FarCorners { found, expected } = far_corners(outcomes);
    output::line(&format!(
        "\nFigures of corners more than {:.0} mm off and outside of their interval: {found}; of normal errors {expected:.1}",
        mm(FAR)
    ))?;
    output::line("\nGross errors (corner above 2 mm, marker above 1 mm) and refusals")?;
    for outcome in outcomes {
        let spacing = mm(outcome.spacing);
        let said = match &outcome.result {
            Err(refusal) => format!("refused: {refusal}"),
            Ok(e) if e.is_gross() => {
                let flagged = if e.corners_seen == [true; 4] { "not flagged" } else { "flagged" };
                format!("corner {:.1} mm, marker {:.1} mm, {flagged}", mm(e.corner), mm(e.marker))
            }
            Ok(_) => continue,
        };
        output::line(&format!(
            "seed {}{}: {said}; samples {spacing:.0} mm apart\n  {}",
            outcome.seed,
            if outcome.scan > 0 { format!(", scan {}", outcome.scan + 1) } else { String::new() },
            outcome.scene
        ))?;
    }
    Ok(())
}

fn print_repeated(scenes: &[(u64, Vec<Repeated>)]) -> Result<(), CliError> {
    if scenes.is_empty() {
        return Ok(());
    }
    output::line("\nRepeated scans: bias and scatter of each figure, root mean squares over figures")?;
    let head = ["", "n", "bias", "largest", "scatter", "stated sigma"].map(str::to_owned).to_vec();
    let rows = KINDS.iter().map(|kind| {
        let figures = scenes.iter().flat_map(|(_, figures)| figures).filter(|figure| figure.kind == *kind);
        repeated::row(*kind, &figures.collect::<Vec<_>>())
    });
    output::table(&std::iter::once(head).chain(rows).collect::<Vec<_>>())
}
