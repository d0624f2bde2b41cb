//! Tests with known movements, bands and null pairs on closed-form plates.

use nalgebra::Rotation3;
use platen_model::{Support, Task};
use platen_shape::Vec3;
use platen_shape::surface::{Mask, SplineFit, UniformKnots};

use super::*;

const WIDTH: f64 = 3.0;
const HEIGHT: f64 = 2.0;

/// Noise of 24,000 points that is equivalent to 0.5 mm on the 167,000 points of a scan at 6 mm.
const SIGMA: f64 = 0.19e-3;

/// Returns a generator. Generators with consecutive seeds are correlated, so the seeds are spread out.
fn spread(seed: u64) -> fastrand::Rng {
    fastrand::Rng::with_seed(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15))
}

struct Noise(fastrand::Rng);

impl Noise {
    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.0.f64()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.0.f64()).cos()
    }
}

/// Returns mid-surface and normal of a plate bent along u: radius 9 m, and `extra` radians more over 0.3 m around u =
/// 2.
fn shape(extra: f64) -> impl Fn(f64) -> (Vec3, Vec3) {
    let n = 6000;
    let h = WIDTH / f64::from(n);
    let curvature = move |u: f64| {
        let x = ((u - 2.0) / 0.3 + 0.5).clamp(0.0, 1.0);
        1.0 / 9.0 + extra / 0.3 * (1.0 - (std::f64::consts::TAU * x).cos())
    };
    let mut profile = vec![(0.0, 0.0, 0.0_f64)];
    for i in 0..n {
        let (x, z, angle) = profile[i as usize];
        let middle = angle + 0.5 * h * curvature((f64::from(i) + 0.25) * h);
        let next = angle + h * curvature((f64::from(i) + 0.5) * h);
        profile.push((x + h * middle.cos(), z + h * middle.sin(), next));
    }
    move |u| {
        let (x, z, angle) = profile[(u / h).round() as usize];
        (Vec3::new(x, 0.0, z), Vec3::new(-angle.sin(), 0.0, angle.cos()))
    }
}

/// Returns a scan of that plate: noise along the normal, and an error `wave(u, v)` that is not in the fit's covariance.
fn plate(sigma: f64, seed: u64, extra: f64, wave: impl Fn(f64, f64) -> f64) -> Surface {
    let mut noise = Noise(spread(seed));
    let shape = shape(extra);
    let mut fit = SplineFit::new(UniformKnots::new(0.0, WIDTH, 48), UniformKnots::new(0.0, HEIGHT, 32));
    for i in 0..24_000 {
        let (u, v) =
            ((f64::from(i % 200) + 0.5) * WIDTH / 200.0, (f64::from(i / 200) + 0.5) * HEIGHT / 120.0);
        let (p, n) = shape(u);
        let p = p + Vec3::y() * v + n * (sigma * noise.normal() + wave(u, v));
        fit.add(u, v, p.into(), sigma.powi(-2));
    }
    let mut mask = Mask::unseen(WIDTH, HEIGHT, 0.1);
    (0..600).for_each(|i| mask.mark(0.1 * (f64::from(i % 30) + 0.5), 0.1 * (f64::from(i / 30) + 0.5)));
    Surface::new(fit.solve([0.0, 0.0, 1.0]).expect("determined"), 0.04, mask)
}

/// Returns the plate in another pose.
fn moved(surface: &Surface, turn: Rotation3<f64>, away: Vec3) -> Surface {
    let mut parts = surface.to_parts();
    for p in &mut parts.control {
        *p = (turn * Vec3::from(*p) + away).into();
    }
    Surface::from_parts(parts).expect("sound")
}

fn task(sigma_correlated: f64) -> Task {
    Task {
        plate: "P".into(),
        width: WIDTH,
        height: HEIGHT,
        thickness: 0.04,
        target: None,
        reference_lines: Vec::new(),
        templates: Vec::new(),
        stations: Vec::new(),
        sigma_correlated,
        sigma_true: None,
        supports: Vec::new(),
        supports_changed: false,
    }
}

fn run(now: Surface, before: Surface, alignment: &str, sigma_correlated: f64, min_patch: f64) -> Report {
    let inputs = Inputs { task: task(sigma_correlated), now, before: Some(before), baseline: None };
    let options = Options { against: "before".into(), alignment: alignment.into(), min_patch };
    compare(&options, &inputs, &|| Ok(())).expect("sound")
}

#[test]
fn a_plate_on_its_supports_is_aligned_by_them() {
    let before = plate(SIGMA, 11, 0.0, none);
    let turn = Rotation3::from_euler_angles(0.01, -0.02, 0.1);
    let now = moved(&plate(SIGMA, 12, 0.02, none), turn, Vec3::new(0.2, 0.1, 0.05));
    let task = |supports: &[[f64; 2]]| {
        let task = Task { supports: supports.iter().map(|&at| Support { at }).collect(), ..task(0.0) };
        Inputs { task, now: now.clone(), before: Some(before.clone()), baseline: None }
    };
    let options = Options { against: "before".into(), alignment: "supports".into(), min_patch: 0.02 };
    // Supports on both sides of the new bend: both sides have moved, but the supports have not.
    let places = [[0.3, 0.3], [0.3, 1.7], [2.7, 0.3], [2.7, 1.7]];
    let report = compare(&options, &task(&places), &|| Ok(())).expect("sound");
    let normal = &report.fields[1].values;
    for [u, v] in places {
        let node = (50.0 * v).round() as usize * PlateGrid::SIDE + (u * 100.0 / 3.0).round() as usize;
        // Found: 0.012 mm, the noise of the fits.
        assert!(normal[node].abs() < 0.025e-3, "{u} {v}: {}", normal[node]);
    }
    // 0.02 rad around u = 2, held at 0.3 and 2.7: it sinks there by 0.02 * 1.7 * 0.7 / 2.4.
    let bend = normal[50 * PlateGrid::SIDE + 67];
    // Found: 0.44 mm off, by the roundness of the bend.
    assert!((bend + 0.02 * 1.7 * 0.7 / 2.4).abs() < 0.5e-3, "{bend}");
    assert!(report.findings.says[0].contains("aligned by supports"), "{:?}", report.findings.says);
    let error = compare(&options, &task(&places[..2]), &|| Ok(())).expect_err("refused");
    assert!(
        error
            .to_string()
            .starts_with("alignment supports: 2 of the 2 supports given are in sight, 3 are needed")
    );
}

fn value(report: &Report, name: &str) -> f64 {
    report.findings.figures.iter().find(|f| f.name == name).unwrap_or_else(|| panic!("no {name}")).value
}

fn none(_: f64, _: f64) -> f64 {
    0.0
}

#[test]
fn a_plate_that_only_moved_did_not_change_and_its_movement_is_reported() {
    let before = plate(SIGMA, 1, 0.0, none);
    let turn = Rotation3::from_euler_angles(0.02, -0.01, 0.3);
    let away = Vec3::new(0.4, -0.2, 0.05);
    let now = moved(&plate(SIGMA, 2, 0.0, none), turn, away);
    for alignment in ["unchanged", "corners"] {
        let report = run(now.clone(), before.clone(), alignment, 0.0, 0.02);
        // Found: 0.014 mrad, and below 0.0023 mm, with the corners; less with the whole plate.
        assert!((value(&report, "displacement.plate_rotation") - turn.angle()).abs() < 3e-5, "{alignment}");
        let middle = before.face(WIDTH / 2.0, HEIGHT / 2.0);
        let way = (turn * middle + away - middle).norm();
        assert!((value(&report, "displacement.plate_translation") - way).abs() < 5e-6, "{alignment}");
        let size = report.fields[1].values.iter().map(|d| d * d).sum::<f64>() / 10_201.0;
        println!("{alignment}: {:.3} mm rms along the normal", size.sqrt() * 1e3);
        // Found: 0.007 and 0.010 mm, the noise of both fits.
        assert!(size.sqrt() < 0.02e-3, "{alignment} {size}");
    }
}

#[test]
fn a_new_bend_lifts_one_side_and_leaves_the_other() {
    let extra = 0.02;
    let before = plate(SIGMA, 3, 0.0, none);
    let turn = Rotation3::from_euler_angles(0.01, 0.02, -0.2);
    let now = moved(&plate(SIGMA, 4, extra, none), turn, Vec3::new(1.0, 0.3, 0.1));
    let report = run(now, before, "unchanged", 0.0, 0.02);
    let (vectors, normal) = (&report.fields[0], &report.fields[1]);
    // The larger part, up to u = 1.85, is at rest; beyond the bend the plate is turned by 0.02.
    let (old, new) = (shape(0.0), shape(extra));
    let (mut square, mut square_vector, mut still, mut changed) = (0.0, 0.0, 0, 0);
    for i in 0..PlateGrid::NODES {
        let u = WIDTH * (i % PlateGrid::SIDE) as f64 / 100.0;
        let face = |(p, n): (Vec3, Vec3)| p + n * 0.02;
        let (true_now, true_then) = (face(new(u)), face(old(u)));
        let truth = turn * (true_now - true_then);
        let found = Vec3::new(vectors.values[3 * i], vectors.values[3 * i + 1], vectors.values[3 * i + 2]);
        square += (normal.values[i] - truth.dot(&(turn * new(u).1))).powi(2);
        square_vector += (found - truth).norm_squared();
        still += usize::from(u < 1.7 && vectors.state[i] == NodeState::Unchanged);
        changed += usize::from(u > 2.3 && vectors.state[i] == NodeState::Seen);
    }
    let rms = |square: f64| (square / PlateGrid::NODES as f64).sqrt();
    println!("normal {:.3} mm rms, vector {:.3} mm rms", rms(square) * 1e3, rms(square_vector) * 1e3);
    // Found: 0.011 and 0.014 mm, the noise of both fits; all nodes in the right state.
    assert!(rms(square) < 0.023e-3 && rms(square_vector) < 0.028e-3);
    assert!(still as f64 > 0.98 * 57.0 * 101.0 && changed as f64 > 0.98 * 24.0 * 101.0, "{still} {changed}");
    assert!(report.findings.says[0].contains("aligned by unchanged"), "{:?}", report.findings.says);
}

/// Returns the changes between pairs of scans of one shape: 0.5 mm noise, a small shift of the pose, and a wave of
/// `amplitude` whose phase and direction differ between the two.
fn null_pairs(seeds: std::ops::Range<u64>, amplitude: f64, sigma_correlated: f64) -> Vec<detect::Changes> {
    let mut random = fastrand::Rng::with_seed(seeds.start);
    let mut scan = |seed: u64| {
        let [phase, along, across] = [random.f64(), 2.0 * random.f64() - 1.0, 2.0 * random.f64() - 1.0];
        let wave =
            |u: f64, v: f64| amplitude * (std::f64::consts::TAU * (along * u + across * v + phase)).sin();
        let turn = Rotation3::from_euler_angles(1e-4 * random.f64(), 1e-4 * random.f64(), 0.0);
        moved(&plate(SIGMA, seed, 0.01, wave), turn, Vec3::new(0.0, 0.0, 1e-3 * random.f64()))
    };
    let pairs = seeds.map(|seed| [scan(2 * seed), scan(2 * seed + 1)]);
    let changes = pairs.map(|[now, before]| {
        let nodes = Nodes::new(&now, &before, sigma_correlated);
        let (motion, weights) = align::unchanged(&|| Ok(()), &nodes).expect("not cancelled");
        detect::changes(&nodes, &Alignment { motion, weights, name: "unchanged" }, 0.0)
    });
    changes.collect()
}

/// Returns the number of null pairs. Each scatters by 0.05, so 20 are weak evidence; `PLATEN_NULL_PAIRS=200` takes a
/// minute.
fn wanted() -> u64 {
    std::env::var("PLATEN_NULL_PAIRS").ok().and_then(|n| n.parse().ok()).unwrap_or(20)
}

fn share_above_lod(pairs: &[detect::Changes]) -> f64 {
    pairs.iter().map(|pair| pair.above_lod).sum::<f64>() / pairs.len() as f64
}

/// Returns three figures: the false change without calibration; the correlated error with which null pairs show 5 % of
/// their area, as `platen calibrate` finds it; the false change of other pairs with that calibration.
fn calibrated(seeds: u64, amplitude: f64, judged: u64) -> [f64; 3] {
    let shown = |sigma: f64| share_above_lod(&null_pairs(seeds..seeds + judged * 3 / 5, amplitude, sigma));
    let uncalibrated = shown(0.0);
    let (mut low, mut high) = (0.0, 2.0 * amplitude);
    for _ in 0..7 {
        let middle = 0.5 * (low + high);
        *(if shown(middle) > 0.05 { &mut low } else { &mut high }) = middle;
    }
    let sigma_correlated = high;
    let judged =
        share_above_lod(&null_pairs(seeds + 1000..seeds + 1000 + judged, amplitude, sigma_correlated));
    println!(
        "wave of {:.2} mm: false change {uncalibrated:.3}; calibrated to {:.3} mm: {judged:.3}",
        amplitude * 1e3,
        sigma_correlated * 1e3
    );
    [uncalibrated, sigma_correlated, judged]
}

#[test]
fn null_pairs_show_five_percent_of_the_area() {
    let wanted = wanted();
    let bound = if wanted < 200 { 0.02..0.08 } else { 0.04..0.06 };
    for (seeds, amplitude) in [(1000, 0.0), (3000, 0.1e-3)] {
        let [before, sigma, after] = calibrated(seeds, amplitude, wanted);
        // Two waves of any phase differ by this much, less the part that the alignment absorbs.
        assert!((0.6 * amplitude..amplitude.max(0.02e-3)).contains(&sigma), "{sigma}");
        // Noise alone needs no calibration.
        assert!(amplitude > 0.0 || bound.contains(&before), "{before}");
        assert!(bound.contains(&after), "wave of {amplitude}: {before} before, {after} after");
    }
}

#[test]
fn no_patch_of_a_null_pair_is_a_change() {
    let wanted = wanted();
    let pairs = null_pairs(5000..5000 + wanted, 0.0, 0.0);
    let n = pairs.iter().filter(|pair| pair.state.contains(&NodeState::Seen)).count();
    println!("{n} of {wanted} null pairs show a patch of change");
    // One in twenty at most; three standard deviations above that are 4 of 20, 20 of 200.
    let most = 0.05 * wanted as f64;
    assert!((n as f64) < most + 3.0 * (0.95 * most).sqrt(), "{n} of {wanted}");
}

/// Returns the detected share of a plateau over a twelfth of the plate that rises by `times` the level of detection,
/// between pairs of scans with waves of `amplitude`, by a scanner calibrated to `sigma_correlated`.
fn found(times: f64, amplitude: f64, sigma_correlated: f64) -> f64 {
    let mut random = fastrand::Rng::with_seed(77);
    let mut wave = || {
        let [phase, along, across] = [random.f64(), 2.0 * random.f64() - 1.0, 2.0 * random.f64() - 1.0];
        move |u: f64, v: f64| amplitude * (std::f64::consts::TAU * (along * u + across * v + phase)).sin()
    };
    let run = |now: Surface, before: Surface| run(now, before, "unchanged", sigma_correlated, 0.02);
    let lod = value(&run(plate(SIGMA, 600, 0.0, none), plate(SIGMA, 601, 0.0, none)), "displacement.lod");
    let step = |x: f64| x.clamp(0.0, 1.0).powi(2) * (3.0 - 2.0 * x.clamp(0.0, 1.0));
    let edge = move |x: f64, from: f64, to: f64| step((x - from) / 0.4) * step((to - x) / 0.4);
    let on_plateau = |i: &usize| {
        let (u, v) = (3.0 * (i % PlateGrid::SIDE) as f64 / 100.0, 2.0 * (i / PlateGrid::SIDE) as f64 / 100.0);
        (0.55..=1.15).contains(&u) && (0.65..=1.25).contains(&v)
    };
    let plateau: Vec<usize> = (0..PlateGrid::NODES).filter(on_plateau).collect();
    let (pairs, mut found) = (24, 0);
    for seed in 0..pairs {
        let (then, after) = (wave(), wave());
        let now = |u: f64, v: f64| times * lod * edge(u, 0.1, 1.6) * edge(v, 0.2, 1.7) + after(u, v);
        let report = run(plate(SIGMA, 700 + seed, 0.0, now), plate(SIGMA, 500 + seed, 0.0, then));
        found += plateau.iter().filter(|i| report.fields[1].state[**i] == NodeState::Seen).count();
    }
    let share = found as f64 / (pairs as usize * plateau.len()) as f64;
    println!("{times} times {:.3} mm, waves of {:.1} mm: found in {share:.3}", 1e3 * lod, 1e3 * amplitude);
    share
}

#[test]
fn a_change_beyond_the_level_of_detection_is_found() {
    // Found: 0.998. Over flanks of 0.15 m the fits smooth so small a change: 0.84.
    assert!(found(3.0, 0.0, 0.0) > 0.95);
    // The sigma with which waves of 0.3 mm show 5 % of the area in null pairs. Found: 0.855.
    assert!(found(2.0, 0.3e-3, 0.347e-3) > 0.8);
}

#[test]
fn another_plate_is_refused_and_no_plate_is_said() {
    let now = plate(SIGMA, 8, 0.0, none);
    let mut parts = now.to_parts();
    parts.knots_v.iter_mut().for_each(|knot| *knot *= 1.1);
    let other = Surface::from_parts(parts).expect("sound");
    let inputs = Inputs { task: task(0.0), now, before: Some(other), baseline: None };
    assert!(inputs.earlier("before").expect_err("refused").to_string().contains("not the same plate"));
    assert!(inputs.earlier("baseline").expect("nothing is wrong with none").is_none());
}
