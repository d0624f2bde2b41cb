//! Tests of invalid input to `platen measure` and `platen check`: one sentence each, the correct exit code, no files
//! left behind.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};

/// A small bent plate, scanned once for all tests.
struct Bench {
    folder: tempfile::TempDir,
}

fn bench() -> &'static Bench {
    static BENCH: OnceLock<Bench> = OnceLock::new();
    BENCH.get_or_init(|| {
        let bench = Bench { folder: tempfile::tempdir().unwrap() };
        std::fs::write(bench.file("sim.toml"), SIMULATED).unwrap();
        for out in ["scan.e57", "scan.ptx"] {
            let made = platen_tests::program("platen-sim")
                .arg("scanner")
                .arg(bench.file("sim.toml"))
                .arg("--out")
                .arg(bench.file(out))
                .args(["--step-deg", "0.12"])
                .output()
                .unwrap();
            assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        }
        std::fs::write(bench.file("plate.toml"), PLATE).unwrap();
        bench
    })
}

const SIMULATED: &str = r#"
strokes = 0
shape = { shape = "cylinder", radius_mm = 9000.0, axis_deg = 90.0 }
[blank]
width_mm = 3000.0
height_mm = 2500.0
thickness_mm = 36.0
[pose]
centre_mm = [6000.0, 0.0, -3600.0]
yaw_deg = 0.0
"#;

const PLATE: &str = "[plate]\nid = \"P\"\nwidth_mm = 3000.0\nheight_mm = 2500.0\nthickness_mm = 36.0\n";

impl Bench {
    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.file(name);
        std::fs::write(&path, content).unwrap();
        path
    }
}

struct Said {
    code: Option<i32>,
    out: String,
    err: String,
}

/// Measures with an `--out` folder, which must not exist afterwards if the measurement fails.
fn measure(scan: &Path, plate: &Path, more: &[&str]) -> Said {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    let out = scan.with_extension(format!("out{}", NUMBER.fetch_add(1, Ordering::Relaxed)));
    let mut command = platen_tests::program("platen");
    command.arg("measure").arg(scan).arg("--plate").arg(plate).arg("--out").arg(&out).args(more);
    if !more.contains(&"--u-axis") {
        command.args(["--u-axis", "1,0,0"]);
    }
    let output = command.output().unwrap();
    let said = Said {
        code: output.status.code(),
        out: String::from_utf8(output.stdout).unwrap(),
        err: String::from_utf8(output.stderr).unwrap(),
    };
    let parent = std::fs::read_dir(out.parent().unwrap()).unwrap();
    let parts: Vec<_> = parent.flatten().map(|e| e.path()).filter(|p| is_part_of(p, &out)).collect();
    assert!(parts.is_empty(), "{parts:?}");
    assert_eq!(out.exists(), said.code == Some(0), "{}", said.err);
    said
}

/// Returns whether a path is the name of a partial folder.
fn is_part_of(path: &Path, out: &Path) -> bool {
    let name = |p: &Path| p.file_name().unwrap().to_string_lossy().into_owned();
    path != out && name(path).starts_with(&format!("{}.", name(out)))
}

/// Checks for one sentence on stderr that contains all of `words`, and no output on stdout.
#[track_caller]
fn check(said: &Said, code: i32, words: &[&str]) {
    assert_eq!(said.code, Some(code), "{}{}", said.out, said.err);
    assert_eq!(said.err.trim_end().lines().count(), 1, "{}", said.err);
    assert!(said.out.is_empty(), "{}", said.out);
    for word in words {
        assert!(said.err.contains(word), "`{word}` is not in: {}", said.err);
    }
}

#[test]
fn a_sound_scan_is_measured_and_judged_by_nothing() {
    let bench = bench();
    let said = measure(&bench.file("scan.e57"), &bench.file("plate.toml"), &["--flattening", "harmonic"]);
    assert_eq!(said.code, Some(0), "{}", said.err);
    assert!(said.out.starts_with("plate P: cannot tell"), "{}", said.out);
}

#[test]
fn damaged_files_are_refused() {
    let bench = bench();
    let whole = std::fs::read(bench.file("scan.e57")).unwrap();
    let plate = bench.file("plate.toml");
    let cut = bench.write("cut.e57", &whole[..whole.len() / 3]);
    check(&measure(&cut, &plate, &[]), 1, &["cut.e57"]);
    let mut flipped = whole;
    let middle = flipped.len() / 2;
    flipped[middle] ^= 0x10;
    let flipped = bench.write("flipped.e57", &flipped);
    check(&measure(&flipped, &plate, &[]), 1, &["flipped.e57"]);
    let text = std::fs::read_to_string(bench.file("scan.ptx")).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let few = bench.write("few.ptx", lines[..lines.len() - 10].join("\n"));
    check(&measure(&few, &plate, &[]), 1, &["few.ptx"]);
    check(&measure(&bench.file("absent.e57"), &plate, &[]), 1, &["absent.e57"]);
}

#[test]
fn a_cloud_without_a_lattice_is_refused_with_what_to_export() {
    let bench = bench();
    let cloud: String = (0..5000)
        .map(|i| format!("{} {} {}\n", (i * 7919) % 1009, (i * 104_729) % 1013, (i * 1299) % 997))
        .collect();
    let cloud = bench.write("cloud.xyz", cloud);
    check(&measure(&cloud, &bench.file("plate.toml"), &[]), 1, &["cloud.xyz"]);
}

#[test]
fn millimetres_are_recognised_converted_and_said() {
    let bench = bench();
    let text = std::fs::read_to_string(bench.file("scan.ptx")).unwrap();
    let mut millimetres = String::new();
    for (number, line) in text.lines().enumerate() {
        let mut fields: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
        if number >= 10 {
            for field in &mut fields[..3] {
                *field = format!("{:.3}", field.parse::<f64>().unwrap() * 1000.0);
            }
        }
        millimetres += &fields.join(" ");
        millimetres.push('\n');
    }
    let file = bench.write("mm.ptx", millimetres);
    let said = measure(&file, &bench.file("plate.toml"), &["--flattening", "harmonic", "--json"]);
    assert_eq!(said.code, Some(0), "{}", said.err);
    let result: serde_json::Value = serde_json::from_str(&said.out).unwrap();
    assert!(result["scan"]["notes"].to_string().contains("millimet"), "{}", result["scan"]["notes"]);
    let direct =
        measure(&bench.file("scan.ptx"), &bench.file("plate.toml"), &["--flattening", "harmonic", "--json"]);
    let direct: serde_json::Value = serde_json::from_str(&direct.out).unwrap();
    for corner in 0..4 {
        for k in 0..3 {
            let (a, b) = (&result["corners_m"][corner][k], &direct["corners_m"][corner][k]);
            assert!((a.as_f64().unwrap() - b.as_f64().unwrap()).abs() < 1e-4, "{a} {b}");
        }
    }
}

#[test]
fn the_wrong_plate_is_refused() {
    let bench = bench();
    let scan = bench.file("scan.e57");
    let other = bench.write("other.toml", PLATE.replace("3000.0", "4000.0"));
    check(&measure(&scan, &other, &[]), 1, &["4000", "check the recipe"]);
    let small = bench.write("small.toml", PLATE.replace("3000.0", "1200.0").replace("2500.0", "800.0"));
    check(&measure(&scan, &small, &[]), 1, &["plate"]);
}

#[test]
fn a_hint_near_45_degrees_on_a_square_plate_is_refused() {
    let bench = bench();
    let simulated = bench.write("square-sim.toml", SIMULATED.replace("3000.0", "2500.0"));
    let scan = bench.file("square.e57");
    let made = platen_tests::program("platen-sim")
        .arg("scanner")
        .arg(simulated)
        .arg("--out")
        .arg(&scan)
        .args(["--step-deg", "0.12"])
        .output()
        .unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let plate = bench.write("square.toml", PLATE.replace("3000.0", "2500.0"));
    check(&measure(&scan, &plate, &["--u-axis", "1,1,0"]), 1, &["45"]);
    assert_eq!(measure(&scan, &plate, &["--u-axis", "0,1,0", "--flattening", "harmonic"]).code, Some(0));
}

#[test]
fn wrong_plugins_are_refused() {
    let bench = bench();
    let (scan, plate) = (bench.file("scan.e57"), bench.file("plate.toml"));
    check(&measure(&scan, &plate, &["--flattening", "harmonik"]), 1, &["harmonik", "not found", "harmonic?"]);
    check(
        &measure(&scan, &plate, &["--flattening", "displacement"]),
        1,
        &["displacement", "a flattening is needed"],
    );
}

#[test]
fn every_fault_of_a_file_is_reported_at_its_place() {
    let bench = bench();
    let faulty = bench.write(
        "faulty.toml",
        "[plate]\nid = \"P\"\nwidht_mm = 3000.0\nheight_mm = -5.0\nthickness_mm = \"thick\"\n\
         [target]\nshape = \"sphre\"\nradius_mm = 9000.0\n[[template]]\nline = \"R1\"\nchord_mm = 2000.0\nlimit_mm = 3.0\n\
         [[marker]]\nname = \"M\"\nat_mm = [1.0]\n",
    );
    let output = platen_tests::program("platen").arg("check").arg(&faulty).output().unwrap();
    let out = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(2), "{out}");
    for fault in [
        "faulty.toml:3:",
        "faulty.toml:4:",
        "faulty.toml:5:",
        "faulty.toml:7:",
        "faulty.toml:10:",
        "faulty.toml:15:",
    ] {
        assert!(out.contains(fault), "{fault} is not in:\n{out}");
    }
    assert!(out.contains("width_mm") && out.contains("sphere"), "{out}");
    let said = measure(&bench.file("scan.e57"), &faulty, &[]);
    assert_eq!(said.code, Some(2), "{}", said.err);
}

#[test]
fn a_real_scan_without_a_plate_is_refused() {
    let bench = bench();
    let plate = bench.write("long.toml", PLATE.replace("3000.0", "5000.0").replace("2500.0", "2000.0"));
    for pump in platen_tests::samples::each("lattice/pumpA.e57") {
        check(&measure(&pump, &plate, &[]), 1, &["plate"]);
    }
}

#[test]
fn the_same_scan_gives_the_same_result_to_the_last_bit() {
    let bench = bench();
    let result = || {
        let said = measure(
            &bench.file("scan.e57"),
            &bench.file("plate.toml"),
            &["--flattening", "elastic", "--json"],
        );
        let mut result: serde_json::Value = serde_json::from_str(&said.out).unwrap();
        result.as_object_mut().unwrap().remove("timings_ms");
        result.to_string()
    };
    assert_eq!(result(), result());
}
