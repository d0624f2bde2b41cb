//! Times the stages on closed-form scans of growing size: `cargo run --release -p platen-shape --example extraction
//! [dome]`. Processor time of this one thread, so that other work on the machine does not count; the best of a few
//! runs. `dome` adds a scan of 44 million cells.
#![allow(clippy::expect_used, clippy::print_stdout, reason = "a figure printer")]

#[path = "../tests/support/harmonic.rs"]
mod harmonic;
#[path = "../tests/support/synthetic.rs"]
mod synthetic;

use std::time::Duration;

use harmonic::Harmonic;
use platen_shape::extract::Extractor;
use platen_shape::outline::outline;
use platen_shape::{Vec3, measure};
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

/// Time that this thread has run, from the scheduler (Linux).
fn processor_time() -> Duration {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds = text.split_whitespace().next().and_then(|n| n.parse().ok());
    Duration::from_nanos(nanoseconds.unwrap_or(0))
}

/// Largest resident size of this process so far, megabytes.
fn peak_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|l| l.trim().trim_end_matches(" kB").parse::<f64>().ok()).unwrap_or(0.0) / 1024.0
}

fn run(name: &str, scene: &Scene, around: f64, runs: usize) {
    let (header, columns) = scene.scan_around(around);
    let spec = scene.spec();
    let before = peak_mb();
    let mut best = [Duration::MAX; 6];
    let (mut samples, mut cells) = (0, 0);
    for _ in 0..runs {
        let mut at = processor_time();
        let mut lap = || std::mem::replace(&mut at, processor_time());
        let mut laps = vec![];
        let mut extractor = Extractor::new(&header, &spec);
        for column in &columns {
            extractor.push(column).expect("a sound column");
        }
        laps.push(lap());
        let patch = extractor.finish().expect("a plate");
        laps.push(lap());
        let outline = outline(&patch, &spec).expect("an outline");
        laps.push(lap());
        let m = measure(&patch, &outline, &spec, &mut Harmonic, &mut processor_time).expect("a measurement");
        laps.extend([lap(), processor_time()]);
        let mut times: Vec<Duration> = laps.windows(2).map(|w| w[1] - w[0]).collect();
        times.truncate(3);
        times.extend([m.timings.mesh, m.timings.flatten, m.timings.surface]);
        for (best, time) in best.iter_mut().zip(times) {
            *best = time.min(*best);
        }
        samples = patch.samples.len();
        cells = columns.iter().map(platen_scan::Column::len).sum();
    }
    let total: Duration = best.iter().sum();
    let [push, finish, outline, mesh, flatten, surface] = best.map(|d| d.as_secs_f64() * 1e3);
    println!(
        "{name}: {cells} cells, {samples} on the plate; ms: columns {push:.0}, the rest of extraction {finish:.0}, \
         outline {outline:.0}, mesh {mesh:.0}, harmonic {flatten:.0}, surface {surface:.0}; all {:.0}, after the last \
         column {:.0}; {:.0} MB above the scan",
        total.as_secs_f64() * 1e3,
        (total - best[0]).as_secs_f64() * 1e3,
        peak_mb() - before
    );
}

fn main() {
    let step = 0.056_f64.to_radians();
    run("table scan", &scene(step), 0.3, 9);
    if std::env::args().any(|argument| argument == "half") {
        run("half the step", &scene(0.5 * step), 0.3, 3);
    }
    if std::env::args().any(|argument| argument == "dome") {
        run("dome", &scene(step), std::f64::consts::PI, 1);
    }
}
