//! Forty random scenes of each family: their errors, and the coverage of the stated intervals.

use serde_json::Value as Json;

/// Bounds of a figure: for 95 % of the errors, and for the largest.
type Bounds = [(&'static str, [f64; 2]); 6];

/// Least share of errors inside their 95 % interval, and largest ratio of root mean square error to standard deviation.
const COVERAGE: f64 = 0.93;
const RATIO: f64 = 1.2;

/// Measures forty scenes of a family; the ratio of root mean square error to standard deviation must be below `ratio`.
fn check(arguments: &[&str], bounds: Bounds, ratio: f64) {
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
        assert!(number("coverage") > COVERAGE && number("rms_error_over_sigma") < ratio, "{row}");
    }
}

/// On mill scale. Found: 0.39 and 1.4, 0.30 and 1.0, 0.55 and 1.4, 0.60 and 1.8 mm, 0.026 and 0.093, 0.008 and 0.013
/// degrees; the largest on a plate seen at spacings of 43 mm.
#[test]
fn stated_intervals_contain_the_errors_of_random_scenes() {
    let bounds = [
        ("corner, u or v, mm", [0.8, 2.1]),
        ("marker, u or v, mm", [0.6, 1.5]),
        ("edge, mm", [1.1, 2.1]),
        ("diagonal, mm", [1.2, 2.4]),
        ("angle, degrees", [0.053, 0.14]),
        ("twist, degrees", [0.017, 0.02]),
    ];
    check(&["square", "--reflectivity", "0.35"], bounds, RATIO);
}

/// About twice the found values: 0.39 and 1.9, 0.31 and 1.5, 0.56 and 2.0, 0.69 and 2.3 mm, 0.027 and 0.11, 0.009 and
/// 0.014 degrees. Without the contrast 92 % of the diagonals of 200 scenes are in their intervals.
#[test]
fn stated_intervals_contain_the_errors_of_dark_and_bright_plates() {
    let bounds = [
        ("corner, u or v, mm", [0.8, 2.9]),
        ("marker, u or v, mm", [0.6, 2.2]),
        ("edge, mm", [1.15, 3.0]),
        ("diagonal, mm", [1.15, 2.6]),
        ("angle, degrees", [0.055, 0.14]),
        ("twist, degrees", [0.019, 0.02]),
    ];
    check(&["square"], bounds, RATIO);
}

/// On mill scale. Found: 0.42 and 1.2, 0.33 and 1.0, 0.59 and 1.6, 0.57 and 1.4 mm, 0.030 and 0.055, 0.008 and 0.015
/// degrees; with side faces taken as square 3.4 and 7.0, 2.7 and 5.9 mm (corners, markers). 95.6 % of the corners lie in
/// their intervals, 99.4 % of the angles, 95.0 % of the edges.
#[test]
fn bevelled_edges_are_located_like_square_ones() {
    let bounds = [
        ("corner, u or v, mm", [0.84, 1.7]),
        ("marker, u or v, mm", [0.65, 1.45]),
        ("edge, mm", [1.2, 2.0]),
        ("diagonal, mm", [1.15, 2.0]),
        ("angle, degrees", [0.06, 0.076]),
        ("twist, degrees", [0.014, 0.022]),
    ];
    check(&["bevel", "--reflectivity", "0.35"], bounds, RATIO);
}

/// On mill scale, about twice the found values: 0.39 and 1.3, 0.32 and 0.9, 0.63 and 1.4, 0.64 and 1.7 mm, 0.031 and
/// 0.093, 0.009 and 0.013 degrees.
#[test]
fn a_share_of_wide_range_errors_moves_no_figure() {
    let bounds = [
        ("corner, u or v, mm", [0.8, 2.1]),
        ("marker, u or v, mm", [0.6, 1.4]),
        ("edge, mm", [1.25, 2.1]),
        ("diagonal, mm", [1.25, 2.6]),
        ("angle, degrees", [0.063, 0.14]),
        ("twist, degrees", [0.016, 0.02]),
    ];
    check(&["tails", "--reflectivity", "0.35"], bounds, RATIO);
}

/// About twice the found values: 0.50 and 1.1, 0.36 and 0.7, 0.71 and 1.2, 0.83 and 1.2 mm, 0.031 and 0.059, 0.010 and
/// 0.015 degrees. With an assumed shape of the beam 1.06 and 4.6 mm (corners); edges were in their intervals in 86 %.
#[test]
fn the_shape_of_a_beam_with_wings_is_found() {
    let bounds = [
        ("corner, u or v, mm", [1.0, 1.7]),
        ("marker, u or v, mm", [0.74, 1.1]),
        ("edge, mm", [1.4, 1.8]),
        ("diagonal, mm", [1.65, 1.7]),
        ("angle, degrees", [0.063, 0.09]),
        ("twist, degrees", [0.02, 0.023]),
    ];
    check(&["wings"], bounds, RATIO);
}

/// On mill scale, twice the found values of 95 % of the errors: 0.32 and 3.1, 0.27 and 2.6, 0.48 and 3.1, 0.46 and
/// 2.7 mm, 0.031 and 0.15, 0.009 and 0.011 degrees. Taken for a smooth beam, corners of forty plates of any brightness
/// are within 0.95 mm instead of 0.50 mm, diagonals in their intervals in 64 %.
#[test]
fn a_beam_of_a_few_rays_is_recognised() {
    let bounds = [
        ("corner, u or v, mm", [0.63, 3.6]),
        ("marker, u or v, mm", [0.55, 3.1]),
        ("edge, mm", [0.97, 3.7]),
        ("diagonal, mm", [0.92, 3.3]),
        ("angle, degrees", [0.062, 0.2]),
        ("twist, degrees", [0.018, 0.02]),
    ];
    check(&["rays", "--reflectivity", "0.35"], bounds, 1.5);
}

/// On mill scale. Found: 0.40 and 1.5, 0.31 and 1.0, 0.64 and 1.5, 0.69 and 1.9 mm, 0.035 and 0.095, 0.008 and 0.012
/// degrees.
#[test]
fn stated_intervals_contain_the_errors_of_bowed_edges() {
    let bounds = [
        ("corner, u or v, mm", [0.8, 2.2]),
        ("marker, u or v, mm", [0.62, 1.55]),
        ("edge, mm", [1.3, 2.3]),
        ("diagonal, mm", [1.35, 2.7]),
        ("angle, degrees", [0.07, 0.14]),
        ("twist, degrees", [0.016, 0.018]),
    ];
    check(&["bowed", "--reflectivity", "0.35"], bounds, RATIO);
}
