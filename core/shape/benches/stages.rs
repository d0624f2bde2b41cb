//! Benchmark of each stage from columns to S(u, v).
//!
//! Scene: a 4 x 4 m plate rolled to R 12 m among 1.6 million cells, 1 mm range noise, 2 % dropouts, about 300,000
//! samples on the plate. `cargo bench -p platen-shape`; `outline` and `measure` use two threads, the others one.
//!
//! `finish`, `outline` and the stages of `measure` follow the last column; `lattice_in_memory` comprises all stages,
//! with the harmonic map.
#![allow(clippy::expect_used, reason = "a benchmark without its scene is none")]

#[path = "../tests/support/harmonic.rs"]
mod harmonic;
#[path = "../tests/support/synthetic.rs"]
mod synthetic;

use std::sync::LazyLock;
use std::time::Duration;

use divan::Bencher;
use harmonic::Harmonic;
use platen_scan::{Column, ScanHeader};
use platen_shape::extract::Extractor;
use platen_shape::mesh::SmoothFace;
use platen_shape::outline::outline;
use platen_shape::surface::{SplineFit, UniformKnots};
use platen_shape::{
    Chart, DiskMesh, Flatten, FlattenError, Measurement, Outline, Patch, PlateSpec, Vec3, measure,
};
use synthetic::{Plate, Random, Scene};

fn main() {
    divan::main();
}

/// The scan and the result of each stage.
struct Stages {
    spec: PlateSpec,
    header: ScanHeader,
    columns: Vec<Column>,
    pushed: Extractor,
    patch: Patch,
    outline: Outline,
    chart: Chart,
}

static STAGES: LazyLock<Stages> = LazyLock::new(|| {
    let plate = Plate {
        width: 4.0,
        height: 4.0,
        thickness: 0.035,
        radius: Some(12.0),
        centre: Vec3::new(5.2, 0.0, -3.4),
        turn: 0.3,
        tilt: 0.0,
    };
    let scene = Scene { sigma: 1e-3, dropouts: 0.02, step: 0.056_f64.to_radians(), ..Scene::of(plate) };
    let (header, columns) = scene.scan_around(0.3);
    let spec = scene.spec();
    let pushed = push(&header, &columns, &spec);
    let patch = pushed.clone().finish().expect("a plate");
    let outline = outline(&patch, &spec).expect("an outline");
    let chart = whole(&patch, &outline, &spec, &mut Harmonic).chart;
    Stages { spec, header, columns, pushed, patch, outline, chart }
});

fn push(header: &ScanHeader, columns: &[Column], spec: &PlateSpec) -> Extractor {
    let mut extractor = Extractor::new(header, spec);
    for column in columns {
        extractor.push(column).expect("a sound column");
    }
    extractor
}

fn whole(patch: &Patch, outline: &Outline, spec: &PlateSpec, flatten: &mut dyn Flatten) -> Measurement {
    measure(patch, outline, spec, &spec.rectangle(), flatten, &mut Duration::default).expect("a measurement")
}

/// A flattening whose chart is given.
struct Known(Chart);

impl Flatten for Known {
    fn flatten(&mut self, _: &DiskMesh) -> Result<Chart, FlattenError> {
        Ok(std::mem::take(&mut self.0))
    }
}

#[divan::bench(sample_count = 10)]
fn columns(bencher: Bencher<'_, '_>) {
    let s = &*STAGES;
    bencher.bench_local(|| push(&s.header, &s.columns, &s.spec));
}

#[divan::bench(sample_count = 10)]
fn finish(bencher: Bencher<'_, '_>) {
    let s = &*STAGES;
    bencher.with_inputs(|| s.pushed.clone()).bench_local_values(Extractor::finish);
}

#[divan::bench(sample_count = 10)]
fn outline_of_the_face(bencher: Bencher<'_, '_>) {
    let s = &*STAGES;
    bencher.bench_local(|| outline(&s.patch, &s.spec));
}

#[divan::bench(sample_count = 10)]
fn smooth_face(bencher: Bencher<'_, '_>) {
    let s = &*STAGES;
    bencher.bench_local(|| SmoothFace::of(&s.patch, &s.outline, &s.spec));
}

#[divan::bench(sample_count = 10)]
fn mesh(bencher: Bencher<'_, '_>) {
    let s = &*STAGES;
    let face = SmoothFace::of(&s.patch, &s.outline, &s.spec);
    bencher.bench_local(|| {
        face.mesh(&s.outline, &s.spec, &s.spec.rectangle(), platen_shape::measure::N_VERTICES)
    });
}

/// Measures smooth face, mesh and S, with the flattening given.
#[divan::bench(sample_count = 10)]
fn measure_but_flattening(bencher: Bencher<'_, '_>) {
    let s = &*STAGES;
    bencher
        .with_inputs(|| Known(s.chart.clone()))
        .bench_local_values(|mut known| whole(&s.patch, &s.outline, &s.spec, &mut known));
}

#[divan::bench(sample_count = 10)]
fn lattice_in_memory(bencher: Bencher<'_, '_>) {
    let s = &*STAGES;
    bencher.bench_local(|| {
        let patch = push(&s.header, &s.columns, &s.spec).finish().expect("a plate");
        let outline = outline(&patch, &s.spec).expect("an outline");
        whole(&patch, &outline, &s.spec, &mut Harmonic)
    });
}

/// Fits the bicubic spline to scattered points and selects the penalty: (points, spans per side).
#[divan::bench(args = [(10_000, 16), (280_000, 32), (280_000, 64)], sample_count = 10)]
fn fit(bencher: Bencher<'_, '_>, (n_points, n_spans): (usize, usize)) {
    let mut random = Random::new(1);
    let points: Vec<[f64; 3]> = (0..n_points)
        .map(|_| {
            let (u, v) = (4.0 * random.uniform(), 4.0 * random.uniform());
            [u, v, 0.04 * u * u + 0.02 * v * v + 1e-3 * random.normal()]
        })
        .collect();
    bencher.bench_local(|| {
        let axis = UniformKnots::new(0.0, 4.0, n_spans);
        let mut fit = SplineFit::<3>::new(axis, axis);
        for &[u, v, z] in &points {
            fit.add(u, v, [u, v, z], 1e6);
        }
        fit.solve([0.0, 0.0, 1.0])
    });
}
