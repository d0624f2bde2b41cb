//! Tests of every fault of the line, one by one and mixed, on TCP, on RTU through TCP and on a serial line.
//!
//! After each run the press has all its results, each under its own stroke, each scanned once.

use std::time::Duration;

use crate::rig::{Host, LIMIT, Memory, assert_clean, beside_each_other, done, quick, tcp};
use platen_model::Code;
use platen_plant::press::{Link, Press, Quiet, Serial, Transport};
use platen_press::LinkState;
use platen_sim_press::config::LinkConfig;
use platen_sim_press::faults::LineFaults;
use platen_sim_press::{Command, Config, Counters, SimPress};

const SCAN: Duration = Duration::from_millis(5);

/// On a serial line late answers reach the next process that opens it: the host must be silent for longer than that.
const LATE_MS: [u64; 2] = [120, 300];

type Set = fn(&mut LineFaults);

/// Enough to affect most strokes of a run, and few enough that lines recover.
const FAULTS: [(&str, Set); 14] = [
    ("late", |it| it.late = 0.02),
    ("reset before", |it| it.reset = 0.03),
    ("reset after", |it| it.reset_after = 0.03),
    ("no answer", |it| it.no_answer = 0.02),
    ("wrong transaction", |it| it.wrong_transaction = 0.03),
    ("wrong unit", |it| it.wrong_unit = 0.03),
    ("wrong function", |it| it.wrong_function = 0.03),
    ("short", |it| it.short = 0.03),
    ("long", |it| it.long = 0.03),
    ("busy", |it| it.exception = 0.05),
    ("noise", |it| it.noise = 0.03),
    ("bit flip", |it| it.bit_flip = 0.03),
    ("half", |it| it.half = 0.02),
    ("twice", |it| it.twice = 0.03),
];

fn assert_all(what: &str, counters: &Counters, strokes: usize) {
    println!(
        "{what}: {:?}, {} connections, {} writes",
        counters.line_faults, counters.connections, counters.writes
    );
    assert_clean(counters);
    assert_eq!((counters.taken.len(), counters.missed_reported), (strokes, 0), "{what}");
    assert_eq!(counters.plates_served, strokes as u64, "{what}: scans");
}

fn with(fault: (&'static str, Set), others: LineFaults) -> (&'static str, LineFaults) {
    let mut line_faults = others;
    fault.1(&mut line_faults);
    (fault.0, line_faults)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn each_fault_on_tcp() {
    beside_each_other(FAULTS.map(|fault| async move {
        let (name, line_faults) = with(fault, LineFaults::default());
        let (_press, host, counters) =
            crate::rig::run(Config { strokes: 8, line_faults, ..quick() }, SCAN).await;
        assert!(!counters.line_faults.is_empty(), "{name}: the seed hits nothing");
        assert_all(name, &counters, 8);
        host.stop().await;
    }))
    .await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn each_fault_on_rtu_through_tcp() {
    beside_each_other(FAULTS.map(|fault| async move {
        let (name, line_faults) = with(fault, LineFaults::default());
        let link = LinkConfig::RtuOverTcp { port: 0 };
        let press = SimPress::start(Config { strokes: 4, link, line_faults, ..quick() }).await.unwrap();
        let address = press.modbus().unwrap();
        let plant =
            Press::pph1("Press 3", 3, Link::rtu_over_tcp(address.ip().to_string(), address.port(), 1));
        let host = Host::start(plant, Memory::new(7), press.control(), SCAN);
        let counters = done(&press, &host).await;
        assert!(!counters.line_faults.is_empty(), "{name}: the seed hits nothing");
        assert_all(name, &counters, 4);
        host.stop().await;
    }))
    .await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn late_answers_and_resets_on_many_strokes() {
    let line_faults = LineFaults { late: 0.01, reset: 0.005, reset_after: 0.005, ..LineFaults::default() };
    let (_press, host, counters) =
        crate::rig::run(Config { strokes: 15, line_faults, ..quick() }, SCAN).await;
    assert_all("mixed", &counters, 15);
    assert!(counters.connections > 2, "{} connections", counters.connections);
    host.stop().await;
}

/// Starts a press on a pseudo terminal; returns also the product's description of it.
async fn serial(config: Config) -> (SimPress, Press, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let device = folder.path().join("adapter");
    let config = Config { link: LinkConfig::Pty { device: device.clone() }, ..config };
    let press = SimPress::start(config).await.unwrap();
    let mut plant = Press::pph1("Press 3", 3, Link::rtu(Serial::new(device, 115_200), 1));
    if let Transport::Rtu(_, quiet) = &mut plant.link.transport {
        *quiet = Quiet(Duration::from_millis(LATE_MS[1] + 100));
    }
    (press, plant, folder)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn each_fault_on_a_serial_line() {
    let faults = FAULTS.into_iter().filter(|(name, _)| *name != "wrong transaction");
    beside_each_other(faults.map(|fault| async move {
        let (name, line_faults) = with(fault, LineFaults { late_ms: LATE_MS, ..LineFaults::default() });
        let (press, plant, _folder) = serial(Config { strokes: 4, line_faults, ..quick() }).await;
        let host = Host::start(plant, Memory::new(7), press.control(), SCAN);
        let counters = done(&press, &host).await;
        assert!(!counters.line_faults.is_empty(), "{name}: the seed hits nothing");
        assert_all(name, &counters, 4);
        host.stop().await;
    }))
    .await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn fifty_strokes_on_a_serial_line_with_late_answers_and_pulled_adapters() {
    let line_faults = LineFaults { late: 0.01, late_ms: LATE_MS, reset: 0.005, ..LineFaults::default() };
    let (press, mut plant, _folder) = serial(Config { strokes: 50, line_faults, ..quick() }).await;
    plant.link.poll = Duration::from_millis(10);
    let host = Host::start(plant, Memory::new(7), press.control(), SCAN);
    let counters = done(&press, &host).await;
    assert_all("serial line", &counters, 50);
    host.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_adapter_that_hears_itself() {
    let line_faults = LineFaults { echo: true, ..LineFaults::default() };
    let (press, mut plant, _folder) = serial(Config { strokes: 5, line_faults, ..quick() }).await;
    if let Transport::Rtu(serial, _) = &mut plant.link.transport {
        serial.echo = true;
    }
    let host = Host::start(plant, Memory::new(7), press.control(), SCAN);
    let counters = done(&press, &host).await;
    assert_clean(&counters);
    assert_eq!((counters.taken.len(), counters.plates_served), (5, 5));
    host.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_adapter_that_is_pulled_is_found_under_its_name() {
    let (press, plant, _folder) = serial(Config { automatic: false, ..quick() }).await;
    let mut host = Host::start(plant, Memory::new(7), press.control(), SCAN);
    for n in 1..=3 {
        host.until("ready", |status| status.host.ready).await;
        press.command(Command::Stroke).unwrap();
        press.until("the scan", LIMIT, |counters| counters.plates_served == n).await.unwrap();
        press.command(Command::PullMs(500)).unwrap();
        press.until("the result", LIMIT, |counters| counters.taken.len() as u64 == n).await.unwrap();
    }
    let counters = press.counters();
    assert_all("pulled", &counters, 3);
    assert!(counters.connections > 3, "{} connections", counters.connections);
    assert!(host.heard.alarmed(Code::LinkBroken));
    host.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_lasting_exception_is_a_fault_until_reset() {
    let lasting = [
        (1, Code::IllegalFunction),
        (2, Code::IllegalAddress),
        (3, Code::IllegalAddress),
        (4, Code::DeviceFailure),
        (8, Code::DeviceFailure),
        (9, Code::DeviceFailure),
    ];
    beside_each_other(lasting.map(|(exception_code, code)| async move {
        let press = SimPress::start(Config { strokes: 4, automatic: false, ..quick() }).await.unwrap();
        let mut host = Host::start(tcp(press.modbus().unwrap()), Memory::new(7), press.control(), SCAN);
        host.until("ready", |status| status.host.ready).await;
        let faults = LineFaults { exception: 1.0, exception_code, ..LineFaults::default() };
        press.command(Command::LineFaults(faults)).unwrap();
        host.until("fault", |status| status.state.link == LinkState::Fault(code)).await;
        press.command(Command::LineFaults(LineFaults::default())).unwrap();
        host.reset();
        host.until("ready again", |status| status.host.ready).await;
        press.command(Command::Automatic(true)).unwrap();
        let counters = done(&press, &host).await;
        assert_all(&code.to_string(), &counters, 4);
        host.stop().await;
    }))
    .await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn exceptions_that_pass_cost_no_stroke() {
    beside_each_other([4, 5, 6, 7, 8, 9, 10, 11].map(|exception_code| async move {
        let line_faults = LineFaults { exception: 0.05, exception_code, ..LineFaults::default() };
        let press = SimPress::start(Config { strokes: 6, line_faults, ..quick() }).await.unwrap();
        let mut plant = tcp(press.modbus().unwrap());
        // An answer delayed by a busy machine beyond the usual 300 ms would also end the connection.
        plant.link.response_timeout = LIMIT;
        let host = Host::start(plant, Memory::new(7), press.control(), SCAN);
        let counters = done(&press, &host).await;
        assert!(!counters.line_faults.is_empty(), "{exception_code}: the seed hits nothing");
        assert_all(&format!("exception {exception_code:02X}"), &counters, 6);
        assert_eq!(counters.connections, 1, "{exception_code:02X}: an exception keeps the connection");
        host.stop().await;
    }))
    .await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_press_that_comes_back_is_found_again() {
    let press = SimPress::start(Config { automatic: false, ..quick() }).await.unwrap();
    let address = press.modbus().unwrap();
    let mut host = Host::start(tcp(address), Memory::new(7), press.control(), SCAN);
    host.until("ready", |status| status.host.ready).await;
    drop(press);
    host.until("loss", |status| status.state.link == LinkState::Offline).await;
    let link = LinkConfig::Tcp { port: address.port() };
    let back = SimPress::start(Config { automatic: false, link, ..quick() }).await.unwrap();
    let counters = back.until("a read", LIMIT, |counters| counters.reads > 0).await.unwrap();
    println!("found again after {} ms", counters.now_ms);
    host.until("ready again", |status| status.host.ready).await;
    assert_eq!(back.counters().writes_before_sync, 0);
    host.stop().await;
}
