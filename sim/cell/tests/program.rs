//! The program as started by other programs.
#![expect(clippy::unwrap_used, reason = "a test that cannot start its program must fail")]

use platen_sim_plate::{Reply, Shape};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, ChildStdout, Command, Stdio};

fn program(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_platen-sim"));
    command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Starts a press; returns it with its addresses.
fn press(arguments: &[&str]) -> (Child, BufReader<ChildStdout>, String, String) {
    let mut child = program(&[&["press", "--with-parent"], arguments].concat()).spawn().unwrap();
    let mut out = BufReader::new(child.stdout.take().unwrap());
    let mut line = String::new();
    out.read_line(&mut line).unwrap();
    let ready: serde_json::Value = serde_json::from_str(&line).unwrap();
    let address = |key: &str| ready[key].as_str().unwrap().to_owned();
    let (modbus, plate) = (address("modbus"), address("plate"));
    (child, out, modbus, plate)
}

fn ask(address: &str, line: &str) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    writeln!(stream, "{line}").unwrap();
    let mut reply = String::new();
    BufReader::new(stream).read_line(&mut reply).unwrap();
    reply
}

/// Returns exit code and log of a program that is expected to end.
fn refused(arguments: &[&str]) -> (Option<i32>, String) {
    let output = program(arguments).output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

#[test]
fn it_says_where_it_serves_and_shows_the_plate() {
    let (mut child, _out, modbus, plate) = press(&["--strokes", "3", "--seed", "9"]);
    assert!(TcpStream::connect(&modbus).is_ok());
    let reply: Reply = serde_json::from_str(&ask(&plate, r#"{"get":"plate"}"#)).unwrap();
    let Reply::Plate(Some(state)) = reply else { panic!("{reply:?}") };
    assert_eq!((state.shape, state.strokes), (Shape::Flat, 0));
    // The end of its standard input ends it.
    drop(child.stdin.take());
    assert!(child.wait().unwrap().success());
}

#[test]
fn it_ends_by_a_request_over_its_second_port() {
    let (mut child, mut out, _, plate) = press(&[]);
    assert!(ask(&plate, r#"{"do":"stop"}"#).contains("true"));
    assert!(child.wait().unwrap().success());
    let mut rest = String::new();
    out.read_to_string(&mut rest).unwrap();
    assert_eq!(rest, "");
}

#[test]
fn wrong_files_are_refused_with_their_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sim.toml");
    let text = path.to_str().unwrap();
    std::fs::write(&path, "press_id = 3\n\nstroke = 4\n").unwrap();
    let (code, log) = refused(&["press", text]);
    assert_eq!(code, Some(2));
    assert!(log.contains("sim.toml:3: unknown field `stroke`"), "{log}");
    std::fs::write(&path, "h_base = 10\n").unwrap();
    assert_eq!(refused(&["press", text]).0, Some(2));
    let (code, log) = refused(&["press", "nowhere.toml"]);
    assert!(code == Some(2) && log.contains("nowhere.toml"), "{log}");
    assert_eq!(refused(&["knead"]).0, Some(2));
}

#[test]
fn a_file_describes_the_press() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sim.toml");
    let plate = "[plate.blank]\nwidth_mm = 1234.0\nheight_mm = 900.0\nthickness_mm = 20.0\n";
    std::fs::write(&path, plate).unwrap();
    let (mut child, _out, _, address) = press(&[path.to_str().unwrap()]);
    assert!(ask(&address, r#"{"get":"plate"}"#).contains("1234"));
    drop(child.stdin.take());
    assert!(child.wait().unwrap().success());
}

#[test]
fn a_scan_lies_beside_its_truth() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let text = "[blank]\nwidth_mm = 3000.0\nheight_mm = 2000.0\nthickness_mm = 30.0\nmarkers_mm = [[1000.0, 500.0]]\n\
                [shape]\nshape = \"cylinder\"\nradius_mm = 8000.0\naxis_deg = 90.0\n";
    std::fs::write(at("plate.toml"), text).unwrap();
    let (plate, out, truth) = (at("plate.toml"), at("scan.e57"), at("truth.json"));
    let scan = ["scanner", &plate, "--out", &out, "--truth", &truth, "--step-deg", "0.4"];
    assert_eq!(refused(&scan), (Some(0), String::new()));
    let truth: serde_json::Value = serde_json::from_slice(&std::fs::read(&truth).unwrap()).unwrap();
    let [x, y, z] = [0, 1, 2].map(|k| truth["markers"][0]["position_m"][k].as_f64().unwrap());
    assert!((x - 5.5).abs() < 0.02 && (y + 0.5).abs() < 0.02 && (z + 3.57).abs() < 0.03, "{x} {y} {z}");
    assert!((truth["grid"]["kappa_u_per_m"][200].as_f64().unwrap() - 0.125).abs() < 1e-9);
    let mut reader = e57::E57Reader::from_file(&out).unwrap();
    let cloud = reader.pointclouds().remove(0);
    assert_eq!(Some(cloud.records), truth["counts"]["cells"].as_u64());
    assert!(reader.pointcloud_simple(&cloud).unwrap().all(|point| point.is_ok()));

    let (code, log) = refused(&["scanner", &plate, "--out", &at("scan.las")]);
    assert!(code == Some(2) && log.contains(".e57"), "{log}");
    std::fs::write(&plate, text.replace("8000.0", "0.0")).unwrap();
    let (code, log) = refused(&scan);
    assert!(code == Some(2) && log.contains("plate.toml: plate.radius_mm"), "{log}");
}
