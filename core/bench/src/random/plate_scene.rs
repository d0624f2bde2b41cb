//! Random scene: plate, pose, scanner and its errors, drawn from a seed.

use std::path::Path;

use fastrand::Rng;
use platen_engine::plugin::Catalogue;
use platen_host::cli::CliError;
use platen_host::cli::bench::Family;
use platen_model::{Facing, RadiusOf, Target, TargetShape};
use platen_plant::Value;
use platen_shape::Vec3;

use crate::accuracy::Truth;
use crate::scene::{Scene, Setting, Shot};

/// Height of the plate's middle under the simulator's scanner, millimetres: high enough above the floor for every
/// shape.
const PLATE_MM: f64 = -3200.0;
/// Reflectivities of the plate: dark mill scale to primer; the walls of the simulator have 0.8, its floor 0.3.
const REFLECTIVITY: [f64; 2] = [0.1, 0.6];
/// Share of wide range errors and their factor in the family of that name.
const TAILS: [f64; 2] = [0.05, 4.0];
/// Standard deviation of the sagitta of an edge 3 m long, millimetres, in the family of bowed edges: the camber of the
/// prior of the edge curve (`outline::edge`).
const BOW_MM: f64 = 1.0;
/// Radii of a target, as a share of the plate's: a plate that is not bent enough, and one that is bent too far.
const TARGET_SHARES: [f64; 2] = [0.95, 1.05];
/// Radius of the target of a plate with bend bands, metres: the mean of its curvature between them.
const BANDS_RADIUS: f64 = 15.0;

/// Largest movement of the plate along x and y, millimetres, and largest turn, degrees, between repeated scans: the
/// position on the lattice changes, the incidence does not.
const MOVED_MM: f64 = 30.0;
const TURNED_DEG: f64 = 0.5;

/// Properties that are the same in all scenes instead of drawn.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Given {
    /// Amplitude of the cyclic range error, millimetres.
    pub(super) cyclic_mm: Option<f64>,
    /// Reflectivity of the plate.
    pub(super) reflectivity: Option<f64>,
}

/// A scene of a family.
pub(super) struct RandomScene {
    pub(super) scene: Scene,
    /// Shape toward which the plate is bent: its own, with other radii.
    pub(super) target: Target,
    /// Share of wide range errors and their factor.
    tails: [f64; 2],
    /// Angle by which the table is visible beyond the far edges, degrees; 0: a wide table.
    strip_deg: f64,
    /// Cross section of the beam, as the driver names it.
    beam: &'static str,
    pub(super) setting: Setting,
    reflectivity: f64,
    /// Height of the scanner above that of the simulator's shop, metres.
    scanner_m: f64,
    pub(super) cyclic_mm: f64,
    hidden_by: &'static str,
}

impl RandomScene {
    /// Draws the scene of a seed. The same seed gives the same scene in every family, except for edges, errors and
    /// hidden parts.
    pub(super) fn of(family: Family, given: Given, seed: u64) -> Self {
        let mut random = Rng::with_seed(seed ^ 0x7363_656e_6573);
        let mut between = |low: f64, high: f64| low + (high - low) * random.f64();
        let size_mm = [between(2000.0, 5000.0), between(1500.0, 4000.0), between(25.0, 50.0)].map(f64::round);
        let centre_mm = [between(6000.0, 11_000.0).round(), 0.0, PLATE_MM];
        let scanner_m = between(3.0, 5.0) + 0.001 * PLATE_MM;
        let yaw_deg = between(-180.0, 180.0).round();
        let (step_deg, noise_mm) = (between(0.03, 0.055), between(0.3, 1.5));
        // Double curvature is limited to that of tank plates: beyond it the strain of the edges exceeds the difference
        // by which a plate of another size is recognised.
        let longer = 0.001 * size_mm[0].max(size_mm[1]);
        let (radius, cross) = (between(5.0, 20.0), longer * between(3.8, 8.0));
        let axis = between(0.0, 180.0).round();
        let cyclic = between(0.0, 0.3);
        let sign = if random.bool() { 1.0 } else { -1.0 };
        let mm = |metres: f64| sign * (1000.0 * metres).round();
        let share = TARGET_SHARES[(seed % 2) as usize];
        let along = axis.to_radians();
        let (name, shape, target) = match random.u32(0..7) {
            0 => ("flat", "shape = \"flat\"".to_owned(), TargetShape::Flat),
            1 => (
                "cylinder",
                format!("shape = \"cylinder\"\nradius_mm = {:?}\naxis_deg = {axis:?}", mm(radius)),
                TargetShape::Cylinder { radius: share * radius, axis: along },
            ),
            2 => (
                "cone",
                format!(
                    "shape = \"cone\"\naxis_deg = {axis:?}\nradius_start_mm = {:?}\nradius_end_mm = {:?}",
                    mm(cross),
                    mm(1.4 * cross)
                ),
                TargetShape::Cone {
                    axis: along,
                    radius_start: share * cross,
                    radius_end: share * 1.4 * cross,
                },
            ),
            3 => (
                "sphere",
                format!("shape = \"sphere\"\nradius_mm = {:?}", mm(cross)),
                TargetShape::Sphere { radius: share * cross },
            ),
            4 => (
                "torus",
                format!(
                    "shape = \"torus\"\naxis_deg = {axis:?}\nradius_mm = {:?}\ncross_radius_mm = {:?}",
                    mm(cross),
                    mm(1.5 * cross)
                ),
                TargetShape::Torus { axis: along, radius: share * cross, cross_radius: share * 1.5 * cross },
            ),
            5 => (
                "half-bent",
                format!(
                    "shape = \"steps\"\naxis_deg = {axis:?}\ncurvature_per_m = {:?}\n\
                     steps = [{{ at_mm = 100.0, width_mm = 300.0, change_per_m = {:?} }}]",
                    sign / radius,
                    -sign / radius
                ),
                TargetShape::Cylinder { radius, axis: along },
            ),
            _ => (
                "bands",
                format!(
                    "shape = \"bands\"\naxis_deg = {axis:?}\nbands = [{{ at_mm = -500.0, width_mm = 300.0, angle_deg = {0:?} }}, \
                     {{ at_mm = 400.0, width_mm = 300.0, angle_deg = {0:?} }}]",
                    sign * 1.4
                ),
                TargetShape::Cylinder { radius: BANDS_RADIUS, axis: along },
            ),
        };
        let scanned_face = if sign > 0.0 { Facing::Inside } else { Facing::Outside };
        let target = Target { shape: target, radius_of: RadiusOf::Mid, scanned_face };
        let hidden_by = *random
            .choice(&["nothing", "nothing", "person", "chain", "nothing", "both"])
            .unwrap_or(&"nothing");
        let drawn_mm = if random.u32(0..3) == 0 { cyclic } else { 0.0 };
        let cyclic_mm = given.cyclic_mm.unwrap_or(drawn_mm);
        let setting = Setting { step_deg, noise_mm, ..Setting::of_accuracy(noise_mm, seed) };
        let bevel_mm = if family == Family::Bevel { bevel(&mut random, size_mm[2]) } else { [0.0; 2] };
        let bows_mm = if family == Family::Bowed { bows(&mut random, size_mm) } else { [0.0; 4] };
        let tails = if family == Family::Tails { TAILS } else { [0.0, 1.0] };
        let strip_deg = if family == Family::Strip { step_deg * (1.0 + random.f64()) } else { 0.0 };
        let hidden_by = if family == Family::Hidden { "person at corner" } else { hidden_by };
        let scene = Scene { name: name.into(), size_mm, shape, centre_mm, bevel_mm, bows_mm, yaw_deg };
        let [dark, bright] = REFLECTIVITY;
        // From a separate generator, so that scenes equal those of versions that did not draw this value.
        let drawn = dark * (bright / dark).powf(Rng::with_seed(!seed).f64());
        let reflectivity = given.reflectivity.unwrap_or(drawn);
        let beam = match family {
            Family::Wings => "winged",
            Family::Rays => "few rays",
            _ => "truncated",
        };
        Self { scene, target, tails, strip_deg, beam, setting, reflectivity, scanner_m, cyclic_mm, hidden_by }
    }

    /// Returns the scene for repeated scan `number`, 0 being the scene itself: with other noise, the plate moved by up
    /// to [`MOVED_MM`] and turned by up to [`TURNED_DEG`].
    pub(super) fn repeated(mut self, number: u64) -> Self {
        if number > 0 {
            self.setting.seed ^= number << 32;
            let mut random = Rng::with_seed(self.setting.seed);
            let mut within = |most: f64| most * (2.0 * random.f64() - 1.0);
            self.scene.centre_mm[0] += within(MOVED_MM);
            self.scene.centre_mm[1] += within(MOVED_MM);
            self.scene.yaw_deg += within(TURNED_DEG);
        }
        self
    }

    /// Scans the scene.
    pub(super) fn scan(&self, catalogue: &Catalogue, folder: &Path) -> Result<Shot, CliError> {
        let more = [
            ("scanner_m", Value::Floats(vec![0.0, 0.0, self.scanner_m])),
            ("cyclic_mm", Value::Float(self.cyclic_mm)),
            ("wide_share", Value::Float(self.tails[0])),
            ("wide_factor", Value::Float(self.tails[1])),
            ("plate_reflectivity", Value::Float(self.reflectivity)),
            ("strip_deg", Value::Float(self.strip_deg)),
            ("beam", Value::String(self.beam.to_owned())),
            ("hidden_by", Value::String(self.hidden_by.to_owned())),
        ];
        self.scene.scan(catalogue, folder, self.setting, &more)
    }

    /// Describes the scene in one line.
    pub(super) fn words(&self) -> String {
        let [w, h, t] = self.scene.size_mm;
        let [x, ..] = self.scene.centre_mm;
        let strip =
            if self.strip_deg > 0.0 { format!(", strip {:.3} deg", self.strip_deg) } else { String::new() };
        let edges = match (self.scene.bevel_mm, self.scene.bows_mm) {
            ([0.0, _], [0.0, ..]) => String::new(),
            ([0.0, _], bows) => format!(", bows {bows:.1?}"),
            ([inset, root], _) => format!(", face inset {inset}, root face {root}"),
        };
        format!(
            "{} {w:.0} x {h:.0} x {t:.0}{edges}, {:.1} m away, {:.1} m high, yaw {:.0}, {:.3} deg, reflectivity {:.2}, noise {:.1}, cyclic {:.2}, hidden by {}{strip}",
            self.scene.name,
            0.001 * x,
            self.scanner_m - 0.001 * PLATE_MM,
            self.scene.yaw_deg,
            self.setting.step_deg,
            self.reflectivity,
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

/// Draws the sagittas of the edges of a plate, millimetres, uniform with the standard deviation of the prior. That of a
/// constant curvature grows with the square of the length.
fn bows(random: &mut Rng, [width, height, _]: [f64; 3]) -> [f64; 4] {
    let reach = 3.0_f64.sqrt() * BOW_MM;
    [width, height, width, height]
        .map(|length| reach * (length / 3000.0).powi(2) * (2.0 * random.f64() - 1.0))
}

/// Returns the largest distance of neighbouring samples across an edge, metres: `step` is the angle between beams,
/// radians.
pub(super) fn widest_spacing(truth: &Truth, step: f64) -> f64 {
    let (nu, nv) = (truth.face.nu, truth.face.nv);
    let middle = Vec3::from(truth.face.position_m[nv / 2 * nu + nu / 2]);
    let across = |edge: &Vec<[f64; 3]>| {
        let points: Vec<Vec3> = edge.iter().map(|p| Vec3::from(*p)).collect();
        points.windows(2).map(|pair| spacing(pair[0], pair[1] - pair[0], middle)).fold(0.0, f64::max)
    };
    truth.edges.iter().map(across).fold(0.0, f64::max) * step
}

/// Returns the distance on the plate across an edge at `at` per angle between beams.
fn spacing(at: Vec3, along: Vec3, middle: Vec3) -> f64 {
    let along = along.normalize();
    let inwards = middle - at;
    let inward = (inwards - along * inwards.dot(&along)).normalize();
    let (beam, normal) = (at.normalize(), along.cross(&inward));
    let lever = inward - normal * (inward.dot(&beam) / normal.dot(&beam));
    at.norm() * (lever - beam * lever.dot(&beam)).norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_follows_from_its_seed_and_lies_in_the_family() {
        for seed in 0..500 {
            let RandomScene { scene, setting, reflectivity, scanner_m, cyclic_mm, .. } =
                RandomScene::of(Family::Square, Given::default(), seed);
            assert!((-0.2..=1.8).contains(&scanner_m), "{seed}");
            let [w, h, t] = scene.size_mm;
            assert!((2000.0..=5000.0).contains(&w) && (1500.0..=4000.0).contains(&h), "{seed}");
            assert!((25.0..=50.0).contains(&t) && (0.03..=0.055).contains(&setting.step_deg), "{seed}");
            assert!((0.3..=1.5).contains(&setting.noise_mm) && (0.0..=0.3).contains(&cyclic_mm), "{seed}");
            assert!((0.1..=0.6).contains(&reflectivity), "{seed}");
            assert_eq!(
                RandomScene::of(Family::Square, Given::default(), seed).words(),
                RandomScene::of(Family::Square, Given::default(), seed).words()
            );
        }
    }

    #[test]
    fn a_bowed_scene_is_the_square_one_with_bows_of_the_stated_deviation() {
        let (mut sum, mut n) = (0.0, 0.0);
        for seed in 0..500 {
            let of = |family| RandomScene::of(family, Given::default(), seed);
            let (square, bowed) = (of(Family::Square).scene, of(Family::Bowed).scene);
            assert_eq!(
                (square.size_mm, &square.shape, square.yaw_deg),
                (bowed.size_mm, &bowed.shape, bowed.yaw_deg)
            );
            let [width, height, _] = bowed.size_mm;
            for (bow, length) in bowed.bows_mm.into_iter().zip([width, height, width, height]) {
                sum += (bow * (3000.0 / length).powi(2)).powi(2);
                n += 1.0;
            }
        }
        let deviation: f64 = f64::sqrt(sum / n);
        assert!((deviation - BOW_MM).abs() < 0.03, "{deviation}");
    }

    #[test]
    fn a_repeated_scan_has_other_noise_and_nearly_the_same_place() {
        let of = |number| RandomScene::of(Family::Square, Given::default(), 7).repeated(number);
        let (itself, first, again) = (of(0), of(1), of(1));
        assert_eq!(itself.words(), RandomScene::of(Family::Square, Given::default(), 7).words());
        assert_eq!(first.scene.centre_mm, again.scene.centre_mm);
        assert_ne!(first.setting.seed, itself.setting.seed);
        let moved = first.scene.centre_mm[0] - itself.scene.centre_mm[0];
        assert!(moved != 0.0 && moved.abs() <= MOVED_MM, "{moved}");
        let turned = first.scene.yaw_deg - itself.scene.yaw_deg;
        assert!(turned != 0.0 && turned.abs() <= TURNED_DEG, "{turned}");
    }

    /// Straight down on a plane, the distance of samples is the range times the angle; at 60 degrees across the edge it
    /// is twice that.
    #[test]
    fn spacing_grows_with_the_incidence_across_the_edge() {
        let down = spacing(Vec3::new(0.0, 0.0, -5.0), Vec3::y(), Vec3::new(-1.0, 0.0, -5.0));
        assert!((down - 5.0).abs() < 1e-12);
        let far = Vec3::new(3.0_f64.sqrt() * 2.0, 0.0, -2.0);
        let oblique = spacing(far, Vec3::y(), far - Vec3::x());
        assert!((oblique - 4.0 * 2.0).abs() < 1e-9, "{oblique}");
    }
}
