//! Test of a whole cell: host, simulated press on Modbus, and simulated scanner by the scan bridge protocol or as a
//! folder of files.
//!
//! Each is a process of its own, connected only by sockets and files, except in one test whose scanner moves the plate.
//! The results that the press accepted are compared with the host's record and with the known plate.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};

use crate::cell::{Host, Press, assert_clean, until};
use nalgebra::Vector3;
use platen_sim_plate::{Plate, PlateState, Reply};
use platen_sim_scanner::stream::{Bridge, BridgeConfig, RayCastHead};
use serde_json::Value as Json;

/// Process `platen-sim cell`.
struct Cell {
    child: Child,
    out: BufReader<ChildStdout>,
    modbus: String,
    /// Address of the scan bridge; empty when scans are files.
    scanner: String,
    line: BufReader<TcpStream>,
}

impl Cell {
    /// Starts a cell whose scans are transferred over TCP.
    fn start(press: &Path, more: &[&str]) -> Self {
        Self::run(press, &[&["--serve", "127.0.0.1:0"], more].concat())
    }

    fn run(press: &Path, more: &[&str]) -> Self {
        let mut child = platen_tests::program("platen-sim")
            .arg("cell")
            .arg(press)
            .args(["--with-parent", "--modbus-port", "0", "--plate-port", "0"])
            .args(more)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut out = BufReader::new(child.stdout.take().unwrap());
        let mut ready = String::new();
        out.read_line(&mut ready).unwrap();
        let ready: Json = serde_json::from_str(&ready).unwrap();
        let port = |name: &str| ready[name].as_str().unwrap_or_default().to_owned();
        let line = BufReader::new(TcpStream::connect(port("plate")).unwrap());
        Self { child, out, modbus: port("modbus"), scanner: port("scanner"), line }
    }

    fn ask<T: serde::de::DeserializeOwned>(&mut self, question: &str) -> T {
        writeln!(self.line.get_mut(), "{question}").unwrap();
        let mut answer = String::new();
        self.line.read_line(&mut answer).unwrap();
        serde_json::from_str(&answer).unwrap()
    }

    /// Waits for the end of the strokes; returns the counters of the press and the last plate in it.
    fn wait_done(&mut self) -> (Json, PlateState) {
        let mut plate = None;
        until("the end of the strokes", || {
            if let Reply::Plate(Some(state)) = self.ask(r#"{"get":"plate"}"#) {
                plate = Some(*state);
            }
            let mut stats: Json = self.ask(r#"{"get":"stats"}"#);
            let done = stats["stats"]["done"] == true;
            done.then(|| (stats["stats"].take(), plate.take().unwrap()))
        })
    }

    /// Ends the process and returns the counters of its bridge.
    fn end(mut self) -> Json {
        drop(self.child.stdin.take());
        let mut said = String::new();
        self.out.read_to_string(&mut said).unwrap();
        assert!(self.child.wait().unwrap().success());
        let said: Json = serde_json::from_str(&said).unwrap();
        said["bridge"].clone()
    }
}

impl Drop for Cell {
    fn drop(&mut self) {
        // An error means that the process has ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Writes `config/sim-cell-plant.toml` with other ports into `folder`.
fn plant(folder: &Path, modbus: &str, scanner: &str, change: impl Fn(String) -> String) -> PathBuf {
    let config = platen_tests::repository().join("config");
    let text = std::fs::read_to_string(config.join("sim-cell-plant.toml")).unwrap();
    let port = |address: &str| address.rsplit(':').next().unwrap().to_owned();
    let plates = format!("folder = {:?}", config.join("plates"));
    let text = text
        .replace("15020", &port(modbus))
        .replace("127.0.0.1:15022", scanner)
        .replace("folder = \"plates\"", &plates)
        .replace("../platen-results", "results");
    let path = folder.join("plant.toml");
    std::fs::write(&path, change(text)).unwrap();
    path
}

/// Writes `config/sim-press.toml` with a fast ram into `folder`.
fn press(folder: &Path, change: impl Fn(String) -> String) -> PathBuf {
    let text = std::fs::read_to_string(platen_tests::repository().join("config/sim-press.toml")).unwrap();
    let path = folder.join("press.toml");
    let quick = "\n[timings]\ndown_ms = 20\nup_ms = 20\nbetween_ms = 10\n";
    std::fs::write(&path, change(text) + quick).unwrap();
    path
}

/// Sets a fixed programme of this many bends, whatever the results, five in a pass.
fn programme(text: String, strokes: u32, passes: u32) -> String {
    text.replace("strokes = 14", &format!("strokes = {strokes}"))
        .replace("closed_loop", "programme")
        .replace("passes = 1", &format!("passes = {passes}"))
}

/// Reads the result document of a record.
fn document(record: &Json) -> Json {
    let path = record["document"].as_str().unwrap_or_else(|| panic!("no document: {record:#}"));
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// Asserts that each result accepted by the press is the recorded one; its register of gap.max is in hundredths of a
/// millimetre.
#[track_caller]
fn assert_registers(history: &[Json], taken: &[Json]) {
    assert_eq!(history.len(), taken.len());
    for (record, taken) in history.iter().zip(taken) {
        assert_eq!(record["key"]["stroke"], taken["stroke_id"]);
        let word = |k: usize| taken["words"][k].as_u64().unwrap();
        assert_eq!(word(50) << 16 | word(51), record["run_id"].as_u64().unwrap());
        let gap_mm = record["figures"]["gap.max"].as_f64().unwrap() * 1000.0;
        assert!((gap_mm - word(55) as f64 * 0.01).abs() < 0.0051, "{gap_mm} mm, register {}", word(55));
    }
}

/// Asserts that the corners of a result are those of the plate in the press, to 3 mm.
#[track_caller]
fn assert_corners(document: &Json, plate: &PlateState) {
    let plate = Plate::new(plate).unwrap();
    for (found, truth) in document["corners_m"].as_array().unwrap().iter().zip(plate.corners()) {
        let off = Vector3::from_fn(|k, _| found[k].as_f64().unwrap()) - truth;
        assert!(off.norm() < 3e-3, "{:.2} mm: {off}", 1e3 * off.norm());
    }
}

#[test]
fn twenty_strokes_with_the_scanner_link_cut_once() {
    let folder = tempfile::tempdir().unwrap();
    let open = |text: String| programme(text, 20, 4);
    // The scan of the blank is cut after 300 columns; the first connection is answered late.
    let faults = ["--fault", "drop-mid-scan=300", "--fault", "connect-late=500"];
    let mut cell = Cell::start(&press(folder.path(), open), &faults);
    let plant = plant(folder.path(), &cell.modbus, &cell.scanner, |text| text);
    let mut host = Host::start(&plant);
    let (stats, plate) = cell.wait_done();
    let log = host.log();
    assert_clean(&stats, &log);
    let taken = stats["taken"].as_array().unwrap();
    assert_eq!(taken.len(), 21, "twenty strokes and the blank\n{log}");
    let history = Host::history(&plant);
    assert_registers(&history, taken);

    let documents: Vec<Json> = history.iter().map(document).collect();
    assert_eq!(plate.strokes, 20);
    assert_corners(documents.last().unwrap(), &plate);

    // The blank is scanned in the region of interest, each later stroke in the window of the plate before.
    let columns: Vec<u64> = documents.iter().map(|d| d["scan"]["columns"].as_u64().unwrap()).collect();
    println!("columns: {columns:?}");
    assert!(columns[1..].iter().all(|stroke| *stroke < columns[0] * 3 / 4), "{columns:?}");

    assert_eq!(host.stop(), Some(0), "{}", host.log());
    let bridge = cell.end();
    println!("bridge: {bridge}");
    assert_eq!((&bridge["scans"], &bridge["cuts"]), (&21.into(), &1.into()), "{bridge}");
    assert!(bridge["resumes"].as_u64().unwrap() >= 1, "{bridge}");
}

#[test]
fn a_late_growing_file_is_assigned_to_its_stroke() {
    let folder = tempfile::tempdir().unwrap();
    let scans = folder.path().join("scans");
    let few = |text: String| programme(text, 5, 1);
    let more = ["--drop", scans.to_str().unwrap(), "--late-file", "3", "--step-deg", "0.08"];
    let mut cell = Cell::run(&press(folder.path(), few), &more);
    let files = format!(
        "plugin = \"faro-file\"\n[scanner.options]\nfolder = {scans:?}\npattern = \"*.e57\"\npoll_ms = 20\n"
    );
    let plant = plant(folder.path(), &cell.modbus, "", |text| {
        let (before, rest) = text.split_once("plugin = \"faro-stream\"").unwrap();
        format!("{before}{files}\n[frame]{}", rest.split_once("[frame]").unwrap().1)
    });
    let mut host = Host::start(&plant);
    let (stats, plate) = cell.wait_done();
    let log = host.log();
    assert_clean(&stats, &log);
    let history = Host::history(&plant);
    assert_registers(&history, stats["taken"].as_array().unwrap());
    assert_eq!((history.len(), plate.strokes), (6, 5), "five strokes and the blank\n{log}");
    let documents: Vec<Json> = history.iter().map(document).collect();
    assert_corners(documents.last().unwrap(), &plate);

    let waited: Vec<f64> = documents.iter().map(|d| d["timings_ms"]["acquire"].as_f64().unwrap()).collect();
    println!("waited for files, ms: {waited:.0?}");
    // The file appears after 750 ms and is complete after as long again.
    let late = history.iter().position(|record| record["key"]["stroke"] == 3).unwrap();
    assert!(waited[late] > 1500.0, "{waited:?}\n{log}");
    assert_eq!(host.stop(), Some(0), "{}", host.log());
}

#[test]
fn a_smaller_scan_window_has_fewer_columns() {
    let mut scans = Vec::new();
    for window in ["plate", "region", "everything"] {
        let folder = tempfile::tempdir().unwrap();
        let few = |text: String| programme(text, 3, 1);
        // A fiftieth of a real scanner's time.
        let mut cell =
            Cell::start(&press(folder.path(), few), &["--time-scale", "0.02", "--margin-deg", "40"]);
        let choose = |text: String| text.replace("window = \"plate\"", &format!("window = \"{window}\""));
        let plant = plant(folder.path(), &cell.modbus, &cell.scanner, choose);
        let mut host = Host::start(&plant);
        let (stats, _) = cell.wait_done();
        assert_clean(&stats, &host.log());
        let history = Host::history(&plant);
        assert_registers(&history, stats["taken"].as_array().unwrap());
        let last = document(history.last().unwrap());
        let scan_ms = last["timings_ms"]["acquire"].as_f64().unwrap();
        let columns = last["scan"]["columns"].as_u64().unwrap();
        println!("window {window}: {columns} columns, scanned in {scan_ms:.0} ms");
        scans.push(columns);
        assert_eq!(host.stop(), Some(0), "{}", host.log());
    }
    assert!(scans[0] < scans[1] * 3 / 4 && scans[1] < scans[2] * 3 / 4, "{scans:?}");
}

#[test]
fn a_plate_outside_its_window_is_scanned_again_once() {
    let folder = tempfile::tempdir().unwrap();
    // From the third scan on the plate is displaced by one metre along its v, half out of its window; from the sixth on
    // by two metres the other way, wholly out of its window.
    let scans = AtomicU32::new(0);
    let moving = move || {
        let mut state = crate::stream::plate();
        let aside = match scans.fetch_add(1, Ordering::Relaxed) {
            0..2 => 0.0,
            2..5 => -1000.0,
            _ => 1000.0,
        };
        state.pose.centre_mm[1] += aside;
        Ok(Some(state))
    };
    let head = RayCastHead { threads: 2, ..RayCastHead::new(Box::new(moving)) };
    let bridge = Bridge::start(BridgeConfig::default(), Box::new(head)).unwrap();
    let mut press = Press::start(folder.path(), "strokes = 5\nwait_ready = true");
    let plant = plant(folder.path(), &press.modbus, &bridge.address().to_string(), |text| text);
    let mut host = Host::start(&plant);
    let stats = press.wait_done();
    assert_clean(&stats, &host.log());
    let log = host.log();
    let again = log.matches("scanning everything once").count();
    assert_eq!((again, bridge.counters().scans), (2, 8), "{log}");
    let history = Host::history(&plant);
    assert_registers(&history, stats["taken"].as_array().unwrap());
    for record in &history {
        assert!(["pass", "fail", "cannot_tell"].contains(&record["verdict"].as_str().unwrap()), "{record:#}");
    }
    assert_eq!(host.stop(), Some(0), "{}", host.log());
}
