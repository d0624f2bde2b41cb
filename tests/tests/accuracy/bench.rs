//! Tests of `platen bench`: the tables of Masuda et al. beside ours, and equal figures for any number of threads.

use serde_json::Value as Json;

fn bench(arguments: &[&str]) -> Json {
    let folder = tempfile::tempdir().unwrap();
    let output = platen_tests::program("platen")
        .args(["bench", "--json", "--out"])
        .arg(folder.path().join("bench"))
        .args(arguments)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn number(row: &Json, pointer: &str) -> f64 {
    row.pointer(pointer).and_then(Json::as_f64).unwrap_or_else(|| panic!("no {pointer} in {row}"))
}

#[test]
fn the_papers_tables_stand_beside_our_figures() {
    let arguments =
        ["--step-deg", "0.1", "--meshes", "1000", "--repeat", "1", "--flattening", "elastic,harmonic"];
    let found = bench(&arguments);
    assert!(found.pointer("/machine/processor").is_some_and(Json::is_string));
    assert_eq!(found.pointer("/tables/table_1/paper/plate_points"), Some(&Json::from(277_721)));
    let points = number(&found, "/tables/table_1/here/plate_points");
    // On a coarser lattice the number of points decreases with the square of the step.
    let expected = 277_721.0 * (360.0 / 10_240.0 / 0.1_f64).powi(2);
    assert!((points / expected - 1.0).abs() < 0.05, "{points} points, {expected} expected");
    let steps = found.pointer("/tables/table_2").and_then(Json::as_array).unwrap();
    for step in steps {
        assert!(number(step, "/here_ms/elastic") > 0.0 && number(step, "/paper_ms/harmonic") > 0.0, "{step}");
    }
    assert!(number(&found, "/tables/table_3/here/0/here_ms/harmonic") > 0.0);
    for flattening in ["elastic", "harmonic"] {
        let side = number(&found, &format!("/tables/table_4/here/{flattening}/d_u_std_mm"));
        assert!(side < number(&found, "/tables/table_4/paper/0/d_u_std_mm"), "{flattening}: d_u {side} mm");
    }
}

#[test]
fn the_same_seed_gives_the_same_figures_on_any_number_of_threads() {
    let figures = |threads| {
        let arguments =
            ["--step-deg", "0.12", "--meshes", "500", "--repeat", "1", "--seed", "3", "--threads", threads];
        bench(&arguments)["tables"]["table_4"]["here"].clone()
    };
    assert_eq!(figures("1"), figures("2"));
}
