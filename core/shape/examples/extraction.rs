//! Times extraction and outline on closed-form scans of growing size: `cargo run --release -p platen-shape --example
//! extraction [dome]`. One thread, processor time of this thread, the best of a few runs; `dome` adds 44 million cells.
#![allow(clippy::expect_used, clippy::print_stdout, reason = "a figure printer")]

#[path = "../tests/support/synthetic.rs"]
mod synthetic;

use std::time::{Duration, Instant};

use platen_shape::Vec3;
use platen_shape::extract::Extractor;
use platen_shape::outline::outline;
use synthetic::{Plate, Scene};

fn scene(step: f64) -> Scene {
    let plate = Plate {
        width: 4.0,
        height: 4.0,
        thickness: 0.035,
        radius: Some(12.0),
        centre: Vec3::new(5.2, 0.0, -3.4),
        turn: 0.3,
        tilt: 0.0,
    };
    Scene { sigma: 1e-3, dropouts: 0.02, step, ..Scene::of(plate) }
}

/// Largest resident size of this process so far, megabytes.
fn peak_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|l| l.trim().trim_end_matches(" kB").parse::<f64>().ok()).unwrap_or(0.0) / 1024.0
}

fn run(name: &str, scene: &Scene, around: f64, runs: usize) {
    let (header, columns) = scene.scan_around(around);
    let before = peak_mb();
    let mut best = [Duration::MAX; 3];
    let (mut samples, mut cells) = (0, 0);
    for _ in 0..runs {
        let start = Instant::now();
        let mut extractor = Extractor::new(&header, &scene.spec());
        for column in &columns {
            extractor.push(column).expect("a sound column");
        }
        let pushed = start.elapsed();
        let patch = extractor.finish().expect("a plate");
        let extracted = start.elapsed();
        outline(&patch, &scene.spec()).expect("an outline");
        let times = [pushed, extracted - pushed, start.elapsed() - extracted];
        for (best, time) in best.iter_mut().zip(times) {
            *best = time.min(*best);
        }
        samples = patch.samples.len();
        cells = columns.iter().map(platen_scan::Column::len).sum();
    }
    let [push, finish, outline] = best.map(|d| d.as_secs_f64() * 1e3);
    let more = peak_mb() - before;
    println!(
        "{name}: {cells} cells, {samples} on the plate; columns {push:.0} ms, the rest {finish:.0} ms, outline {outline:.0} ms; \
         {more:.0} MB above the scan"
    );
}

fn main() {
    let step = 0.0352_f64.to_radians();
    run("table scan", &scene(step), 0.12, 5);
    run("half the step", &scene(0.5 * step), 0.12, 3);
    if std::env::args().any(|argument| argument == "dome") {
        run("dome", &scene(step), std::f64::consts::PI, 1);
    }
}
