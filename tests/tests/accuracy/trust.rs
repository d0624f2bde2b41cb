//! Reliability checks on scan files: a plate that was turned is refused, painted markers verify the virtual ones, and a
//! calibration is written and used.

use std::path::{Path, PathBuf};
use std::process::Output;

use serde_json::Value as Json;

/// A square plate, so that a quarter turn is possible, and a cone, which looks different from every side.
const PLATE: &str = "[plate]\nid = \"P\"\nwidth_mm = 2500.0\nheight_mm = 2500.0\nthickness_mm = 36.0\n";
const CONE: &str = r#"{ shape = "cone", radius_start_mm = 4000.0, radius_end_mm = 6000.0, axis_deg = 90.0 }"#;

struct Bench(tempfile::TempDir);

impl Bench {
    fn new() -> Self {
        let bench = Self(tempfile::tempdir().unwrap());
        bench.write("plate.toml", PLATE);
        bench
    }

    fn file(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, text: &str) -> PathBuf {
        std::fs::write(self.file(name), text).unwrap();
        self.file(name)
    }

    /// Scans a plate of this shape, turned by `yaw_deg`.
    fn scan(&self, name: &str, shape: &str, blank: &str, yaw_deg: f64, more: &[&str]) -> PathBuf {
        let text = format!(
            "strokes = 0\nshape = {shape}\n[blank]\nthickness_mm = 36.0\n{blank}\n[pose]\ncentre_mm = [6000.0, 0.0, -3600.0]\n\
             yaw_deg = {yaw_deg:?}\n"
        );
        let simulated = self.write("sim.toml", &text);
        let scan = self.file(name);
        let made = platen_tests::program("platen-sim")
            .arg("scanner")
            .arg(simulated)
            .arg("--out")
            .arg(&scan)
            .args(if more.contains(&"--step-deg") { &[][..] } else { &["--step-deg", "0.1"] })
            .args(more)
            .output()
            .unwrap();
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        scan
    }
}

const SQUARE: &str = "width_mm = 2500.0\nheight_mm = 2500.0";

fn platen(verb: &str, arguments: &[&Path], more: &[&str]) -> Output {
    platen_tests::program("platen").arg(verb).args(arguments).args(more).output().unwrap()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Checks a failure with this exit code and one sentence that contains the words.
#[track_caller]
fn refused(output: &Output, code: i32, words: &[&str]) {
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{said}");
    assert_eq!(said.trim_end().lines().count(), 1, "{said}");
    for word in words {
        assert!(said.contains(word), "`{word}` is not in: {said}");
    }
}

#[track_caller]
fn json(output: &Output) -> Json {
    let said = String::from_utf8_lossy(&output.stderr);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {said}"))
}

/// Returns the largest displacement along the normal, millimetres.
fn largest_change_mm(result: &Json) -> f64 {
    let figures =
        result["comparisons"].as_array().unwrap().iter().flat_map(|it| it["figures"].as_array().unwrap());
    let largest = figures.clone().find(|it| it["name"] == "displacement.max");
    largest.unwrap_or_else(|| panic!("{result:#}"))["value_mm"].as_f64().unwrap().abs()
}

#[test]
fn a_plate_that_came_back_turned_is_refused() {
    let bench = Bench::new();
    let before = bench.scan("before.e57", CONE, SQUARE, 0.0, &[]);
    let measure = |scan: &Path, more: &[&str]| {
        let plate = bench.file("plate.toml");
        let arguments = ["--plate", text(&plate), "--flattening", "harmonic", "--u-axis", "1,0,0", "--json"];
        platen("measure", &[scan], &[&arguments[..], more].concat())
    };
    for (yaw_deg, turn) in [(180.0, "by half a turn"), (90.0, "by a quarter turn")] {
        let turned = bench.scan("turned.e57", CONE, SQUARE, yaw_deg, &[]);
        let output = measure(&turned, &["--before", text(&before)]);
        refused(&output, 1, &["turned.e57", turn, "plate_rot", "--turned"]);
        // The plate turned counter-clockwise, seen from above: its corner (0, 0) is found again.
        let measured = measure(&turned, &["--before", text(&before), "--turned", &yaw_deg.to_string()]);
        assert!(
            json(&measured)["says"].to_string().contains("nothing changed above"),
            "{}",
            json(&measured)["says"]
        );
        let wrong =
            measure(&turned, &["--before", text(&before), "--turned", &(yaw_deg - 180.0).to_string()]);
        refused(&wrong, 1, &["turned.e57", "by half a turn"]);
        refused(&measure(&turned, &["--turned", "90"]), 2, &["--before or --baseline"]);
    }
    let askew = bench.scan("askew.e57", CONE, SQUARE, 42.0, &[]);
    refused(&measure(&askew, &["--before", text(&before)]), 1, &["askew.e57", "degrees from where u ran"]);
    // Turned by 25 degrees it is still the same plate, and its corner is continued.
    let moved = bench.scan("moved.e57", CONE, SQUARE, 25.0, &["--scan-seed", "2"]);
    let result = json(&measure(&moved, &["--before", text(&before)]));
    assert!(largest_change_mm(&result) < 0.25, "{}", result["says"]);
    // The scan of another plate as the previous one.
    let other = bench.scan("other.e57", CONE, "width_mm = 2500.0\nheight_mm = 2000.0", 0.0, &[]);
    refused(&measure(&before, &["--before", text(&other)]), 1, &["other.e57", "2500 mm"]);
}

#[test]
fn painted_discs_verify_the_virtual_markers() {
    let bench = Bench::new();
    let places = [
        [400.0, 400.0],
        [1250.0, 500.0],
        [2100.0, 400.0],
        [500.0, 1250.0],
        [1250.0, 1250.0],
        [2000.0, 2100.0],
    ];
    let painted = format!("{SQUARE}\nmarkers_mm = {places:?}");
    let cylinder = r#"{ shape = "cylinder", radius_mm = 5000.0, axis_deg = 70.0 }"#;
    let scan = bench.scan("painted.e57", cylinder, &painted, 10.0, &["--step-deg", "0.03"]);
    let markers: String = places
        .iter()
        .enumerate()
        .map(|(k, at)| format!("[[marker]]\nname = \"M{k}\"\nat_mm = {at:?}\n"))
        .collect();
    let line = "[[reference_line]]\nname = \"R<1>\"\nfrom_mm = [0.0, 500.0]\nto_mm = [2500.0, 500.0]\n";
    let plate = bench.write("painted.toml", &format!("{PLATE}{markers}{line}"));
    let picture = bench.file("verify.svg");
    let verify = |plate: &Path, more: &[&str]| {
        platen("verify", &[&scan], &[&["--plate", text(plate), "--u-axis", "1,0,0"], more].concat())
    };
    let output = verify(&plate, &["--json", "--picture", text(&picture)]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let found = json(&output);
    println!("markers: mean {} mm, std {}, max {}", found["mean_mm"], found["std_mm"], found["max_mm"]);
    // The paper's mean is 1.0 mm.
    assert!(found["mean_mm"].as_f64().unwrap() < 1.0, "{found}");
    let svg = std::fs::read_to_string(&picture).unwrap();
    assert!(
        svg.contains("data:image/png;base64,")
            && svg.contains("R&lt;1>")
            && svg.matches("<circle").count() == 7
    );

    // A marker where nothing is painted, and one that was painted 10 mm away.
    let wrong =
        bench.write("wrong.toml", &format!("{PLATE}[[marker]]\nname = \"A\"\nat_mm = [800.0, 900.0]\n"));
    let output = verify(&wrong, &[]);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stdout).contains("no dark disc"));
    let wrong =
        bench.write("off.toml", &format!("{PLATE}[[marker]]\nname = \"A\"\nat_mm = [1250.0, 510.0]\n"));
    let output = verify(&wrong, &["--json"]);
    assert_eq!(output.status.code(), Some(1));
    let off = json(&output)["markers"][0]["off_v_mm"].as_f64().unwrap();
    assert!((off + 10.0).abs() < 1.5, "{off}");
    refused(&verify(&bench.file("plate.toml"), &[]), 2, &["plate.toml", "[[marker]]"]);
}

#[test]
fn a_calibration_is_written_used_and_refused_when_it_is_none() {
    let bench = Bench::new();
    let flat = r#"{ shape = "flat" }"#;
    let scans: Vec<PathBuf> = (1..=3)
        .map(|seed| {
            let more = ["--scan-seed", &seed.to_string(), "--cyclic-mm", "0.3"];
            bench.scan(&format!("{seed}.e57"), flat, SQUARE, 5.0, &more)
        })
        .collect();
    let plate = bench.write(
        "plate.toml",
        &format!(
            "{PLATE}[target]\nshape = \"flat\"\n[[reference_line]]\nname = \"R\"\nfrom_mm = [0.0, 1250.0]\nto_mm = [2500.0, 1250.0]\n\
             [[template]]\nline = \"R\"\nchord_mm = 1500.0\nlimit_mm = 3.0\n"
        ),
    );
    let plant = bench.write(
        "plant.toml",
        "[frame]\nu_axis = [1.0, 0.0, 0.0]\n[flattening]\nplugin = \"harmonic\"\n[calibration]\nfile = \"cal.toml\"\nmax_age = \"30 d\"\n",
    );
    let files: Vec<&Path> = [&plant].into_iter().chain(&scans).map(PathBuf::as_path).collect();
    let gap = |more: &[&str]| {
        let arguments = ["--plate", text(&plate), "--plant", text(&plant), "--json"];
        json(&platen("measure", &[&scans[0]], &[&arguments[..], more].concat()))
    };
    assert_eq!(gap(&[])["calibration"]["sigma_true_mm"], Json::Null);
    let output = platen("calibrate", &files, &["--plate", text(&plate), "--artefact", "--json"]);
    let found = json(&output);
    let sigma = found["sigma_true_mm"].as_f64().unwrap();
    println!("null pairs {}, artefact {}", found["pairs"], found["artefact"]);
    // The range error repeats in every scan: it is visible in the artefact, but not in null pairs.
    assert!((0.05..0.5).contains(&sigma), "{found}");
    assert!(found["sigma_correlated_mm"].as_f64().unwrap() < 0.1, "{found}");
    let result = gap(&[]);
    // The file contains it to a tenth of a micrometre.
    let used = result["calibration"]["sigma_true_mm"].as_f64().unwrap();
    assert!((used - sigma).abs() < 1e-4, "{used} {sigma}");
    let stated = result["reference_lines"][0]["templates"][0]["uncertainty_mm"].as_f64().unwrap();
    assert!(stated > 1.9 * sigma, "{stated} {sigma}");

    // Two different plates are not a null pair, and one scan is not a pair.
    let bent = bench.scan(
        "bent.e57",
        r#"{ shape = "cylinder", radius_mm = 9000.0, axis_deg = 90.0 }"#,
        SQUARE,
        5.0,
        &[],
    );
    refused(
        &platen("calibrate", &[&plant, &scans[0], &bent], &["--plate", text(&plate)]),
        1,
        &["was bent between them"],
    );
    let alone = platen("calibrate", &[&plant, &scans[0]], &["--plate", text(&plate)]);
    assert_eq!(alone.status.code(), Some(2));
}
