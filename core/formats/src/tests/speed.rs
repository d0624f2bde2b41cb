//! Points per second, printed: `cargo test --release -p platen-formats speed -- --nocapture`.

use std::time::Instant;

use platen_tests::samples;

use super::collect::read;

#[test]
fn speed_of_every_format() {
    let temporary = tempfile::tempdir().unwrap();
    let names =
        ["plates/p1_cylinder/scan.e57", "plates/p5_cone_ptx/scan.ptx.gz", "lattice/pumpA_rowcol.xyz.gz"];
    for sample in names.into_iter().flat_map(samples::each) {
        let path = samples::unpacked(&sample, temporary.path());
        let start = Instant::now();
        let lattice = read(&path, None).unwrap();
        let seconds = start.elapsed().as_secs_f64();
        let points = lattice.n_valid();
        eprintln!(
            "{}: {points} points in {seconds:.3} s, {:.2} M/s",
            points as f64 / seconds / 1e6,
            sample.display()
        );
    }
}
