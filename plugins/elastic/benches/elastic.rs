//! Benchmark of the elastic flattening by number of vertices: a 4 x 4 m plate, jittered, Delaunay.

#[path = "../src/boundary_springs.rs"]
mod boundary_springs;
#[path = "../src/chart.rs"]
mod chart;
#[path = "../src/material_law_bound.rs"]
mod material_law_bound;
#[path = "../src/membrane.rs"]
mod membrane;
#[path = "../src/newton.rs"]
mod newton;

use divan::Bencher;
use platen_shape::flatten::closed_form::{ClosedForm, cylinder, sphere_of_fibres};

fn main() {
    divan::main();
}

const SIZE: [f64; 2] = [4.0, 4.0];

/// Rolled to R 12 m with 0.05 mm of noise.
#[divan::bench(args = [32, 71, 101, 224, 316], sample_count = 15)]
fn rolled(bencher: Bencher<'_, '_>, side: u32) {
    run(bencher, ClosedForm::new(cylinder(12.0, 0.3), SIZE, [side - 1; 2], 0.3, 1).with_noise(5e-5, 1));
}

/// A sphere of R 15 m.
#[divan::bench(args = [32, 71, 101, 224, 316], sample_count = 15)]
fn sphere(bencher: Bencher<'_, '_>, side: u32) {
    run(bencher, ClosedForm::new(sphere_of_fibres(15.0, SIZE), SIZE, [side - 1; 2], 0.3, 1));
}

fn run(bencher: Bencher<'_, '_>, plate: ClosedForm) {
    let Ok(mesh) = plate.mesh() else { return };
    bencher.bench_local(|| chart::elastic(&mesh, 0.3, || Ok(())));
}
