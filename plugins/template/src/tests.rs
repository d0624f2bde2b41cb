//! Tests of whole comparisons on closed-form plates.

mod calibrated;
mod contact;
mod malformed;
mod noise;
mod whole;

use platen_model::{
    Centre, Facing, RadiusOf, ReferenceLine, Seat, Target, TargetShape, Task, Template, TemplateFinding,
    Verdict,
};
use platen_shape::surface::{Mask, SplineFit, UniformKnots};
use platen_shape::{Surface, TargetSurface, Vec3};

use super::*;

const WIDTH: f64 = 3.0;
const HEIGHT: f64 = 2.0;
const THICKNESS: f64 = 0.04;

/// Returns a generator. Generators with consecutive seeds are correlated, so the seeds are spread out.
fn spread(seed: u64) -> fastrand::Rng {
    fastrand::Rng::with_seed(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15))
}

/// Returns a fit to points of the mid-surface with noise along the normal, with everything seen.
fn surface(n_points: usize, sigma: f64, seed: u64, plate: impl Fn(f64, f64) -> (Vec3, Vec3)) -> Surface {
    let mut random = spread(seed);
    let mut normal = || {
        let radius = (-2.0 * (1.0 - random.f64()).ln()).sqrt();
        radius * (std::f64::consts::TAU * random.f64()).cos()
    };
    let mut fit = SplineFit::new(UniformKnots::new(0.0, WIDTH, 30), UniformKnots::new(0.0, HEIGHT, 20));
    let columns = (n_points as f64 * WIDTH / HEIGHT).sqrt() as usize;
    let rows = n_points / columns;
    for k in 0..columns * rows {
        let at = |k: usize, n: usize, length: f64| length * (k as f64 + 0.5) / n as f64;
        let (u, v) = (at(k % columns, columns, WIDTH), at(k / columns, rows, HEIGHT));
        let (p, n) = plate(u, v);
        fit.add(u, v, (p + n * (sigma * normal())).into(), sigma.powi(-2));
    }
    let mut mask = Mask::unseen(WIDTH, HEIGHT, 0.05);
    for k in 0..60 * 40 {
        mask.mark(0.05 * (f64::from(k % 60) + 0.5), 0.05 * (f64::from(k / 60) + 0.5));
    }
    Surface::new(fit.solve([0.0, 0.0, 1.0]).expect("determined"), THICKNESS, mask)
}

/// Returns a plate of a shape, almost without noise, in the pose of a plate before a scanner.
fn plate_of(shape: TargetShape, facing: Facing) -> Surface {
    let target = goal(shape, facing);
    let turn = nalgebra::Rotation3::from_euler_angles(0.4, -0.7, 1.9);
    let away = Vec3::new(5.0, -3.0, 1.2);
    surface(20_000, 1e-6, 1, |u, v| (turn * target.point(u, v) + away, turn * target.normal(u, v)))
}

/// Returns the plate with a strip across u that was not seen.
fn hidden(now: &Surface, from: f64, to: f64) -> Surface {
    let mut parts = now.to_parts();
    let [n_u, n_v] = parts.mask_cells;
    for k in 0..n_u * n_v {
        let u = WIDTH * ((k % n_u) as f64 + 0.5) / n_u as f64;
        parts.seen[k] &= !(from..to).contains(&u);
    }
    Surface::from_parts(parts).expect("sound")
}

/// Returns a target whose radii are those of the mid-surface, so that a plate and its target differ by the radius
/// alone.
fn goal(shape: TargetShape, scanned_face: Facing) -> TargetSurface {
    let target = Target { shape, radius_of: RadiusOf::Mid, scanned_face };
    TargetSurface::new(&target, WIDTH, HEIGHT, THICKNESS).expect("sound")
}

fn task(shape: TargetShape, scanned_face: Facing, seat: Seat) -> Task {
    Task {
        plate: "P".into(),
        width: WIDTH,
        height: HEIGHT,
        thickness: THICKNESS,
        target: Some(Target { shape, radius_of: RadiusOf::Mid, scanned_face }),
        reference_lines: vec![ReferenceLine { name: "R1".into(), from: [0.0, 1.0], to: [WIDTH, 1.0] }],
        templates: vec![Template {
            name: "T1".into(),
            line: "R1".into(),
            chord: 2.0,
            centre: Centre::At(1.5),
            limit: 0.003,
            seat,
            source: None,
        }],
        stations: Vec::new(),
        sigma_correlated: 0.0,
        sigma_true: None,
        supports: Vec::new(),
        supports_changed: false,
    }
}

fn run(now: &Surface, task: &Task) -> Result<Report> {
    let inputs = Inputs { task: task.clone(), now: now.clone(), before: None, baseline: None };
    compare(&Options { tolerance_mm: None, search: false }, &inputs, &|| Ok(()))
}

fn finding(now: &Surface, task: &Task) -> TemplateFinding {
    run(now, task).expect("sound").findings.templates.remove(0)
}

fn figure(report: &Report, name: &str) -> f64 {
    report.findings.figures.iter().find(|f| f.name == name).unwrap_or_else(|| panic!("no {name}")).value
}

/// Returns a figure and its uncertainty.
fn stated(report: &Report, name: &str) -> (f64, f64) {
    let figure = report.findings.figures.iter().find(|figure| figure.name == name).expect("a figure");
    (figure.value, figure.uncertainty.expect("stated"))
}

/// Returns a cylinder with straight lines along v.
fn cylinder(radius: f64) -> TargetShape {
    TargetShape::Cylinder { radius, axis: std::f64::consts::FRAC_PI_2 }
}
