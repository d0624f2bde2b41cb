//! Random scenes of known truth: errors, coverage of the stated 95 % intervals, and gross errors with what the program said.
//!
//! A scene follows from its seed alone ([`RandomScene::of`]): a plate of 2 to 5 x 1.5 to 4 m, 25 to 50 mm thick, of any shape of the
//! simulator, concave or convex, at any heading, 6 to 11 m away (horizontally, its middle), the scanner 3 to 5 m above it, steps of 0.03 to 0.055 degrees, range
//! noise of 0.3 to 1.5 mm at 10 m, a person or a chain in a third of the scenes each, a cyclic range error of up to 0.3 mm in a third.
//! The truth is the simulator's; lengths and angles of the true outline follow the definitions of
//! [`ShapeChecks`], so that a figure is compared with the same figure.
//!
//! Three families ([`Family`]) share these scenes: square edges and normal range errors; edges with a double-V bevel of 20 to 40 degrees, in half
//! of the scenes with a root face of up to 6 mm; a share of wide range errors. Limits: one scan a scene.

use std::path::Path;

use fastrand::Rng;
use platen_engine::plugin::{Catalogue, Flattening};
use platen_engine::stroke::NotMeasured;
use platen_host::cli::bench::{BenchArguments, Family};
use platen_host::cli::{CliError, output};
use platen_host::progress;
use platen_model::units::{metres, mm};
use platen_plant::Value;
use platen_shape::evaluate::{self, Place};
use platen_shape::inspection::{Check, ShapeChecks, corners_seen, edge_doubts};
use platen_shape::measure::Measurement;
use platen_shape::outline::{Corner, EdgeCurve, Outline};
use platen_shape::{Blank, Vec3};

use crate::accuracy::{Truth, rms};
use crate::scene::{Scene, Setting, Shot};
use crate::seeds::shared;
use crate::stages;

use serde_json::{Value as Json, json};

/// Expansion of a standard deviation to a 95 % interval, as in result.json.
const EXPANDED: f64 = 2.0;
/// Height of the plate's middle under the simulator's scanner, millimetres: far enough above the floor for every shape.
const PLATE_MM: f64 = -3200.0;
/// Errors beyond these are listed: metres.
const GROSS_CORNER: f64 = 2e-3;
const GROSS_MARKER: f64 = 1e-3;

/// Share of wide range errors and their factor in the family of that name.
const TAILS: [f64; 2] = [0.05, 4.0];

/// A scene of a family.
struct RandomScene {
    scene: Scene,
    /// Share of wide range errors and their factor.
    tails: [f64; 2],
    setting: Setting,
    /// Height of the scanner over that of the simulator's shop, metres.
    scanner_m: f64,
    cyclic_mm: f64,
    hidden_by: &'static str,
}

impl RandomScene {
    /// Draws the scene of a seed. The same seed gives the same scene in every family but for edges and errors.
    fn of(family: Family, seed: u64) -> Self {
        let mut random = Rng::with_seed(seed ^ 0x7363_656e_6573);
        let mut between = |low: f64, high: f64| low + (high - low) * random.f64();
        let size_mm = [between(2000.0, 5000.0), between(1500.0, 4000.0), between(25.0, 50.0)].map(f64::round);
        let centre_mm = [between(6000.0, 11_000.0).round(), 0.0, PLATE_MM];
        let scanner_m = between(3.0, 5.0) + 0.001 * PLATE_MM;
        let yaw_deg = between(-180.0, 180.0).round();
        let (step_deg, noise_mm) = (between(0.03, 0.055), between(0.3, 1.5));
        // Doubly curved plates no more so than those of a tank: beyond, their edges are strained by more than a plate of
        // another size would be off.
        let longer = 0.001 * size_mm[0].max(size_mm[1]);
        let (radius, cross) = (between(5.0, 20.0), longer * between(3.8, 8.0));
        let axis = between(0.0, 180.0).round();
        let cyclic = between(0.0, 0.3);
        let sign = if random.bool() { 1.0 } else { -1.0 };
        let mm = |metres: f64| sign * (1000.0 * metres).round();
        let (name, shape) = match random.u32(0..7) {
            0 => ("flat", "shape = \"flat\"".to_owned()),
            1 => (
                "cylinder",
                format!("shape = \"cylinder\"\nradius_mm = {:?}\naxis_deg = {axis:?}", mm(radius)),
            ),
            2 => (
                "cone",
                format!(
                    "shape = \"cone\"\naxis_deg = {axis:?}\nradius_start_mm = {:?}\nradius_end_mm = {:?}",
                    mm(cross),
                    mm(1.4 * cross)
                ),
            ),
            3 => ("sphere", format!("shape = \"sphere\"\nradius_mm = {:?}", mm(cross))),
            4 => (
                "torus",
                format!(
                    "shape = \"torus\"\naxis_deg = {axis:?}\nradius_mm = {:?}\ncross_radius_mm = {:?}",
                    mm(cross),
                    mm(1.5 * cross)
                ),
            ),
            5 => (
                "half-bent",
                format!(
                    "shape = \"steps\"\naxis_deg = {axis:?}\ncurvature_per_m = {:?}\n\
                     steps = [{{ at_mm = 100.0, width_mm = 300.0, change_per_m = {:?} }}]",
                    sign / radius,
                    -sign / radius
                ),
            ),
            _ => (
                "bands",
                format!(
                    "shape = \"bands\"\naxis_deg = {axis:?}\nbands = [{{ at_mm = -500.0, width_mm = 300.0, angle_deg = {0:?} }}, \
                     {{ at_mm = 400.0, width_mm = 300.0, angle_deg = {0:?} }}]",
                    sign * 1.4
                ),
            ),
        };
        let hidden_by = *random
            .choice(&["nothing", "nothing", "person", "chain", "nothing", "both"])
            .unwrap_or(&"nothing");
        let cyclic_mm = if random.u32(0..3) == 0 { cyclic } else { 0.0 };
        let setting = Setting { step_deg, noise_mm, ..Setting::of_accuracy(noise_mm, seed) };
        let bevel_mm = if family == Family::Bevel { bevel(&mut random, size_mm[2]) } else { [0.0; 2] };
        let tails = if family == Family::Tails { TAILS } else { [0.0, 1.0] };
        let scene = Scene { name: name.into(), size_mm, shape, centre_mm, bevel_mm, yaw_deg };
        Self { scene, tails, setting, scanner_m, cyclic_mm, hidden_by }
    }

    fn scan(&self, catalogue: &Catalogue, folder: &Path) -> Result<Shot, CliError> {
        let more = [
            ("scanner_m", Value::Floats(vec![0.0, 0.0, self.scanner_m])),
            ("cyclic_mm", Value::Float(self.cyclic_mm)),
            ("wide_share", Value::Float(self.tails[0])),
            ("wide_factor", Value::Float(self.tails[1])),
            ("hidden_by", Value::String(self.hidden_by.to_owned())),
        ];
        self.scene.scan(catalogue, folder, self.setting, &more)
    }

    fn words(&self) -> String {
        let [w, h, t] = self.scene.size_mm;
        let [x, ..] = self.scene.centre_mm;
        let edges = match self.scene.bevel_mm {
            [0.0, _] => String::new(),
            [inset, root] => format!(", face inset {inset}, root face {root}"),
        };
        format!(
            "{} {w:.0} x {h:.0} x {t:.0}{edges}, {:.1} m away, {:.1} m high, yaw {:.0}, {:.3} deg, noise {:.1}, cyclic {:.2}, hidden by {}",
            self.scene.name,
            0.001 * x,
            self.scanner_m - 0.001 * PLATE_MM,
            self.scene.yaw_deg,
            self.setting.step_deg,
            self.setting.noise_mm,
            self.cyclic_mm,
            self.hidden_by
        )
    }
}

/// Draws the bevel of a plate of a thickness: inset of the face and root face, millimetres.
fn bevel(random: &mut Rng, thickness: f64) -> [f64; 2] {
    let angle_deg = 20.0 + 20.0 * random.f64();
    let root = if random.bool() { (6.0 * random.f64()).round() } else { 0.0 };
    let inset = 0.5 * (thickness - root) * angle_deg.to_radians().tan();
    [(10.0 * inset).round() / 10.0, root]
}

/// Error of a figure with a stated interval: kind, metres or radians, its standard deviation.
#[derive(Debug, Clone, Copy)]
struct Stated {
    kind: Kind,
    error: f64,
    sigma: f64,
}

impl Stated {
    fn document(&self) -> Json {
        let (name, unit) = self.kind.name_and_unit();
        json!({ "of": name, "error": unit(self.error), "uncertainty": unit(EXPANDED * self.sigma) })
    }
}

/// Kinds of figures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// Across the edges, of corners.
    Corner,
    /// Along u and v, of markers.
    Marker,
    /// Along the normal, of markers.
    Normal,
    Edge,
    Diagonal,
    Angle,
    Twist,
}

const KINDS: [Kind; 7] =
    [Kind::Corner, Kind::Marker, Kind::Normal, Kind::Edge, Kind::Diagonal, Kind::Angle, Kind::Twist];

impl Kind {
    /// Returns name and unit in tables and documents.
    fn name_and_unit(self) -> (&'static str, fn(f64) -> f64) {
        match self {
            Self::Corner => ("corner, u or v, mm", mm),
            Self::Marker => ("marker, u or v, mm", mm),
            Self::Normal => ("marker, normal, mm", mm),
            Self::Edge => ("edge, mm", mm),
            Self::Diagonal => ("diagonal, mm", mm),
            Self::Angle => ("angle, degrees", f64::to_degrees),
            Self::Twist => ("twist, degrees", f64::to_degrees),
        }
    }
}

/// One scene, measured.
struct Outcome {
    seed: u64,
    scene: String,
    /// Widest distance of samples across an edge, metres.
    spacing: f64,
    result: Result<Errors, String>,
}

struct Errors {
    stated: Vec<Stated>,
    /// Largest distance of a corner and of a marker.
    corner: f64,
    marker: f64,
    corners_seen: [bool; 4],
}

impl Errors {
    fn of(measurement: &Measurement, outline: &Outline, truth: &Truth) -> Self {
        let surface = &measurement.surface;
        let mut stated = Vec::new();
        let mut distance = |kind: Kind, [u, v]: [f64; 2], at: Vec3, corner: Option<&Corner>| {
            let Place { position, sigma, .. } = evaluate::place(surface, &measurement.location, u, v);
            let sigma = corner.map_or(sigma, |corner| corner_sigma(corner, [u, v], sigma[2]));
            let (off, derivatives) = (position - at, surface.derivatives(u, v));
            for (axis, sigma) in [derivatives.u.normalize(), derivatives.v.normalize()].iter().zip(sigma) {
                stated.push(Stated { kind, error: off.dot(axis), sigma });
            }
            if kind == Kind::Marker {
                stated.push(Stated {
                    kind: Kind::Normal,
                    error: off.dot(&surface.normal(u, v)),
                    sigma: sigma[2],
                });
            }
            off.norm()
        };
        let (w, h) = (surface.width(), surface.height());
        let places = [[0.0, 0.0], [w, 0.0], [w, h], [0.0, h]];
        let corners = places.iter().zip(&truth.corners_m).zip(&outline.corners);
        let corner =
            corners.map(|((uv, p), corner)| distance(Kind::Corner, *uv, Vec3::from(*p), Some(corner)));
        let corner = corner.fold(0.0, f64::max);
        let marker = truth
            .markers
            .iter()
            .map(|m| distance(Kind::Marker, [metres(m.u_mm), metres(m.v_mm)], Vec3::from(m.position_m), None))
            .fold(0.0, f64::max);
        let found = ShapeChecks::new(outline, surface);
        let known = ShapeChecks::new(&true_outline(outline, truth), surface);
        let mut checks = |kind: Kind, found: &[Check], known: &[Check]| {
            stated.extend(found.iter().zip(known).map(|(found, known)| Stated {
                kind,
                error: found.value - known.value,
                sigma: found.sigma,
            }));
        };
        let edges = |checks: &ShapeChecks| checks.edges.map(|edge| edge.mid);
        checks(Kind::Edge, &edges(&found), &edges(&known));
        checks(Kind::Diagonal, &found.diagonals, &known.diagonals);
        checks(Kind::Angle, &found.angles, &known.angles);
        checks(Kind::Twist, &found.twist, &known.twist);
        let doubts = edge_doubts(&found, surface, Blank::rectangle(w, h).edge_lengths());
        Self { stated, corner, marker, corners_seen: corners_seen(outline, &doubts) }
    }

    fn is_gross(&self) -> bool {
        self.corner > GROSS_CORNER || self.marker > GROSS_MARKER
    }
}

/// Returns the standard deviations of a corner along u, v and the normal: the outline's are along the leaving edge and the arriving one.
fn corner_sigma(corner: &Corner, [u, v]: [f64; 2], normal: f64) -> [f64; 3] {
    let [leaving, arriving] = corner.sigma;
    // u runs along the edge that leaves the corners (0, 0) and (W, H).
    if (u > 0.0) == (v > 0.0) { [leaving, arriving, normal] } else { [arriving, leaving, normal] }
}

/// Returns the true outline; the smoothed face of the measured one stands in for the true one, which no figure uses.
fn true_outline(outline: &Outline, truth: &Truth) -> Outline {
    let edges = truth.edges.each_ref().map(|edge| {
        let points: Vec<Vec3> = edge.iter().map(|p| Vec3::from(*p)).collect();
        EdgeCurve { seen: vec![true; points.len()], points, sigma: 0.0 }
    });
    let corners = edges.each_ref().map(|edge| Corner { point: edge.points[0], sigma: [0.0; 2], seen: true });
    Outline { corners, edges, height_field: outline.height_field.clone() }
}

/// Returns the widest distance of neighbouring samples across an edge, metres: `step` is the angle between beams, radians.
fn widest_spacing(truth: &Truth, step: f64) -> f64 {
    let (nu, nv) = (truth.face.nu, truth.face.nv);
    let middle = Vec3::from(truth.face.position_m[nv / 2 * nu + nu / 2]);
    let across = |edge: &Vec<[f64; 3]>| {
        let points: Vec<Vec3> = edge.iter().map(|p| Vec3::from(*p)).collect();
        points.windows(2).map(|pair| spacing(pair[0], pair[1] - pair[0], middle)).fold(0.0, f64::max)
    };
    truth.edges.iter().map(across).fold(0.0, f64::max) * step
}

/// Returns the distance on the plate, across an edge at `at`, per angle between beams.
fn spacing(at: Vec3, along: Vec3, middle: Vec3) -> f64 {
    let along = along.normalize();
    let inwards = middle - at;
    let inward = (inwards - along * inwards.dot(&along)).normalize();
    let (beam, normal) = (at.normalize(), along.cross(&inward));
    let lever = inward - normal * (inward.dot(&beam) / normal.dot(&beam));
    at.norm() * (lever - beam * lever.dot(&beam)).norm()
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
    let load = || stages::flattenings(catalogue, &arguments.flattening[..1]);
    let outcomes = shared(&seeds, arguments.threads, load, |flattenings, seed| {
        progress::phase(&format!("random scene {seed}"));
        let scene = RandomScene::of(arguments.family, *seed);
        let shot = scene.scan(catalogue, folder)?;
        let result = flattenings.first_mut().map_or(Err("no flattening".into()), |f| errors(&shot, f));
        let spacing = widest_spacing(&shot.truth, scene.setting.step_deg.to_radians());
        Ok(Outcome { seed: *seed, scene: scene.words(), spacing, result })
    })?;
    progress::done();
    if !silent {
        print(&outcomes)?;
    }
    Ok(json!({
        "scenes": outcomes.iter().map(document).collect::<Vec<_>>(),
        "summary": KINDS.map(|kind| summary(&outcomes, kind).document()),
    }))
}

fn errors(shot: &Shot, flattening: &mut Flattening) -> Result<Errors, String> {
    let refused = |e: NotMeasured| e.to_string();
    let seen = stages::see(shot).map_err(refused)?;
    let measurement = stages::shape(shot, &seen, flattening).map_err(refused)?;
    Ok(Errors::of(&measurement, &seen.outline, &shot.truth))
}

/// Errors of one kind over all scenes.
struct Summary {
    name: &'static str,
    n: usize,
    /// Median, 95th percentile and largest absolute error, in the unit of the name.
    quantiles: [f64; 3],
    /// Share of errors inside their 95 % interval.
    coverage: f64,
    /// Root mean square of error over standard deviation.
    ratio: f64,
}

fn summary(outcomes: &[Outcome], kind: Kind) -> Summary {
    let (name, unit) = kind.name_and_unit();
    let scenes = outcomes.iter().filter_map(|outcome| outcome.result.as_ref().ok());
    let all: Vec<Stated> = scenes.flat_map(|e| &e.stated).filter(|s| s.kind == kind).copied().collect();
    let mut errors: Vec<f64> = all.iter().map(|s| unit(s.error.abs())).collect();
    errors.sort_by(f64::total_cmp);
    let quantile =
        |share: f64| errors.get((share * errors.len().saturating_sub(1) as f64).round() as usize).copied();
    let inside = all.iter().filter(|s| s.error.abs() <= EXPANDED * s.sigma).count();
    Summary {
        name,
        n: all.len(),
        quantiles: [0.5, 0.95, 1.0].map(|share| quantile(share).unwrap_or(f64::NAN)),
        coverage: inside as f64 / all.len().max(1) as f64,
        ratio: rms(all.iter().map(|s| s.error / s.sigma)),
    }
}

impl Summary {
    fn document(&self) -> Json {
        let [median, most, worst] = self.quantiles;
        json!({
            "of": self.name, "n": self.n, "median": median, "p95": most, "max": worst,
            "coverage": self.coverage, "rms_error_over_sigma": self.ratio,
        })
    }

    fn row(&self) -> Vec<String> {
        let quantiles = self.quantiles.map(|value| format!("{value:.3}"));
        let stated = [format!("{:.1} %", 100.0 * self.coverage), format!("{:.2}", self.ratio)];
        [self.name.to_owned(), self.n.to_string()].into_iter().chain(quantiles).chain(stated).collect()
    }
}

fn document(outcome: &Outcome) -> Json {
    let mut document =
        json!({ "seed": outcome.seed, "scene": outcome.scene, "widest_spacing_mm": mm(outcome.spacing) });
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
    output::line(&format!("\nErrors on {} random scenes, and stated 95 % intervals", outcomes.len()))?;
    let head = ["", "n", "median", "95 %", "max", "inside", "rms/sigma"].map(str::to_owned).to_vec();
    let rows = KINDS.iter().map(|kind| summary(outcomes, *kind).row());
    output::table(&std::iter::once(head).chain(rows).collect::<Vec<_>>())?;
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
            "seed {}: {said}; samples {spacing:.0} mm apart\n  {}",
            outcome.seed, outcome.scene
        ))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_follows_from_its_seed_and_lies_in_the_family() {
        for seed in 0..500 {
            let RandomScene { scene, setting, scanner_m, cyclic_mm, .. } =
                RandomScene::of(Family::Square, seed);
            assert!((-0.2..=1.8).contains(&scanner_m), "{seed}");
            let [w, h, t] = scene.size_mm;
            assert!((2000.0..=5000.0).contains(&w) && (1500.0..=4000.0).contains(&h), "{seed}");
            assert!((25.0..=50.0).contains(&t) && (0.03..=0.055).contains(&setting.step_deg), "{seed}");
            assert!((0.3..=1.5).contains(&setting.noise_mm) && (0.0..=0.3).contains(&cyclic_mm), "{seed}");
            assert_eq!(
                RandomScene::of(Family::Square, seed).words(),
                RandomScene::of(Family::Square, seed).words()
            );
        }
    }

    /// Straight down on a plane, samples lie as far apart as the range times the angle; at 60 degrees across the edge twice as far.
    #[test]
    fn spacing_grows_with_the_incidence_across_the_edge() {
        let down = spacing(Vec3::new(0.0, 0.0, -5.0), Vec3::y(), Vec3::new(-1.0, 0.0, -5.0));
        assert!((down - 5.0).abs() < 1e-12);
        let far = Vec3::new(3.0_f64.sqrt() * 2.0, 0.0, -2.0);
        let oblique = spacing(far, Vec3::y(), far - Vec3::x());
        assert!((oblique - 4.0 * 2.0).abs() < 1e-9, "{oblique}");
    }
}
