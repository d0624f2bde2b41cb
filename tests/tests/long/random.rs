//! Forty random scenes of each family: errors, and whether the stated intervals contain them.

use serde_json::Value as Json;

/// Bounds of a figure: 95 % of the errors, the largest.
type Bounds = [(&'static str, [f64; 2]); 6];

/// Least share of errors inside their 95 % interval, and largest ratio of root mean square error to standard deviation.
const COVERAGE: f64 = 0.93;
const RATIO: f64 = 1.2;

/// Measures forty scenes of a family; the share of errors inside their interval is at least `coverage`.
fn check(family: &str, bounds: Bounds, coverage: f64) {
    let folder = tempfile::tempdir().unwrap();
    let output = platen_tests::program("platen")
        .args(["bench", "accuracy", "--random", "40", "--family", family])
        .args(["--flattening", "harmonic", "--threads", "2", "--json", "--out"])
        .arg(folder.path().join("bench"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let found: Json = serde_json::from_slice(&output.stdout).unwrap();
    let (scenes, summary) = (&found["accuracy"]["scenes"], &found["accuracy"]["summary"]);
    let refused: Vec<&Json> =
        scenes.as_array().unwrap().iter().filter(|s| s.get("refused").is_some()).collect();
    assert!(refused.is_empty(), "{refused:#?}");
    for (name, [most, worst]) in bounds {
        let row = summary.as_array().unwrap().iter().find(|row| row["of"] == name).unwrap();
        println!("{family}: {row}");
        let number = |key: &str| row[key].as_f64().unwrap();
        assert!(number("p95") < most && number("max") < worst, "{row}");
        assert!(number("coverage") > coverage && number("rms_error_over_sigma") < RATIO, "{row}");
    }
}

/// About twice what is found: 0.63 and 1.7, 0.38 and 1.7, 0.82 and 2.6, 0.88 and 1.7 mm, 0.065 and 0.13, 0.010 and 0.020 degrees.
#[test]
fn stated_intervals_contain_the_errors_of_random_scenes() {
    let bounds = [
        ("corner, u or v, mm", [1.3, 3.5]),
        ("marker, u or v, mm", [0.8, 3.4]),
        ("edge, mm", [1.7, 5.2]),
        ("diagonal, mm", [1.8, 3.4]),
        ("angle, degrees", [0.13, 0.26]),
        ("twist, degrees", [0.02, 0.04]),
    ];
    check("square", bounds, COVERAGE);
}

/// About twice what is found: 0.67 and 2.2, 0.41 and 1.7, 0.83 and 2.8, 1.25 and 2.0 mm, 0.060 and 0.14, 0.011 and 0.022 degrees; with side
/// faces taken as square 3.4 and 7.0, 2.7 and 5.9 mm (corners, markers). 93.4 % of the corners lie in their intervals.
#[test]
fn bevelled_edges_are_located_like_square_ones() {
    let bounds = [
        ("corner, u or v, mm", [1.3, 4.4]),
        ("marker, u or v, mm", [0.8, 3.3]),
        ("edge, mm", [1.7, 5.6]),
        ("diagonal, mm", [2.5, 3.9]),
        ("angle, degrees", [0.12, 0.27]),
        ("twist, degrees", [0.022, 0.044]),
    ];
    check("bevel", bounds, 0.91);
}

/// About twice what is found: 0.56 and 2.0, 0.40 and 1.8, 1.05 and 2.9, 1.07 and 2.2 mm, 0.063 and 0.13, 0.011 and 0.027 degrees.
#[test]
fn a_share_of_wide_range_errors_moves_no_figure() {
    let bounds = [
        ("corner, u or v, mm", [1.1, 3.9]),
        ("marker, u or v, mm", [0.8, 3.7]),
        ("edge, mm", [2.1, 5.7]),
        ("diagonal, mm", [2.1, 4.3]),
        ("angle, degrees", [0.13, 0.26]),
        ("twist, degrees", [0.022, 0.054]),
    ];
    check("tails", bounds, COVERAGE);
}
