//! Speed test: time to all columns and points per second, printed.
//!
//! `cargo test --release -p platen-formats speed -- --nocapture`

use std::time::Instant;

use platen_tests::samples;

use crate::orient::Expected;
use crate::{ReadError, ScanReader};

#[test]
fn speed_of_every_format() {
    let temporary = tempfile::tempdir().unwrap();
    let names =
        ["plates/p1_cylinder/scan.e57", "plates/p5_cone_ptx/scan.ptx.gz", "lattice/pumpA_rowcol.xyz.gz"];
    for sample in names.into_iter().flat_map(samples::each) {
        let path = samples::unpacked(&sample, temporary.path());
        let start = Instant::now();
        let mut reader = ScanReader::open(&path, None, &|| true).unwrap();
        let opened = start.elapsed();
        let oriented = reader.orient(&Expected::default(), |_| Ok::<_, ReadError>(())).unwrap();
        let first_pass = start.elapsed();
        let points = reader.columns(&oriented).unwrap().finish().unwrap().points;
        let all = start.elapsed();
        eprintln!(
            "{}: {points} points in {:.1?} (open {opened:.1?}, first pass {:.1?}, columns {:.1?}), {:.1} M/s",
            sample.display(),
            all,
            first_pass - opened,
            all - first_pass,
            points as f64 / all.as_secs_f64() / 1e6,
        );
    }
}
