//! Forty random scenes of each family: their errors, and the coverage of the stated intervals.

use serde_json::Value as Json;

/// Bounds of a figure: for 95 % of the errors, and for the largest.
type Bounds = [(&'static str, [f64; 2]); 6];

/// Least share of errors inside their 95 % interval, and largest ratio of root mean square error to standard deviation.
const COVERAGE: f64 = 0.93;
const RATIO: f64 = 1.2;

/// Measures forty scenes of a family; the share of errors inside their interval must be at least `coverage`.
fn check(arguments: &[&str], bounds: Bounds, coverage: f64) {
    let folder = tempfile::tempdir().unwrap();
    let output = platen_tests::program("platen")
        .args(["bench", "accuracy", "--random", "40", "--family"])
        .args(arguments)
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
        println!("{arguments:?}: {row}");
        let number = |key: &str| row[key].as_f64().unwrap();
        assert!(number("p95") < most && number("max") < worst, "{row}");
        assert!(number("coverage") > coverage && number("rms_error_over_sigma") < RATIO, "{row}");
    }
}

/// On mill scale. Found: 0.49 and 1.8, 0.31 and 1.4, 0.79 and 2.1, 1.03 and 1.8 mm, 0.044 and 0.14, 0.011 and 0.013
/// degrees; the largest on a plate seen at spacings of 43 mm.
#[test]
fn stated_intervals_contain_the_errors_of_random_scenes() {
    let bounds = [
        ("corner, u or v, mm", [1.0, 2.8]),
        ("marker, u or v, mm", [0.6, 1.7]),
        ("edge, mm", [1.3, 3.2]),
        ("diagonal, mm", [1.2, 2.4]),
        ("angle, degrees", [0.08, 0.19]),
        ("twist, degrees", [0.02, 0.026]),
    ];
    check(&["square", "--reflectivity", "0.35"], bounds, COVERAGE);
}

/// About twice the found values: 0.49 and 1.8, 0.37 and 1.4, 0.70 and 1.9, 0.73 and 1.6 mm, 0.033 and 0.13, 0.010 and
/// 0.014 degrees. Without the contrast 92 % of the diagonals of 200 scenes are in their intervals.
#[test]
fn stated_intervals_contain_the_errors_of_dark_and_bright_plates() {
    let bounds = [
        ("corner, u or v, mm", [1.2, 3.0]),
        ("marker, u or v, mm", [0.8, 2.4]),
        ("edge, mm", [1.7, 3.7]),
        ("diagonal, mm", [1.7, 2.6]),
        ("angle, degrees", [0.09, 0.14]),
        ("twist, degrees", [0.02, 0.028]),
    ];
    check(&["square"], bounds, COVERAGE);
}

/// On mill scale. Found: 0.49 and 1.7, 0.38 and 1.0, 0.77 and 1.8, 1.0 and 1.6 mm, 0.043 and 0.089 degrees; with side
/// faces taken as square 3.4 and 7.0, 2.7 and 5.9 mm (corners, markers). 95.9 % of the corners lie in their intervals,
/// 94.4 % of the angles, 93.1 % of the edges.
#[test]
fn bevelled_edges_are_located_like_square_ones() {
    let bounds = [
        ("corner, u or v, mm", [1.1, 2.4]),
        ("marker, u or v, mm", [0.65, 1.5]),
        ("edge, mm", [1.2, 2.8]),
        ("diagonal, mm", [1.3, 2.5]),
        ("angle, degrees", [0.09, 0.19]),
        ("twist, degrees", [0.014, 0.024]),
    ];
    check(&["bevel", "--reflectivity", "0.35"], bounds, COVERAGE);
}

/// On mill scale, about twice the found values: 0.47 and 1.6, 0.31 and 1.1, 0.72 and 1.9, 0.70 and 1.6 mm, 0.041 and
/// 0.11, 0.009 and 0.013 degrees.
#[test]
fn a_share_of_wide_range_errors_moves_no_figure() {
    let bounds = [
        ("corner, u or v, mm", [1.1, 2.9]),
        ("marker, u or v, mm", [0.65, 1.8]),
        ("edge, mm", [1.5, 3.3]),
        ("diagonal, mm", [1.4, 2.8]),
        ("angle, degrees", [0.085, 0.2]),
        ("twist, degrees", [0.016, 0.026]),
    ];
    check(&["tails", "--reflectivity", "0.35"], bounds, COVERAGE);
}
