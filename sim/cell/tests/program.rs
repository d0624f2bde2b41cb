//! The program as others start it.
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

/// A running press, and where it serves.
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

/// Exit code and log of a program that is expected to end.
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
    // Without its parent it ends by itself.
    drop(child.stdin.take());
    assert!(child.wait().unwrap().success());
}

#[test]
fn it_ends_when_told_over_its_second_port() {
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
