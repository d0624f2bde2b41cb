//! The example plants of `config/`: each is loaded and run against a press of its kind; only the way to the press
//! is the test's own.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod rig;

use std::time::Duration;

use platen_plant::PlantFile;
use platen_plant::press::{Link, Mode, Press, Role, Serial, Transport};
use platen_sim_press::config::LinkConfig;
use platen_sim_press::{Config, SimPress};
use rig::{Host, Memory, assert_clean, done, quick};
use tokio_modbus::client::{Context, tcp};
use tokio_modbus::prelude::*;

const SCAN: Duration = Duration::from_millis(5);
const STROKES: u32 = 6;

/// The press of an example plant, told to measure.
fn example(name: &str) -> Press {
    let file = platen_tests::repository().join("config").join(name);
    let press = PlantFile::load(&file).unwrap().press.unwrap();
    Press { mode: Mode::Measure, ..press }
}

/// Runs an example on a simulated press that has its number; everything is judged there.
async fn run(press: Press, sim: SimPress) {
    let host = Host::start(press, Memory::new(7), sim.control(), SCAN);
    let tally = done(&sim, &host).await;
    assert_clean(&tally);
    assert_eq!((tally.taken.len(), tally.plates_served), (STROKES as usize, u64::from(STROKES)));
    host.stop().await;
    assert_eq!(sim.h_block().word(2), 0, "safe after the stop");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_press_of_the_north_hall_on_tcp() {
    let mut press = example("plant-north.toml");
    let config = Config { strokes: STROKES, press_id: press.press_id, ..quick() };
    let sim = SimPress::start(config).await.unwrap();
    let address = sim.modbus().unwrap();
    press.link = Link::tcp(address.ip().to_string(), address.port(), press.link.unit);
    run(press, sim).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_press_on_a_serial_line() {
    let mut press = example("plant-rtu.toml");
    let folder = tempfile::tempdir().unwrap();
    let device = folder.path().join("adapter");
    let link = LinkConfig::Pty { device: device.clone() };
    let config =
        Config { strokes: STROKES, press_id: press.press_id, unit: press.link.unit, link, ..quick() };
    let sim = SimPress::start(config).await.unwrap();
    let Transport::Rtu(serial, _) = &mut press.link.transport else { unreachable!("plant-rtu.toml is RTU") };
    *serial = Serial { device, ..serial.clone() };
    run(press, sim).await;
}

/// A port that nobody listens on.
fn free_port() -> u16 {
    std::net::TcpListener::bind(("127.0.0.1", 0)).unwrap().local_addr().unwrap().port()
}

async fn ask(port: u16) -> Context {
    loop {
        if let Ok(context) = tcp::connect_slave(([127, 0, 0, 1], port).into(), Slave(1)).await {
            return context;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

/// The client blocks of a press: carries its block to the host and the host's block back, until one of them is gone.
async fn client_blocks(press: u16, host: u16) {
    let (mut press, mut host) = (ask(press).await, ask(host).await);
    press.read_holding_registers(100, 64).await.unwrap().unwrap();
    loop {
        let Ok(Ok(own)) = press.read_holding_registers(0, 32).await else { return };
        let Ok(Ok(())) = host.write_multiple_registers(0, &own).await else { return };
        let Ok(Ok(words)) = host.read_holding_registers(100, 64).await else { return };
        let Ok(Ok(())) = press.write_multiple_registers(100, &words).await else { return };
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_press_that_asks() {
    let mut press = example("plant-server.toml");
    assert_eq!(press.role, Role::Server);
    let config = Config { strokes: STROKES, press_id: press.press_id, ..quick() };
    let sim = SimPress::start(config).await.unwrap();
    let Transport::Tcp(socket) = &mut press.link.transport else { unreachable!("plant-server.toml is TCP") };
    (socket.host, socket.port) = ("127.0.0.1".into(), free_port());
    socket.peers = vec![[127, 0, 0, 1].into()];
    tokio::spawn(client_blocks(sim.modbus().unwrap().port(), socket.port));
    run(press, sim).await;
}
