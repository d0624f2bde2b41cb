//! Points per second, printed: `cargo test --release -p platen-formats speed -- --nocapture`.

use std::time::Instant;

use super::collect::{read, samples, unpacked};

#[test]
fn speed_of_every_format() {
    let Some(folder) = samples() else { return };
    let temporary = tempfile::tempdir().unwrap();
    for name in
        ["plates/p1_cylinder/scan.e57", "plates/p5_cone_ptx/scan.ptx.gz", "lattice/pumpA_rowcol.xyz.gz"]
    {
        let path = unpacked(&folder.join(name), temporary.path());
        let start = Instant::now();
        let lattice = read(&path, None).unwrap();
        let seconds = start.elapsed().as_secs_f64();
        let points = lattice.n_valid();
        eprintln!("{name}: {points} points in {seconds:.3} s, {:.2} M/s", points as f64 / seconds / 1e6);
    }
}
