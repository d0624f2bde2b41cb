//! Benchmark of ABF++ with layout, by number of vertices: a 4 x 4 m plate rolled to R 12 m, jittered, Delaunay.

#[path = "../src/angles.rs"]
mod angles;
#[path = "../src/chart.rs"]
mod chart;
#[path = "../src/reduced_system.rs"]
mod reduced_system;

use divan::Bencher;
use platen_shape::flatten::closed_form::{ClosedForm, cylinder};

fn main() {
    divan::main();
}

#[divan::bench(args = [32, 71, 101, 224, 316], sample_count = 15)]
fn smooth(bencher: Bencher<'_, '_>, side: u32) {
    run(bencher, side, 0.0);
}

/// With 0.5 mm of noise.
#[divan::bench(args = [32, 71, 101, 224, 316], sample_count = 15)]
fn noisy(bencher: Bencher<'_, '_>, side: u32) {
    run(bencher, side, 5e-4);
}

fn run(bencher: Bencher<'_, '_>, side: u32, noise: f64) {
    let plate = ClosedForm::new(cylinder(12.0, 0.3), [4.0, 4.0], [side - 1; 2], 0.3, 1).with_noise(noise, 1);
    let Ok(mesh) = plate.mesh() else { return };
    bencher.bench_local(|| chart::abf(&mesh, || Ok(())));
}
