//! Benchmark of the harmonic map by number of vertices: a 4 x 4 m plate rolled to R 12 m, jittered, Delaunay.

use divan::Bencher;
use platen_shape::flatten::closed_form::{ClosedForm, cylinder};
use platen_shape::flatten::{cotangents, fixed_boundary};

fn main() {
    divan::main();
}

#[divan::bench(args = [32, 71, 101, 224, 316], sample_count = 15)]
fn vertices_a_side(bencher: Bencher<'_, '_>, side: u32) {
    let plate = ClosedForm::new(cylinder(12.0, 0.3), [4.0, 4.0], [side - 1; 2], 0.3, 1);
    let Ok(mesh) = plate.mesh() else { return };
    bencher.bench_local(|| fixed_boundary(&mesh, &cotangents(&mesh)));
}
