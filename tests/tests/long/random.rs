//! Forty random scenes: errors, and whether the stated intervals contain them.

use serde_json::Value as Json;

/// Each figure with its bounds: 95 % of the errors, the largest; about twice what is found (0.63 and 1.7, 0.38 and 1.7, 0.82 and 2.6, 0.88
/// and 1.7 mm, 0.065 and 0.13, 0.010 and 0.020 degrees).
const BOUNDS: [(&str, [f64; 2]); 6] = [
    ("corner, u or v, mm", [1.3, 3.5]),
    ("marker, u or v, mm", [0.8, 3.4]),
    ("edge, mm", [1.7, 5.2]),
    ("diagonal, mm", [1.8, 3.4]),
    ("angle, degrees", [0.13, 0.26]),
    ("twist, degrees", [0.02, 0.04]),
];
/// Least share of errors inside their 95 % interval, and largest ratio of root mean square error to standard deviation.
const COVERAGE: f64 = 0.93;
const RATIO: f64 = 1.2;

#[test]
fn stated_intervals_contain_the_errors_of_random_scenes() {
    let folder = tempfile::tempdir().unwrap();
    let output = platen_tests::program("platen")
        .args([
            "bench",
            "accuracy",
            "--random",
            "40",
            "--flattening",
            "harmonic",
            "--threads",
            "2",
            "--json",
            "--out",
        ])
        .arg(folder.path().join("bench"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let found: Json = serde_json::from_slice(&output.stdout).unwrap();
    let (scenes, summary) = (&found["accuracy"]["scenes"], &found["accuracy"]["summary"]);
    let refused: Vec<&Json> =
        scenes.as_array().unwrap().iter().filter(|s| s.get("refused").is_some()).collect();
    assert!(refused.is_empty(), "{refused:#?}");
    for (name, [most, worst]) in BOUNDS {
        let row = summary.as_array().unwrap().iter().find(|row| row["of"] == name).unwrap();
        println!("{row}");
        let number = |key: &str| row[key].as_f64().unwrap();
        assert!(number("p95") < most && number("max") < worst, "{row}");
        assert!(number("coverage") > COVERAGE && number("rms_error_over_sigma") < RATIO, "{row}");
    }
}
