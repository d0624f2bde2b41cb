//! The product's press side against presses that others' stacks serve, and what mbpoll reads of the same registers.
//!
//! The peers and what they need are in `tests/peers/README.md`. Where one is not installed its test says so and
//! ends; with `PLATEN_PEERS=all`, as in CI, that is a failure.
#![expect(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod rig;

use std::io::{BufRead, BufReader, Lines};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::Duration;

use rig::{Host, Memory, tcp};
use serde_json::Value;

const STROKES: usize = 20;

fn peers() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("peers")
}

/// Whether `program` can be run with `arguments`; a peer that is missing fails where all are wanted.
fn installed(program: &str, arguments: &[&str]) -> bool {
    let run = Command::new(program).args(arguments).stdout(Stdio::null()).stderr(Stdio::null()).status();
    let there = run.is_ok_and(|status| status.success());
    let wanted = std::env::var("PLATEN_PEERS").is_ok_and(|peers| peers == "all");
    assert!(there || !wanted, "{program} {arguments:?} cannot be run; see tests/peers/README.md");
    if !there {
        println!("skipped: {program} {arguments:?} cannot be run; see tests/peers/README.md");
    }
    there
}

/// A press in a process of its own.
struct Peer {
    child: Child,
    lines: Lines<BufReader<ChildStdout>>,
    port: u16,
}

impl Peer {
    fn start(command: &mut Command) -> Self {
        let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let first: Value = serde_json::from_str(&lines.next().unwrap().unwrap()).unwrap();
        let port = first["port"].as_u64().unwrap().try_into().unwrap();
        Self { child, lines, port }
    }

    /// Its summary, once all strokes are made or it has given up; it must be content.
    fn summary(mut self) -> Value {
        let summary = self.lines.next().unwrap().unwrap();
        let summary: Value = serde_json::from_str(&summary).unwrap();
        assert!(self.child.wait().unwrap().success(), "{summary}");
        summary
    }
}

/// Serves `peer` until it has all its strokes; the scanner looks at a plate that is never bent.
async fn serve(peer: Peer) -> Value {
    let cell = platen_sim_press::Config { automatic: false, ..rig::quick() };
    let cell = platen_sim_press::SimPress::start(cell).await.unwrap();
    let address = ([127, 0, 0, 1], peer.port).into();
    let host = Host::start(tcp(address), Memory::new(7), cell.control(), Duration::from_millis(10));
    let Ok(summary) = tokio::task::spawn_blocking(|| peer.summary()).await else {
        panic!("{:?}, alarms {:?}", host.status.borrow(), host.heard.alarms.lock().unwrap());
    };
    let scans = host.heard.scans.lock().unwrap().len();
    assert_eq!(scans, STROKES + 1, "the blank and each stroke once");
    host.stop().await;
    let results = summary["results"].as_array().unwrap();
    assert_eq!(results.len(), STROKES + 1);
    for result in results {
        assert_eq!(result["words"][55], 1000, "gap of {}", result["stroke"]);
        assert_eq!(result["words"][4], result["stroke"]);
    }
    summary
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_press_on_pymodbus() {
    if installed("python3", &["-c", "import pymodbus.simulator"]) {
        let mut command = Command::new("python3");
        command.arg(peers().join("pymodbus_press.py")).args(["--strokes", &STROKES.to_string()]);
        serve(Peer::start(&mut command)).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_press_on_libmodbus() {
    if !installed("sh", &["-c", "gcc --version && pkg-config --exists libmodbus"]) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let build = format!(
        "gcc -std=c11 -Wall -Wextra -Werror -O2 libmodbus_press.c -o {}/press $(pkg-config --cflags --libs libmodbus)",
        folder.path().display()
    );
    assert!(Command::new("sh").current_dir(peers()).args(["-c", &build]).status().unwrap().success());
    let mut command = Command::new(folder.path().join("press"));
    serve(Peer::start(command.args(["-n", &STROKES.to_string()]))).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn mbpoll_reads_the_words_of_the_result() {
    if !installed("sh", &["-c", "command -v mbpoll"]) {
        return;
    }
    let (press, host, tally) =
        rig::run(platen_sim_press::Config { strokes: 3, ..rig::quick() }, Duration::from_millis(5)).await;
    let peer = press.modbus().unwrap().to_string();
    let read = Command::new(peers().join("mbpoll_words.sh")).args([&peer, "100", "64"]).output().unwrap();
    assert!(read.status.success(), "{read:?}");
    let words: Vec<u16> = serde_json::from_slice(&read.stdout).unwrap();
    let last = &tally.taken.last().unwrap().words;
    // Heartbeat, status and host state go on after the result was taken; the warning and its check sum may.
    let stable = |words: &[u16]| [&words[3..7], &words[8..52], &words[53..54], &words[55..64]].concat();
    assert_eq!(stable(&words), stable(last));
    host.stop().await;
}
