//! Tests of one scene in every format and order: the same cells within the quantum of each encoding, and the same
//! verdict.
//!
//! The files come from the simulator's own writers and are read by the real driver library. Verdicts come from
//! `platen measure`. The output of `platen convert` must give the same cells again.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::Duration;

use platen_engine::pipeline;
use platen_engine::plugin::{Catalogue, JobSpec, Scanner};
use platen_plant::Value;
use platen_scan::{Lattice, wrap_azimuth};
use platen_sim_plate::{Plate, PlateState};
use platen_sim_scanner::stream::{
    Bridge, BridgeConfig, Head, Plan, Receiver, ScanLayout, ScanSettings, Values, column_payload,
};
use platen_sim_scanner::{
    E57Encoding, FileFormat, FileOrder, Instrument, Scene, SimLattice, SimScan, SimState, Surroundings,
    scan_all,
};

const STATE: &str = r#"
shape = { shape = "cylinder", radius_mm = 9000.0, axis_deg = 90.0 }
[blank]
width_mm = 3000.0
height_mm = 2500.0
thickness_mm = 36.0
"#;

const PLATE: &str = r#"
[plate]
id = "P"
width_mm = 3000.0
height_mm = 2500.0
thickness_mm = 36.0
[target]
shape = "cylinder"
radius_mm = 8500.0
axis_deg = 90.0
[[reference_line]]
name = "R1"
from_mm = [0.0, 1250.0]
to_mm = [3000.0, 1250.0]
[[template]]
line = "R1"
chord_mm = 2000.0
limit_mm = 3.0
"#;

/// Scene, scanned once.
struct Bench {
    scan: SimScan,
    folder: tempfile::TempDir,
}

fn bench() -> &'static Bench {
    static BENCH: OnceLock<Bench> = OnceLock::new();
    BENCH.get_or_init(|| {
        let state: PlateState = toml::from_str(STATE).unwrap();
        let plate = Plate::new(&state).unwrap();
        let lattice = SimLattice::of_plate(Some(&plate), 0.1, 0.12_f64.to_radians());
        let scene = Scene::new(Some(plate), &Surroundings::default());
        let instrument = Instrument { range_sigma: 5e-4, seed: 3, ..Instrument::default() };
        let scan = SimScan { lattice, columns: scan_all(&scene, &lattice, &instrument, 2) };
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("plate.toml"), PLATE).unwrap();
        Bench { scan, folder }
    })
}

impl Bench {
    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn written(&self, name: &str, format: FileFormat, order: FileOrder) -> PathBuf {
        let path = self.file(name);
        self.scan.write(&path, format, order).unwrap();
        path
    }
}

/// Returns every stored form of the scene, with half a step of its coordinates.
fn written() -> &'static [(PathBuf, f64)] {
    static WRITTEN: OnceLock<Vec<(PathBuf, f64)>> = OnceLock::new();
    WRITTEN.get_or_init(write_all)
}

fn write_all() -> Vec<(PathBuf, f64)> {
    let bench = bench();
    // Between 8 and 16 m a coordinate's last bit as f32 is a micrometre.
    let (scaled, single, exact, decimals) = (5e-6, 5e-7, 0.0, 5e-7);
    let e57 = |encoding| FileFormat::E57(encoding);
    let usual = FileOrder::default();
    let bottom_up = FileOrder { bottom_up: true, ..usual };
    let transposed = FileOrder { transposed: true, ..usual };
    let all = FileOrder { bottom_up: true, counter_clockwise: true, transposed: true };
    let mut files = Vec::new();
    for (name, format, order, quantum) in [
        ("scaled.e57", e57(E57Encoding::CartesianScaled), usual, scaled),
        ("double.e57", e57(E57Encoding::CartesianDouble), usual, exact),
        ("single.e57", e57(E57Encoding::CartesianSingle), usual, single),
        ("spherical.e57", e57(E57Encoding::Spherical), usual, exact),
        ("transposed.e57", e57(E57Encoding::CartesianDouble), transposed, exact),
        ("turned.e57", e57(E57Encoding::Spherical), all, exact),
        ("lf.ptx", FileFormat::Ptx { crlf: false }, usual, decimals),
        ("crlf.ptx", FileFormat::Ptx { crlf: true }, usual, decimals),
        ("bottom-up.ptx", FileFormat::Ptx { crlf: false }, bottom_up, decimals),
        ("transposed.ptx", FileFormat::Ptx { crlf: true }, transposed, decimals),
        ("usual.xyz", FileFormat::Xyz, usual, decimals),
        ("turned.xyz", FileFormat::Xyz, all, decimals),
        ("usual.xyb", FileFormat::Xyb, usual, exact),
        ("bottom-up.xyb", FileFormat::Xyb, bottom_up, exact),
        ("transposed.xyb", FileFormat::Xyb, transposed, exact),
    ] {
        files.push((bench.written(name, format, order), quantum));
    }
    files.push((mirrored(&files[6].0), decimals));
    // Ranges in micrometres, angles in nanoradians.
    files.push((streamed(), decimals + 2e-8));
    files
}

/// Scanner that delivers the scene once more.
struct Again(SimScan);

impl Head for Again {
    fn plan(&self, settings: &ScanSettings) -> Result<Plan, String> {
        Ok(Plan { settings: *settings, duration_s: 0.0, computing_s: 0.0, altered: Vec::new() })
    }

    fn scan(&self, _: &Plan, _: u32, out: &mut dyn Receiver) -> Result<(), String> {
        let lattice = &self.0.lattice;
        let begin = ScanLayout {
            rows: lattice.n_rows,
            columns: lattice.n_columns,
            azimuth_start: lattice.azimuth_start,
            azimuth_step: lattice.azimuth_step,
            elevation_start: lattice.elevation_start,
            elevation_step: -lattice.elevation_step,
            values: Values::Polar,
            range_unit_m: 1e-6,
            intensity: [0, 2047],
            seam_column: None,
            order: "azimuth".to_owned(),
            instrument: "again".to_owned(),
            acquired_unix_s: None,
            range_error_m: None,
            simulated: true,
            altered: Vec::new(),
            warm_up_columns: 0,
        };
        let _ = out.begin(begin.clone());
        for (number, column) in self.0.columns.iter().enumerate() {
            let _ = out.column(column_payload(column, number as u32, &begin, 0.0));
        }
        Ok(())
    }
}

/// Passes the scene through the driver `faro-stream` and `platen scan` into a file.
fn streamed() -> PathBuf {
    let bench = bench();
    let bridge = Bridge::start(BridgeConfig::default(), Box::new(Again(bench.scan.clone()))).unwrap();
    let (plant, out) = (bench.file("stream.toml"), bench.file("streamed.e57"));
    let text = format!(
        "[plant]\nname = \"test\"\n[scanner]\nplugin = \"faro-stream\"\n[scanner.options]\naddress = \"{}\"\n",
        bridge.address()
    );
    std::fs::write(&plant, text).unwrap();
    let said = run(&["scan".as_ref(), plant.as_ref(), out.as_ref()]);
    assert_eq!(said["columns"].as_u64().unwrap(), u64::from(bench.scan.lattice.n_columns), "{said}");
    out
}

/// Returns the PTX with a left-handed frame: y is mirrored in the points and in the matrix.
fn mirrored(ptx: &Path) -> PathBuf {
    let text = std::fs::read_to_string(ptx).unwrap();
    let line = |(number, line): (usize, &str)| match number {
        7 => "0 -1 0 0\n".to_owned(),
        10.. => {
            let [x, y, rest] = line.splitn(3, ' ').collect::<Vec<_>>().try_into().unwrap();
            format!("{x} {} {rest}\n", -y.parse::<f64>().unwrap())
        }
        _ => format!("{line}\n"),
    };
    let path = ptx.with_file_name("mirrored.ptx");
    std::fs::write(&path, text.lines().enumerate().map(line).collect::<String>()).unwrap();
    path
}

/// Reads a file through the built library.
fn read(path: &Path) -> Lattice {
    let catalogue = Catalogue::new(Some(platen_tests::built()));
    let options = [("file", Value::Path(path.into()))];
    let (library, values) = pipeline::load_with(&catalogue, "faro-file", options).unwrap();
    let scanner = Scanner::create(&library, &values).unwrap();
    let scan = scanner.start(JobSpec::untriggered(Duration::from_secs(100)), None);
    let mut scan = scan.unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let mut lattice = Lattice::new(scan.header().clone());
    scan.by_ref().for_each(|column| lattice.push(&column.unwrap()).unwrap());
    assert_eq!(lattice.n_valid() as u64, scan.finish().unwrap().points, "{}", path.display());
    lattice
}

/// Checks that every cell of the scene is present, within `quantum` of each coordinate, and no other cell.
#[track_caller]
fn check_cells(path: &Path, quantum: f64) {
    let (scan, lattice) = (&bench().scan, read(path));
    let header = lattice.header();
    let steps = |angle: f64, step: f64| (angle / step).round() as usize;
    // Files without empty cells begin at the first row and column with a cell.
    let ahead = wrap_azimuth(header.azimuth_start - scan.lattice.azimuth_start);
    let first_column = steps(ahead, scan.lattice.azimuth_step);
    let first_row = steps(scan.lattice.elevation_start - header.elevation_start, scan.lattice.elevation_step);
    let name = path.display();
    let mut found = 0;
    for (index, truth) in scan.columns.iter().enumerate() {
        for row in (0..scan.lattice.n_rows as usize).filter(|row| truth.state[*row] == SimState::Valid) {
            let (column, place) = (index - first_column, row - first_row);
            let point = lattice.point(lattice.cell(column, place));
            let point = point.unwrap_or_else(|| panic!("{name}: cell ({row}, {index}) is lost"));
            let direction =
                platen_scan::Direction { azimuth: truth.azimuth[row], elevation: truth.elevation[row] };
            let expected = direction.unit().map(|c| c * f64::from(truth.range_m[row]));
            let limit = quantum + 1e-12;
            let far = (0..3).map(|k| (point[k] - expected[k]).abs()).fold(0.0, f64::max);
            assert!(far <= limit, "{name}: cell ({row}, {index}) is {far:e} m off, {limit:e} allowed");
            found += 1;
        }
    }
    assert_eq!(found, lattice.n_valid(), "{name}: cells that were not measured");
}

#[test]
fn one_scene_gives_the_same_cells_in_every_format_and_order() {
    for (path, quantum) in written() {
        check_cells(path, *quantum);
    }
}

fn run(arguments: &[&std::ffi::OsStr]) -> serde_json::Value {
    let output = platen_tests::program("platen").args(arguments).arg("--json").output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn measured(scan: &Path) -> serde_json::Value {
    let (plate, plant) = (bench().file("plate.toml"), bench().file("plant.toml"));
    // No format contains it, but the scanner of the scene has no range error besides its noise.
    let text = "[frame]\nu_axis = [1.0, 0.0, 0.0]\n[scanner]\nplugin = \"faro-file\"\nrange_error_mm = 0.0\n";
    std::fs::write(&plant, text).unwrap();
    run(&[
        "measure".as_ref(),
        scan.as_ref(),
        "--plate".as_ref(),
        plate.as_ref(),
        "--plant".as_ref(),
        plant.as_ref(),
    ])
}

#[test]
fn one_scene_gives_the_same_verdict_in_every_format() {
    let mut first: Option<serde_json::Value> = None;
    for (path, _) in written() {
        let result = measured(path);
        let first = first.get_or_insert_with(|| result.clone());
        let name = path.display();
        assert_eq!(result["verdict"], first["verdict"], "{name}");
        assert_ne!(result["verdict"], "cannot_tell", "{name}: {}", result["says"]);
        for (corner, expected) in
            result["corners_m"].as_array().unwrap().iter().zip(first["corners_m"].as_array().unwrap())
        {
            for k in 0..3 {
                let apart = corner[k].as_f64().unwrap() - expected[k].as_f64().unwrap();
                assert!(apart.abs() < 1e-4, "{name}: corner {corner} instead of {expected}");
            }
        }
        let gap = |result: &serde_json::Value| {
            result["reference_lines"][0]["templates"][0]["max_gap_mm"].as_f64().unwrap()
        };
        assert!((gap(&result) - gap(first)).abs() < 0.02, "{name}: {} {}", gap(&result), gap(first));
    }
}

#[test]
fn conversions_keep_every_cell() {
    let bench = bench();
    let mut from = bench.written("origin.e57", FileFormat::E57(E57Encoding::Spherical), FileOrder::default());
    let mut quantum = 0.0;
    // Each from the previous one: errors add up.
    for (step, (ending, adds)) in
        [("e57", 0.0), ("xyb", 0.0), ("e57", 0.0), ("ptx", 5e-7), ("xyz", 5e-7), ("xyb", 0.0), ("e57", 0.0)]
            .into_iter()
            .enumerate()
    {
        let to = bench.file(&format!("converted-{step}.{ending}"));
        let said = run(&["convert".as_ref(), from.as_ref(), to.as_ref()]);
        quantum += adds;
        check_cells(&to, quantum);
        assert_eq!(said["bytes"], std::fs::metadata(&to).unwrap().len(), "{said}");
        from = to;
    }
}

#[test]
fn a_conversion_is_whole_or_not_there() {
    let bench = bench();
    let whole = bench.written("whole.e57", FileFormat::E57(E57Encoding::Spherical), FileOrder::default());
    let bytes = std::fs::read(&whole).unwrap();
    let cut = bench.file("cut.e57");
    std::fs::write(&cut, &bytes[..bytes.len() / 2]).unwrap();
    let refused = |from: &Path, to: &Path, code: i32, words: &str| {
        let output = platen_tests::program("platen").arg("convert").args([from, to]).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{said}");
        assert!(said.contains(words) && said.trim_end().lines().count() == 1, "{said}");
    };
    refused(&cut, &bench.file("of-cut.e57"), 1, "cut.e57: faro-file: E57 file is incomplete");
    refused(&whole, &bench.file("out.las"), 2, "let the name end in .e57, .ptx, .xyz or .xyb");
    refused(&whole, &cut, 2, "exists already");
    refused(&whole, Path::new("/nowhere/out.e57"), 1, "check the folder");
    let left = std::fs::read_dir(bench.folder.path()).unwrap().flatten().map(|e| e.file_name());
    let left: Vec<_> = left
        .filter(|name| {
            name.to_string_lossy().contains("out.") || name.to_string_lossy().starts_with("of-cut")
        })
        .collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn a_picture_shows_the_scan_and_the_decisions_are_said() {
    let bench = bench();
    let order = FileOrder { bottom_up: true, transposed: true, ..FileOrder::default() };
    let scan = bench.written("pictured.ptx", FileFormat::Ptx { crlf: false }, order);
    let picture = bench.file("picture.png");
    let said = run(&["inspect".as_ref(), scan.as_ref(), "--picture".as_ref(), picture.as_ref()]);
    let notes = said["notes"].to_string();
    assert_eq!(said["notes"][0], "read from PTX");
    assert!(notes.contains("rows and columns are swapped"), "{notes}");
    assert!(notes.contains("row 0 is at the bottom of the file"), "{notes}");
    let bytes = std::fs::read(&picture).unwrap();
    let size = |at: usize| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap());
    assert!(bytes.starts_with(b"\x89PNG"));
    // Equal steps: one pixel for each cell.
    assert_eq!(i64::from(size(16)), said["columns"].as_i64().unwrap());
    assert_eq!(i64::from(size(20)), said["rows"].as_i64().unwrap());
}
