//! Peer tests of the product's press side against presses on other Modbus stacks, and readings of the same registers by
//! mbpoll.
//!
//! The peers and their requirements are described in `tests/peers/README.md`. If one is not installed, its test prints
//! so and ends; with `PLATEN_PEERS=all`, as in CI, that is a failure.

use std::io::{BufRead, BufReader, Lines};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::Duration;

use crate::rig::{Host, Memory, assert_clean, done, quick, tcp};
use platen_plant::press::{Link, Parity, Press, Serial};
use platen_sim_press::config::LinkConfig;
use platen_sim_press::{Command as Order, Config, SimPress};
use serde_json::Value;

const STROKES: usize = 20;

fn peers() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("peers")
}

/// Returns whether `program` can be run with `arguments`; a missing peer is a failure if all are required.
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

/// Press in a process of its own.
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
        // A press on a serial line has no port.
        let port = first["port"].as_u64().unwrap_or(0).try_into().unwrap();
        Self { child, lines, port }
    }

    /// Returns its summary, once all strokes are made or it has given up; the summary must report success.
    fn summary(mut self) -> Value {
        let summary = self.lines.next().unwrap().unwrap();
        let summary: Value = serde_json::from_str(&summary).unwrap();
        assert!(self.child.wait().unwrap().success(), "{summary}");
        summary
    }
}

/// Line or gateway of socat, ended when dropped.
struct Socat {
    child: Child,
    /// Links to its terminals.
    links: Vec<PathBuf>,
}

impl Socat {
    /// Creates two pseudo terminals with their lines joined, linked as `a` and `b` in `folder`.
    fn line(folder: &Path) -> Self {
        let links = ["a", "b"].map(|name| folder.join(name));
        let ends = links.each_ref().map(|link| format!("pty,raw,echo=0,link={}", link.display()));
        Self::start(&ends, "starting data transfer", links.into()).0
    }

    /// Creates a port that passes its data to a serial device; one connection at a time opens it.
    fn gateway(device: &Path) -> (Self, u16) {
        let device = format!("{},raw,echo=0", device.display());
        let listen = "TCP-LISTEN:0,bind=127.0.0.1,reuseaddr,fork,nodelay".to_owned();
        let (socat, line) = Self::start(&[listen, device], "listening on", Vec::new());
        (socat, line.rsplit(':').next().unwrap().trim().parse().unwrap())
    }

    /// Waits for a line of its log.
    fn start(ends: &[String; 2], wanted: &str, links: Vec<PathBuf>) -> (Self, String) {
        let mut child =
            Command::new("socat").args(["-d", "-d"]).args(ends).stderr(Stdio::piped()).spawn().unwrap();
        let mut log = BufReader::new(child.stderr.take().unwrap()).lines();
        let line = log.find_map(|line| line.ok().filter(|line| line.contains(wanted))).unwrap();
        // Its log must not fill the pipe.
        std::thread::spawn(move || log.for_each(drop));
        (Self { child, links }, line)
    }
}

impl Drop for Socat {
    /// Removes the links first, like those of an unplugged adapter: another test may get a terminal with the same
    /// number a moment later.
    fn drop(&mut self) {
        for link in &self.links {
            let _ = std::fs::remove_file(link);
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Serves `peer` until it has all its strokes; the scanner measures a plate that is never bent.
async fn serve(peer: Peer) -> Value {
    let address = ([127, 0, 0, 1], peer.port).into();
    serve_on(peer, tcp(address)).await
}

async fn serve_on(peer: Peer, plant: Press) -> Value {
    let cell = platen_sim_press::Config { automatic: false, ..crate::rig::quick() };
    let cell = platen_sim_press::SimPress::start(cell).await.unwrap();
    let host = Host::start(plant, Memory::new(7), cell.control(), Duration::from_millis(10));
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
    let (press, host, counters) = crate::rig::run(
        platen_sim_press::Config { strokes: 3, ..crate::rig::quick() },
        Duration::from_millis(5),
    )
    .await;
    let peer = press.modbus().unwrap().to_string();
    let read = Command::new(peers().join("mbpoll_words.sh")).args([&peer, "100", "64"]).output().unwrap();
    assert!(read.status.success(), "{read:?}");
    let words: Vec<u16> = serde_json::from_slice(&read.stdout).unwrap();
    let last = &counters.taken.last().unwrap().words;
    // Heartbeat, status and host state continue after the result was accepted; the warning and its checksum may also
    // change.
    let stable = |words: &[u16]| [&words[3..7], &words[8..52], &words[53..54], &words[55..64]].concat();
    assert_eq!(stable(&words), stable(last));
    host.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_press_on_pymodbus_on_a_serial_line() {
    let socat = installed("socat", &["-V"]);
    if !socat || !installed("python3", &["-c", "import pymodbus.simulator, serial"]) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let _line = Socat::line(folder.path());
    let mut command = Command::new("python3");
    command.arg(peers().join("pymodbus_press.py")).args(["--strokes", &STROKES.to_string()]);
    command.arg("--serial").arg(folder.path().join("a")).args(["--baud", "115200", "--parity", "N"]);
    let serial = Serial { parity: Parity::None, ..Serial::new(folder.path().join("b"), 115_200) };
    let plant = Press::pph1("Press 3", 3, Link::rtu(serial, 1));
    serve_on(Peer::start(&mut command), plant).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_serial_line_that_is_pulled_and_put_back() {
    if !installed("socat", &["-V"]) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let line = Socat::line(folder.path());
    let link = LinkConfig::Rtu { device: folder.path().join("a"), baud: 115_200 };
    let press = SimPress::start(Config { strokes: 10, link, automatic: false, ..quick() }).await.unwrap();
    let plant = Press::pph1("Press 3", 3, Link::rtu(Serial::new(folder.path().join("b"), 115_200), 1));
    let mut host = Host::start(plant, Memory::new(7), press.control(), Duration::from_millis(10));
    host.until("ready", |status| status.host.ready).await;
    drop(line);
    host.until("loss", |status| status.state.link == platen_press::LinkState::Offline).await;
    let _line = Socat::line(folder.path());
    press.command(Order::Automatic(true)).unwrap();
    let counters = done(&press, &host).await;
    assert_clean(&counters);
    assert_eq!((counters.taken.len(), counters.plates_served), (10, 10));
    host.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_serial_line_behind_a_gateway() {
    if !installed("socat", &["-V"]) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let device = folder.path().join("adapter");
    let link = LinkConfig::Pty { device: device.clone() };
    let press = SimPress::start(Config { strokes: 20, link, ..quick() }).await.unwrap();
    let (_gateway, port) = Socat::gateway(&device);
    let plant = Press::pph1("Press 3", 3, Link::rtu_over_tcp("127.0.0.1", port, 1));
    let host = Host::start(plant, Memory::new(7), press.control(), Duration::from_millis(10));
    let counters = done(&press, &host).await;
    assert_clean(&counters);
    assert_eq!((counters.taken.len(), counters.plates_served), (20, 20));
    host.stop().await;
}
