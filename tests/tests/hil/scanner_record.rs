//! Recording and replay of frames, direction of rotation, two faces, memory during the scan of a whole dome, scan
//! window.
//!
//! The driver library `faro-stream` is loaded as by the host and runs against the simulator's bridge.

use std::f64::consts::PI;
use std::io::{BufRead as _, BufReader};
use std::net::SocketAddr;
use std::process::{Command, Stdio};
use std::time::Instant;

use crate::stream::{COARSE, LIMIT, WINDOW, bridge, cells, driver, head, scan, start};
use platen_engine::plugin::JobSpec;
use platen_scan::{Face, Lattice, Window};
use platen_sim_scanner::stream::{
    Bridge, BridgeConfig, Head, Plan, RayCastHead, Receiver, ScanLayout, ScanSettings, Values, column_payload,
};
use platen_sim_scanner::{Faces, Instrument, Label, SimColumn, SimState, TruthCell};

fn lattice_of(bridge: &Bridge, options: &str, window: &Window) -> Lattice {
    scan(&driver(bridge.address(), options), Some(window), LIMIT).unwrap().0
}

#[test]
fn a_replayed_recording_gives_the_same_lattice() {
    let folder = tempfile::tempdir().unwrap();
    let config = BridgeConfig { record: Some(folder.path().into()), ..BridgeConfig::default() };
    let recording = start(&[], config, head());
    let recorded = lattice_of(&recording, COARSE, &WINDOW);
    let file = folder.path().join("scan-00001.psb");
    assert!(file.metadata().unwrap().len() > 1000);

    // Replayed by `platen-sim`, over a link that is cut and shuffles columns.
    let mut child = platen_tests::program("platen-sim")
        .args(["scanner", "--serve", "127.0.0.1:0", "--with-parent", "--fault", "drop-often=9", "--fault"])
        .args(["shuffled=5", "--replay"])
        .arg(&file)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut ready = String::new();
    let mut out = BufReader::new(child.stdout.take().unwrap());
    out.read_line(&mut ready).unwrap();
    let ready: serde_json::Value = serde_json::from_str(&ready).unwrap();
    let address: SocketAddr = ready["scanner"].as_str().unwrap().parse().unwrap();
    let (replayed, end) = scan(&driver(address, COARSE), Some(&WINDOW), LIMIT).unwrap();
    assert!(cells(&recorded) == cells(&replayed));
    assert_eq!(end.warm_up_columns, 10);
    assert!(replayed.header().notes.iter().any(|note| note.starts_with("a recording is replayed")));
    drop(child.stdin.take());
    assert!(child.wait().unwrap().success());

    // A truncated recording is refused.
    let whole = std::fs::read(&file).unwrap();
    std::fs::write(&file, &whole[..whole.len() - 3]).unwrap();
    let refused = platen_tests::program("platen-sim")
        .args(["scanner", "--serve", "127.0.0.1:0", "--replay"])
        .arg(&file)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(
        refused.status.code() == Some(1) && said.contains("the recording is incomplete or invalid"),
        "{said}"
    );
}

#[test]
fn a_clockwise_scanner_gives_the_same_lattice() {
    let warm = || Instrument { warm_up_columns: 0, ..head().instrument };
    for values in [Values::Range, Values::Polar] {
        let [plain, mirrored] = [false, true].map(|mirrored| {
            let head = RayCastHead { values, mirrored, instrument: warm(), ..head() };
            lattice_of(&start(&[], BridgeConfig::default(), head), COARSE, &WINDOW)
        });
        assert_eq!((plain.n_rows(), plain.n_columns()), (mirrored.n_rows(), mirrored.n_columns()));
        assert!(plain.n_valid() > 700 && plain.n_valid() == mirrored.n_valid());
        for cell in 0..plain.n_rows() * plain.n_columns() {
            assert_eq!(plain.range(cell), mirrored.range(cell));
            let (Some(a), Some(b)) = (plain.direction(cell), mirrored.direction(cell)) else { continue };
            assert!((a.azimuth - b.azimuth).abs() < 2e-9 && (a.elevation - b.elevation).abs() < 2e-9);
        }
        assert!(mirrored.header().notes.iter().any(|note| note.contains("columns reversed")));
    }
}

#[test]
fn a_window_wider_than_half_a_turn_uses_both_faces() {
    let faces = Faces { seam_column: 0, collimation: 0.0, trunnion: 0.0, moved: [0.0; 3] };
    let head = RayCastHead { faces: Some(faces), ..head() };
    let bridge = start(&["shuffled=12"], BridgeConfig::default(), head);
    let around = Window { azimuth_start: -0.6 * PI, azimuth_width: 1.2 * PI, ..WINDOW };
    let lattice = lattice_of(&bridge, COARSE, &around);
    let seam = lattice.header().seam_column.unwrap() as usize;
    let step = lattice.header().azimuth_step;
    assert!((seam as f64 * step - PI).abs() < step, "half a turn is seen by the front face: {seam}");
    assert_eq!(lattice.face(seam - 1), Some(Face::Front));
    assert_eq!(lattice.face(seam), Some(Face::Back));
    let narrow = lattice_of(&bridge, COARSE, &WINDOW);
    assert_eq!(narrow.header().seam_column, None);
}

/// Head that scans a whole dome of constant range, without ray casting.
struct Dome {
    rows: u32,
    columns: u32,
}

impl Head for Dome {
    fn plan(&self, settings: &ScanSettings) -> Result<Plan, String> {
        Ok(Plan { settings: *settings, duration_s: 1.0, computing_s: 1.0, altered: Vec::new() })
    }

    fn scan(&self, _: &Plan, _: u32, out: &mut dyn Receiver) -> Result<(), String> {
        let (step, n) = (2.0 * PI / f64::from(self.columns), self.rows as usize);
        let begin = ScanLayout {
            rows: self.rows,
            columns: self.columns,
            azimuth_start: -PI,
            azimuth_step: step,
            elevation_start: PI / 2.0,
            elevation_step: -step,
            values: Values::Range,
            range_unit_m: 1e-6,
            intensity: [0, 2047],
            seam_column: None,
            warm_up_columns: 0,
            order: "azimuth".into(),
            instrument: "dome".into(),
            acquired_unix_s: None,
            range_error_m: None,
            simulated: true,
            altered: Vec::new(),
        };
        let truth = TruthCell { label: Label::Wall, mixed: false, range: 7.0 };
        let mut column = SimColumn {
            index: 0,
            back_face: false,
            range_m: vec![7.0; n],
            azimuth: vec![0.0; n],
            elevation: vec![0.0; n],
            intensity: vec![900; n],
            state: vec![SimState::Valid; n],
            truth: vec![truth; n],
        };
        let mut going = out.begin(begin.clone());
        while going.is_continue() && column.index < self.columns {
            column.range_m[column.index as usize % n] = 7.0 + column.index as f32 * 1e-3;
            going = out.column(column_payload(&column, column.index, &begin, 0.0));
            column.index += 1;
        }
        Ok(())
    }
}

/// Returns the peak resident memory of this process in kilobytes.
fn most_memory_kb() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|line| line.starts_with("VmHWM:")).unwrap();
    line.split_whitespace().nth(1).unwrap().parse().unwrap()
}

const DOME_BRIDGE: &str = "PLATEN_TEST_DOME_BRIDGE";

/// 7 million cells; with `PLATEN_DOME=full` 44 million, a full scan at 1/4 resolution.
#[test]
fn a_dome_is_streamed_in_bounded_memory() {
    if let Some(address) = std::env::var_os(DOME_BRIDGE) {
        return take_dome(&address.to_string_lossy());
    }
    let full = std::env::var_os("PLATEN_DOME").is_some_and(|size| size == "full");
    let (rows, columns) = if full { (4338, 10240) } else { (1735, 4096) };
    let bridge = Bridge::start(BridgeConfig::default(), Box::new(Dome { rows, columns })).unwrap();
    // In a process of its own, whose memory is that of driver and host without the bridge.
    let output = Command::new(std::env::current_exe().unwrap())
        .args(["scanner_record::a_dome_is_streamed_in_bounded_memory", "--exact", "--nocapture"])
        .env(DOME_BRIDGE, bridge.address().to_string())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{said}{}", String::from_utf8_lossy(&output.stderr));
    let line = said.lines().find_map(|line| line.strip_prefix("dome ")).unwrap();
    println!("{line}");
    let figures: Vec<u64> = line.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    assert_eq!(figures[0], u64::from(rows) * u64::from(columns));
    // All cells at once would need 31 bytes each at the plugin boundary: 220 MB, for the full dome 1.4 GB.
    assert!(figures[1] < 40_000, "the scan took {} kB of memory", figures[1]);
}

fn take_dome(address: &str) {
    let scanner = driver(address.parse().unwrap(), "divisor = 4");
    scanner.instance().open(LIMIT).unwrap();
    let (before, started) = (most_memory_kb(), Instant::now());
    let mut points = 0;
    let spec = JobSpec::untriggered(10 * LIMIT);
    let mut scan = scanner.start(spec, None).unwrap();
    scan.by_ref().for_each(|column| points += column.unwrap().range_m.len() as u64);
    assert_eq!(scan.finish().unwrap().points, points);
    let (taken, seconds) = (most_memory_kb() - before, started.elapsed().as_secs_f64());
    println!("\ndome {points} cells in {taken} kB beyond the {before} kB before, {seconds:.1} s");
}

#[test]
fn the_scan_covers_the_requested_window_only() {
    let bridge = bridge(&[]);
    let whole = scan(&driver(bridge.address(), COARSE), None, LIMIT).unwrap().0;
    let window = lattice_of(&bridge, COARSE, &WINDOW);
    assert!(window.n_columns() * 2 < whole.n_columns() && window.n_rows() < whole.n_rows());
    let slack = 0.01;
    let wider = Window {
        azimuth_start: WINDOW.azimuth_start - slack,
        azimuth_width: WINDOW.azimuth_width + 2.0 * slack,
        elevation_min: WINDOW.elevation_min - slack,
        elevation_max: WINDOW.elevation_max + slack,
    };
    for cell in 0..window.n_columns() * window.n_rows() {
        assert!(window.direction(cell).is_none_or(|direction| wider.contains(direction)));
    }
    let scanner = driver(bridge.address(), "divisor = 4\nrate_kpts = 122");
    let seconds = |window| scanner.estimate(window, LIMIT).unwrap().unwrap();
    assert!(seconds(Some(&WINDOW)) < seconds(None));
}
