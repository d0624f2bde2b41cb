//! Press and scanner together, with a minimal Modbus host written by hand.
#![expect(clippy::unwrap_used, reason = "a test that cannot start its program must fail")]

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Modbus TCP client, unit 1.
struct Modbus(TcpStream);

impl Modbus {
    fn call(&mut self, pdu: &[u8]) -> Vec<u8> {
        let length = (pdu.len() + 1) as u8;
        self.0.write_all(&[&[0, 1, 0, 0, 0, length, 1], pdu].concat()).unwrap();
        let mut head = [0; 7];
        self.0.read_exact(&mut head).unwrap();
        let mut answer = vec![0; usize::from(u16::from_be_bytes([head[4], head[5]])) - 1];
        self.0.read_exact(&mut answer).unwrap();
        assert_eq!(answer[0], pdu[0], "exception {answer:?}");
        answer
    }

    /// Reads the 32 words of the P block.
    fn read(&mut self) -> Vec<u16> {
        let answer = self.call(&[3, 0, 0, 0, 32]);
        answer[2..].chunks(2).map(|b| u16::from_be_bytes([b[0], b[1]])).collect()
    }

    /// Writes words of the H block from its start.
    fn write(&mut self, words: &[u16]) {
        let n = words.len() as u8;
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_be_bytes()).collect();
        self.call(&[&[16, 0, 100, 0, n, 2 * n][..], &bytes].concat());
    }
}

/// Returns the number of cells of the scan in a file.
fn cells(path: &Path) -> u64 {
    let reader = e57::E57Reader::from_file(path).unwrap();
    reader.pointclouds()[0].records
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

#[test]
fn each_accepted_stroke_drops_one_whole_scan() {
    let folder = tempfile::tempdir().unwrap();
    let (config, drop) = (folder.path().join("sim.toml"), folder.path().join("scans"));
    std::fs::write(
        &config,
        "strokes = 3\nbaseline = false\nwait_ready = false\n[timings]\ndown_ms = 20\nup_ms = 20\n",
    )
    .unwrap();
    let mut child = Command::new(env!("CARGO_BIN_EXE_platen-sim"))
        .args(["cell", config.to_str().unwrap(), "--with-parent", "--step-deg", "0.8", "--drop"])
        .arg(&drop)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut ready = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut ready).unwrap();
    let ready: serde_json::Value = serde_json::from_str(&ready).unwrap();
    let mut press = Modbus(TcpStream::connect(ready["modbus"].as_str().unwrap()).unwrap());

    const BUSY: u16 = 2;
    let deadline = Instant::now() + Duration::from_secs(30);
    let (mut heartbeat, mut accepted, mut scans) = (0, 0, 0);
    while scans < 2 {
        assert!(Instant::now() < deadline, "{scans} scans in 30 s");
        heartbeat += 1;
        let p = press.read();
        if p[2] & 2 != 0 && p[3] != accepted {
            accepted = p[3];
        }
        // This host only accepts strokes: it publishes no result, and the press continues after its limit.
        press.write(&[1, heartbeat, if accepted == 0 { 0 } else { BUSY }, accepted, 0, p[4]]);
        let found = files(&drop);
        let whole = found.iter().filter(|path| path.extension().is_some_and(|end| end == "e57")).count();
        if whole > scans {
            scans = whole;
            let newest = &found[scans - 1];
            assert!(newest.to_str().unwrap().ends_with(&format!("{accepted:05}-0.e57")), "{newest:?}");
            assert!(cells(newest) > 1000);
            // The next stroke, whatever the state of the press.
            let mut line = TcpStream::connect(ready["plate"].as_str().unwrap()).unwrap();
            line.write_all(b"{\"do\":\"stroke\"}\n").unwrap();
            BufReader::new(line).read_line(&mut String::new()).unwrap();
        }
    }
    drop_child(child);
    assert_eq!(files(&drop).len(), 2);
}

fn drop_child(mut child: std::process::Child) {
    drop(child.stdin.take());
    assert!(child.wait().unwrap().success());
}
