//! Errors of the comparisons `displacement`, `curvature` and `template` on pairs of simulated scans.
//!
//! A plate with two bend bands is scanned. It receives a third band and is scanned again, then scanned once more
//! unchanged. The first pair is a stroke, the second a null pair. Between scans the plate is shifted and turned, as on
//! a press.

use std::path::Path;
use std::time::Duration;

use platen_engine::pipeline;
use platen_engine::plugin::{Catalogue, Comparison, Flattening, Surfaces};
use platen_host::cli::CliError;
use platen_model::units::{metres, mm};
use platen_model::{
    Centre, Facing, Field, NodeState, RadiusOf, ReferenceLine, Report, Seat, Target, TargetShape, Task,
    Template,
};
use platen_plant::Value;
use platen_shape::{Placement, Surface, Vec3};

use crate::accuracy::{Truth, rms};
use crate::figures::Figure;
use crate::scene::{Scene, Setting, Shot};
use crate::stages;

/// Extent and thickness of the plates, millimetres.
const SIZE_MM: [f64; 3] = [3000.0, 2500.0, 36.0];
/// Centres of the bands, millimetres from the plate's centre, before and after the stroke.
const BEFORE: &[f64] = &[-800.0, 0.0];
pub(super) const AFTER: &[f64] = &[-800.0, 0.0, 700.0];
/// Width of a band and its bend angle: 0.16 1/m at its centre, as left by press strokes.
const BAND_MM: f64 = 300.0;
const BAND_DEG: f64 = 1.4;

/// Radii of the plate and of the template, mid-surface, and the template's chord, metres.
const ROLLED: f64 = 9.0;
const WANTED: f64 = 8.5;
const CHORD: f64 = 2.0;

const COMPARISON_LIMIT: Duration = Duration::from_secs(60);

/// Errors of one plate's strokes: metres, radians, shares.
#[derive(Debug, Clone, Copy)]
pub(super) struct StrokeErrors {
    /// Root mean square errors of the displacement after alignment, along the normal and as a vector.
    displacement_normal: f64,
    displacement_vector: f64,
    /// Bend angle of the new band.
    angle: f64,
    /// Gap of a template in the balanced seat.
    gap: f64,
    /// Share of the plate above the level of detection in a null pair, without the test of patch size.
    false_change: f64,
}

/// Figures of a pair of scans.
pub(super) const OF_STROKE: [Figure<StrokeErrors>; 5] = [
    ("displacement_normal_rms_mm", "displacement normal mm", |e| mm(e.displacement_normal), 3),
    ("displacement_vector_rms_mm", "vector mm", |e| mm(e.displacement_vector), 3),
    ("band_angle_error_deg", "bend angle deg", |e| e.angle.to_degrees(), 4),
    ("template_gap_error_mm", "template gap mm", |e| mm(e.gap), 3),
    ("false_change_share", "null pair above LoD", |e| e.false_change, 3),
];

/// Returns the `[shape]` table of a plate with these bands.
pub(super) fn bands(at_mm: &[f64]) -> String {
    let band = |at: &f64| format!("{{ at_mm = {at:?}, width_mm = {BAND_MM:?}, angle_deg = {BAND_DEG:?} }}");
    let bands: Vec<String> = at_mm.iter().map(band).collect();
    format!("shape = \"bands\"\naxis_deg = 90.0\nbands = [{}]", bands.join(", "))
}

/// Plugins under test.
pub(super) struct Tools {
    flattening: Flattening,
    displacement: Comparison,
    curvature: Comparison,
    template: Comparison,
}

impl Tools {
    /// Loads the first of the flattenings and the comparisons; single nodes count as changed, not only patches.
    pub(super) fn load(catalogue: &Catalogue, names: &[String]) -> Result<Self, CliError> {
        let flattening = stages::flattenings(catalogue, names)?.into_iter().next();
        let comparison = |name: &str, option: Option<(&str, Value)>| -> Result<Comparison, CliError> {
            let (library, values) = pipeline::load_with(catalogue, name, option)?;
            Ok(Comparison::create(&library, &values, COMPARISON_LIMIT)?)
        };
        Ok(Self {
            flattening: flattening.ok_or_else(|| CliError::Usage("give at least one --flattening".into()))?,
            displacement: comparison("displacement", Some(("min_patch", Value::Float(0.0))))?,
            curvature: comparison("curvature", None)?,
            template: comparison("template", None)?,
        })
    }
}

/// Scans a plate before and after a stroke and once more, and a rolled plate, and returns the errors of the
/// comparisons.
pub(super) fn errors(
    catalogue: &Catalogue,
    folder: &Path,
    tools: &mut Tools,
    noise_mm: f64,
    seed: u64,
) -> Result<StrokeErrors, CliError> {
    let failed =
        |e: &dyn std::fmt::Display| CliError::Failed(format!("stroke at {noise_mm} mm, seed {seed}: {e}"));
    let mut measured = |name: &str, shape: String, number: u64| -> Result<(Shot, Surface), CliError> {
        let scene = Scene {
            name: format!("stroke-{name}"),
            size_mm: SIZE_MM,
            shape,
            centre_mm: [6000.0, 0.0, -3600.0],
            bevel_mm: [0.0; 2],
            bows_mm: [0.0; 4],
            yaw_deg: 10.0,
        };
        // Four scans for each seed, with different errors.
        let setting = Setting::of_accuracy(noise_mm, seed.wrapping_mul(4).wrapping_add(number));
        let shot = scene.scan(catalogue, folder, setting, &[])?;
        let run = stages::run(&shot, &mut tools.flattening).map_err(|e| failed(&e))?;
        Ok((shot, run.measurement.surface))
    };
    let (before_shot, before) = measured("before", bands(BEFORE), 0)?;
    let (after_shot, after) = measured("after", bands(AFTER), 1)?;
    let (_, again) = measured("again", bands(AFTER), 2)?;
    let rolled = format!("shape = \"cylinder\"\nradius_mm = {:?}\naxis_deg = 90.0", 1000.0 * ROLLED);
    let (_, rolled) = measured("rolled", rolled, 3)?;

    let task = task();
    let compare = |comparison: &Comparison, now: &Surface, before: Option<&Surface>| {
        comparison.compare(&task, Surfaces { now, before, baseline: None }).map_err(|e| failed(&e))
    };
    let moved = compare(&tools.displacement, &after, Some(&before))?;
    let bent = compare(&tools.curvature, &after, Some(&before))?;
    let null = compare(&tools.displacement, &again, Some(&after))?;
    let laid = compare(&tools.template, &rolled, None)?;

    let missing = |what: &str| failed(&format!("the plugin reports no {what}"));
    let field = moved.fields.iter().find(|field| field.name == "displacement" && field.components == 3);
    let field = field.ok_or_else(|| missing("displacement"))?;
    let [displacement_normal, displacement_vector] =
        displacement(field, &after, [&before_shot.truth, &after_shot.truth]);
    let angle = figure(&bent, "bend.1.angle").ok_or_else(|| missing("bend.1.angle"))?;
    let gap = laid.findings.templates.first().ok_or_else(|| missing("template"))?.max_gap;
    let false_change = figure(&null, "displacement.above_lod")
        .ok_or_else(|| missing("share above the level of detection"))?;
    Ok(StrokeErrors {
        displacement_normal,
        displacement_vector,
        angle: angle - BAND_DEG.to_radians(),
        gap: gap - true_gap(),
        false_change,
    })
}

fn figure(report: &Report, name: &str) -> Option<f64> {
    report.findings.figures.iter().find(|figure| figure.name == name).map(|figure| figure.value)
}

fn task() -> Task {
    let [width, height, thickness] = SIZE_MM.map(metres);
    Task {
        plate: "bench".into(),
        width,
        height,
        thickness,
        target: Some(Target {
            shape: TargetShape::Cylinder { radius: WANTED, axis: std::f64::consts::FRAC_PI_2 },
            radius_of: RadiusOf::Mid,
            scanned_face: Facing::Inside,
        }),
        reference_lines: vec![ReferenceLine {
            name: "middle".into(),
            from: [0.0, 0.5 * height],
            to: [width, 0.5 * height],
        }],
        templates: vec![Template {
            name: "board".into(),
            line: "middle".into(),
            chord: CHORD,
            centre: Centre::At(0.5 * width),
            limit: 0.003,
            seat: Seat::Balanced,
            source: None,
        }],
        stations: Vec::new(),
        sigma_correlated: 0.0,
        sigma_true: None,
        supports: Vec::new(),
        supports_changed: false,
    }
}

/// Returns the true gap: a template with the radius of the target face touches the flatter plate with its middle, and
/// the gap at its ends is the difference of the sagittas.
fn true_gap() -> f64 {
    let half_thickness = metres(0.5 * SIZE_MM[2]);
    let sagitta = |radius: f64| radius - (radius * radius - 0.25 * CHORD * CHORD).sqrt();
    sagitta(WANTED - half_thickness) - sagitta(ROLLED - half_thickness)
}

/// Returns the root mean square errors of a displacement field at the true grid, along the normal and as a vector. The
/// rigid motion of the plate is excluded: the true grid before is moved rigidly onto the positions before of the field.
fn displacement(field: &Field, now: &Surface, truth: [&Truth; 2]) -> [f64; 2] {
    let [before, after] = truth.map(|truth| &truth.grid);
    let [n_u, n_v] = field.nodes;
    let mut known = Vec::new();
    for k in 0..after.nu * after.nv {
        let (i, j) = (k % after.nu, k / after.nu);
        // The field's grid is a multiple of the truth's.
        let node = j * (n_v - 1) / (after.nv - 1) * n_u + i * (n_u - 1) / (after.nu - 1);
        if field.state[node] != NodeState::Unseen {
            let moved = Vec3::from_column_slice(&field.values[3 * node..3 * node + 3]);
            let u = now.width() * i as f64 / (after.nu - 1) as f64;
            let v = now.height() * j as f64 / (after.nv - 1) as f64;
            known.push((k, moved, now.face(u, v), now.normal(u, v)));
        }
    }
    let from: Vec<Vec3> = known.iter().map(|(k, ..)| Vec3::from(before.position_m[*k])).collect();
    let to: Vec<Vec3> = known.iter().map(|(_, moved, face, _)| face - moved).collect();
    let motion = Placement::of_pairs(from.iter().copied().zip(to));
    let errors: Vec<(Vec3, Vec3)> = known
        .iter()
        .zip(&from)
        .map(|((k, moved, _, normal), was)| {
            (moved - (Vec3::from(after.position_m[*k]) - motion.moved(was)), *normal)
        })
        .collect();
    [
        rms(errors.iter().map(|(error, normal)| error.dot(normal))),
        rms(errors.iter().map(|(error, _)| error.norm())),
    ]
}
