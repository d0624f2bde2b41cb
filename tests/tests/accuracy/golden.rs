//! Golden test of the small set's figures against those of the last review, `tests/golden/figures.json`.
//!
//! `PLATEN_BLESS=1 cargo test --release -p platen-tests --test accuracy golden` writes the file again; review the
//! change before it is committed. A result is the same to the last bit on one model of processor. Vector widths differ
//! between models, hence the tolerance.

use platen_tests::samples;
use serde_json::{Value as Json, json};

use crate::plates::measure;

/// Largest difference: metres for positions, radians, millimetres for figures in millimetres. Half of it is the
/// rounding of the file to seven decimals.
const TOLERANCE: f64 = 1e-7;

fn figures(result: &Json) -> Json {
    let control = result["surface"]["control_m"].as_array().unwrap();
    json!({
        "corners_m": result["corners_m"],
        "markers": result["markers"],
        "shape_checks": result["shape_checks"],
        "quality": result["quality"],
        "plate_points": result["scan"]["plate_points"],
        "control_m": control[control.len() / 2],
        "kappa_u_per_m": result["grid"]["kappa_u_per_m"].as_array().unwrap()[200..241],
    })
}

/// Rounds every number to seven decimals, so that a change of a last bit does not change the file.
fn round(figures: &mut Json) {
    match figures {
        Json::Object(entries) => entries.values_mut().for_each(round),
        Json::Array(values) => values.iter_mut().for_each(round),
        Json::Number(number) if number.is_f64() => {
            *figures = json!((number.as_f64().unwrap() * 1e7).round() / 1e7);
        }
        _ => {}
    }
}

/// Returns one line for each figure, which a person can read and compare.
fn lines(plates: &Json) -> String {
    let line = |(name, figure): (&String, &Json)| match figure.as_array() {
        Some(values) => {
            let values: Vec<String> = values.iter().map(|value| format!("      {value}")).collect();
            format!("    {name:?}: [\n{}\n    ]", values.join(",\n"))
        }
        None => format!("    {name:?}: {figure}"),
    };
    let plate = |(name, figures): (&String, &Json)| {
        let figures: Vec<String> = figures.as_object().unwrap().iter().map(line).collect();
        format!("  {name:?}: {{\n{}\n  }}", figures.join(",\n"))
    };
    let plates: Vec<String> = plates.as_object().unwrap().iter().map(plate).collect();
    format!("{{\n{}\n}}\n", plates.join(",\n"))
}

fn compare(at: &str, found: &Json, golden: &Json, faults: &mut Vec<String>) {
    let equal = match (found, golden) {
        (Json::Object(a), Json::Object(b)) => {
            b.iter().for_each(|(key, b)| compare(&format!("{at}/{key}"), &a[key], b, faults));
            a.len() == b.len()
        }
        (Json::Array(a), Json::Array(b)) => {
            a.iter().zip(b).enumerate().for_each(|(k, (a, b))| compare(&format!("{at}/{k}"), a, b, faults));
            a.len() == b.len()
        }
        (Json::Number(a), Json::Number(b)) => (a.as_f64().unwrap() - b.as_f64().unwrap()).abs() <= TOLERANCE,
        _ => found == golden,
    };
    if !equal {
        faults.push(format!("{at}: {found}, golden {golden}"));
    }
}

#[test]
fn the_plates_figures_are_those_of_the_last_review() {
    let folder = tempfile::tempdir().unwrap();
    let set = samples::sets().remove(0).join("plates");
    let before = set.join("p4a_stroke/scan.e57");
    let mut found = json!({});
    for (name, flattening) in [
        ("p1_cylinder", "harmonic"),
        ("p2_sphere", "elastic"),
        ("p3_half_bent", "abf"),
        ("p4b_stroke", "elastic"),
        ("p5_cone_ptx", "harmonic"),
        ("p6_occluded", "elastic"),
    ] {
        let more = ["--before", before.to_str().unwrap()];
        let more = if name == "p4b_stroke" { &more[..] } else { &[] };
        found[name] = figures(&measure(&set.join(name), folder.path(), flattening, more));
    }
    let file = platen_tests::repository().join("tests/golden/figures.json");
    if std::env::var_os("PLATEN_BLESS").is_some() {
        let mut rounded = found.clone();
        round(&mut rounded);
        std::fs::write(&file, lines(&rounded)).unwrap();
    }
    let golden: Json = serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap();
    let mut faults = Vec::new();
    compare("", &found, &golden, &mut faults);
    assert!(faults.is_empty(), "{faults:#?}");
}
