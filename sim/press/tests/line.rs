//! Tests of the links of the press, and of faults on them.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod host;

use std::time::Duration;

use host::{Host, counted};
use platen_sim_press::config::{LinkConfig, Timings};
use platen_sim_press::faults::LineFaults;
use platen_sim_press::{Command, Config, SimPress};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::time::timeout;
use tokio_modbus::prelude::*;
use tokio_serial::{SerialPortBuilderExt, SerialStream};

const LIMIT: Duration = Duration::from_secs(30);
/// Request: transaction 7, unit 1, one register from 7, the number of the press.
const READ: [u8; 12] = [0, 7, 0, 0, 0, 6, 1, 3, 0, 7, 0, 1];
/// Answer to [`READ`]: press 3.
const ANSWER: [u8; 11] = [0, 7, 0, 0, 0, 5, 1, 3, 2, 0, 3];

fn quick() -> Config {
    let timings =
        Timings { cycle_ms: 2, down_ms: 4, up_ms: 4, between_ms: 0, heartbeat_ms: 50, ..Timings::default() };
    Config { strokes: 6, timings, ..Config::default() }
}

async fn idle(faults: LineFaults) -> (SimPress, TcpStream) {
    let press = SimPress::start(Config { automatic: false, line_faults: faults, ..quick() }).await.unwrap();
    press.until("a cycle", LIMIT, |counters| counters.now_ms > 0).await.unwrap();
    let stream = TcpStream::connect(press.modbus().unwrap()).await.unwrap();
    (press, stream)
}

async fn read_exact<const N: usize>(stream: &mut TcpStream) -> [u8; N] {
    let mut bytes = [0; N];
    timeout(LIMIT, stream.read_exact(&mut bytes)).await.unwrap().unwrap();
    bytes
}

#[tokio::test]
async fn a_clean_line_answers() {
    let (_press, mut stream) = idle(LineFaults::default()).await;
    stream.write_all(&READ).await.unwrap();
    assert_eq!(read_exact(&mut stream).await, ANSWER);
}

#[tokio::test]
async fn a_late_answer_is_overtaken() {
    let (press, mut stream) =
        idle(LineFaults { late: 1.0, late_ms: [200, 200], ..LineFaults::default() }).await;
    stream.write_all(&READ).await.unwrap();
    press.until("the late one", LIMIT, |counters| counters.line_faults.contains_key("Late")).await.unwrap();
    press.command(Command::LineFaults(LineFaults::default())).unwrap();
    let mut second = READ;
    second[1] = 8;
    stream.write_all(&second).await.unwrap();
    let order = [read_exact::<11>(&mut stream).await[1], read_exact::<11>(&mut stream).await[1]];
    assert_eq!(order, [8, 7]);
}

#[tokio::test]
async fn a_reset_ends_the_connection_before_or_after_the_service() {
    let write = [0, 1, 0, 0, 0, 6, 1, 6, 0, 100, 0, 1];
    for (faults, writes) in [
        (LineFaults { reset: 1.0, ..LineFaults::default() }, 0),
        (LineFaults { reset_after: 1.0, ..LineFaults::default() }, 1),
    ] {
        let (press, mut stream) = idle(faults).await;
        stream.write_all(&write).await.unwrap();
        let ended = timeout(LIMIT, stream.read(&mut [0; 16])).await.unwrap();
        assert!(matches!(ended, Ok(0) | Err(_)), "{ended:?}");
        assert_eq!(press.counters().writes, writes);
    }
}

#[tokio::test]
async fn an_exception_is_not_served() {
    let (press, mut stream) = idle(LineFaults { exception: 1.0, ..LineFaults::default() }).await;
    stream.write_all(&[0, 1, 0, 0, 0, 6, 1, 6, 0, 100, 0, 1]).await.unwrap();
    assert_eq!(read_exact(&mut stream).await, [0, 1, 0, 0, 0, 3, 1, 0x86, 6]);
    assert_eq!(press.counters().writes, 0);
}

#[tokio::test]
async fn a_frozen_press_answers_when_it_thaws() {
    let (press, mut stream) = idle(LineFaults::default()).await;
    press.command(Command::FreezeMs(150)).unwrap();
    let frozen = std::time::Instant::now();
    stream.write_all(&READ).await.unwrap();
    assert_eq!(read_exact(&mut stream).await, ANSWER);
    assert!(frozen.elapsed() >= Duration::from_millis(100), "{:?}", frozen.elapsed());
}

#[tokio::test]
async fn rtu_through_tcp_carries_the_handshake() {
    let config = Config { link: LinkConfig::RtuOverTcp { port: 0 }, ..quick() };
    let press = SimPress::start(config).await.unwrap();
    let stream = TcpStream::connect(press.modbus().unwrap()).await.unwrap();
    stream.set_nodelay(true).unwrap();
    let host = tokio::spawn(Host::on(client::rtu::attach_slave(stream, Slave(1))).run(counted));
    let counters = press.until("done", LIMIT, |counters| counters.done).await.unwrap();
    assert_eq!((counters.taken.len(), counters.wrong_values, counters.writes_outside), (7, 0, 0));
    host.abort();
}

/// Starts a press on a pseudo terminal; returns it with the host's end.
async fn serial(config: Config) -> (SimPress, SerialStream, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let device = folder.path().join("adapter");
    let config = Config { link: LinkConfig::Pty { device: device.clone() }, ..config };
    let press = SimPress::start(config).await.unwrap();
    press.until("a cycle", LIMIT, |counters| counters.now_ms > 0).await.unwrap();
    let line = tokio_serial::new(device.to_string_lossy(), 115_200).open_native_async().unwrap();
    (press, line, folder)
}

#[tokio::test]
async fn a_serial_line_carries_the_handshake() {
    let (press, line, _folder) = serial(quick()).await;
    let host = tokio::spawn(Host::on(client::rtu::attach_slave(line, Slave(1))).run(counted));
    let counters = press.until("done", LIMIT, |counters| counters.done).await.unwrap();
    assert_eq!((counters.taken.len(), counters.wrong_values, counters.writes_outside), (7, 0, 0));
    host.abort();
}

#[tokio::test]
async fn a_pulled_adapter_comes_back_behind_its_link() {
    let (press, mut line, folder) = serial(Config { automatic: false, ..quick() }).await;
    let device = folder.path().join("adapter");
    assert_eq!(ask(&mut line).await, [1, 3, 2, 0, 3]);
    press.command(Command::PullMs(0)).unwrap();
    let ended = timeout(LIMIT, line.read(&mut [0; 16])).await.unwrap();
    assert!(matches!(ended, Ok(0) | Err(_)), "{ended:?}");
    // The terminal was closed after its link was removed: the link now leads to the next terminal, whatever its number.
    let back = async {
        while !device.exists() {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    };
    timeout(LIMIT, back).await.unwrap();
    let mut line = tokio_serial::new(device.to_string_lossy(), 115_200).open_native_async().unwrap();
    assert_eq!(ask(&mut line).await, [1, 3, 2, 0, 3]);
}

/// Returns the answer to a request for the number of the press, without its checksum.
async fn ask(line: &mut SerialStream) -> [u8; 5] {
    let mut request = vec![1, 3, 0, 7, 0, 1];
    request.extend(platen_sim_press::frame::crc16(&request).to_le_bytes());
    line.write_all(&request).await.unwrap();
    let mut answer = [0; 7];
    timeout(LIMIT, line.read_exact(&mut answer)).await.unwrap().unwrap();
    answer[..5].try_into().unwrap()
}

#[tokio::test]
async fn a_serial_press_is_silent_for_other_units_and_broken_frames() {
    let line_faults = LineFaults { echo: true, ..LineFaults::default() };
    let (press, mut line, _folder) = serial(Config { automatic: false, line_faults, ..quick() }).await;
    let framed = |unit: u8| {
        let mut bytes = vec![unit, 3, 0, 7, 0, 1];
        bytes.extend(platen_sim_press::frame::crc16(&bytes).to_le_bytes());
        bytes
    };
    let mut broken = framed(1);
    broken[7] ^= 1;
    for silent in [framed(2), broken] {
        line.write_all(&silent).await.unwrap();
    }
    let own = framed(1);
    line.write_all(&own).await.unwrap();
    let mut bytes = [0; 15];
    timeout(LIMIT, line.read_exact(&mut bytes)).await.unwrap().unwrap();
    assert_eq!(bytes[..8], own, "the echo");
    assert_eq!(bytes[8..13], [1, 3, 2, 0, 3]);
    assert_eq!(press.counters().reads, 1);
}
