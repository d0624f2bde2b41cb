//! Tests of the example plants of `config/`: each is loaded and run against a press of its kind; only the connection to
//! the press belongs to the test.

use std::future::{Ready, ready};
use std::net::SocketAddr;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use crate::rig::{Host, Memory, assert_clean, done, quick};
use platen_plant::PlantFile;
use platen_plant::press::{Link, Mode, Press, Role, Serial, Transport};
use platen_press::PressLink;
use platen_sim_press::config::LinkConfig;
use platen_sim_press::{Config, SimPress};
use tokio::net::TcpListener;
use tokio_modbus::client::tcp;
use tokio_modbus::prelude::*;
use tokio_modbus::server::tcp::{Server, accept_tcp_connection};

const SCAN: Duration = Duration::from_millis(5);
const STROKES: u32 = 6;

/// Returns the press of an example plant, in mode `measure`.
fn example(name: &str) -> Press {
    let file = platen_tests::repository().join("config").join(name);
    let press = PlantFile::load(&file).unwrap().press.unwrap();
    Press { mode: Mode::Measure, ..press }
}

/// Runs an example on a simulated press that has its number; all checks are made there.
async fn run(press: Press, sim: SimPress) {
    let host = Host::start(press, Memory::new(7), sim.control(), SCAN);
    judge(host, sim).await;
}

async fn judge(host: Host, sim: SimPress) {
    let counters = done(&sim, &host).await;
    assert_clean(&counters);
    assert_eq!((counters.taken.len(), counters.plates_served), (STROKES as usize, u64::from(STROKES)));
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

/// Runs the client blocks of a press: they carry its block to the host and the host's block back, until one of the two
/// has ended.
async fn client_blocks(press: SocketAddr, host: SocketAddr) {
    let ask = async |at| tcp::connect_slave(at, Slave(1)).await.unwrap();
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
    (socket.host, socket.port) = ("127.0.0.1".into(), 0);
    socket.peers = vec![[127, 0, 0, 1].into()];
    let mut link = PressLink::new(&press);
    let PressLink::Served(served) = &mut link else { unreachable!("it is the press that asks") };
    tokio::spawn(client_blocks(sim.modbus().unwrap(), served.listen().await.unwrap()));
    let host = Host::on(press, link, Memory::new(7), sim.control(), SCAN);
    judge(host, sim).await;
}

/// Controller with bits only: the program of `platen press map config/plant-bits.toml`, cycle by cycle.
#[derive(Debug, Default)]
struct BitPress {
    /// Register 40201 of the press.
    p: u16,
    /// Registers from 40301 on, of the host.
    h: [u16; 3],
    to_do: u32,
    waiting: bool,
    accepted: bool,
    /// Figures of the accepted results, with pass and fail.
    results: Vec<(u16, i16, bool, bool)>,
    writes_outside: usize,
}

impl BitPress {
    fn cycle(&mut self) {
        let [ready, busy, valid, pass, fail] = [0, 1, 2, 3, 4].map(|bit| self.h[0] >> bit & 1 == 1);
        let ack = self.p & 2 != 0;
        let stroke_done = self.to_do > 0 && ready && !ack;
        if stroke_done && !self.waiting {
            self.waiting = true;
            self.to_do -= 1;
        }
        self.accepted = self.waiting && (self.accepted || busy);
        let valid_now = self.accepted && valid && !busy;
        if self.waiting && valid_now {
            self.results.push((self.h[1], self.h[2].cast_signed(), pass, fail));
            self.waiting = false;
            self.p |= 2;
        }
        if self.p & 2 != 0 && !valid {
            self.p &= !2;
        }
        self.p = self.p & !1 | u16::from(self.waiting);
        self.accepted &= self.waiting;
    }

    fn read(&self, address: u16, count: u16) -> Option<Vec<u16>> {
        let word = |at: u16| match at {
            200 => Some(self.p),
            300..=302 => Some(self.h[usize::from(at - 300)]),
            _ => None,
        };
        (address..address.checked_add(count)?).map(word).collect()
    }

    fn write(&mut self, address: u16, words: &[u16]) -> Option<()> {
        let start = usize::from(address.wrapping_sub(300));
        let Some(place) = self.h.get_mut(start..start.saturating_add(words.len())) else {
            self.writes_outside += 1;
            return None;
        };
        place.copy_from_slice(words);
        Some(())
    }
}

#[derive(Clone)]
struct Served(Arc<Mutex<BitPress>>);

impl tokio_modbus::server::Service for Served {
    type Request = Request<'static>;
    type Response = Response;
    type Exception = ExceptionCode;
    type Future = Ready<Result<Response, ExceptionCode>>;

    fn call(&self, request: Request<'static>) -> Self::Future {
        let mut press = self.0.lock().unwrap();
        ready(match request {
            Request::ReadHoldingRegisters(address, count) => press
                .read(address, count)
                .map(Response::ReadHoldingRegisters)
                .ok_or(ExceptionCode::IllegalDataAddress),
            Request::WriteMultipleRegisters(address, words) => press
                .write(address, &words)
                .map(|()| Response::WriteMultipleRegisters(address, words.len() as u16))
                .ok_or(ExceptionCode::IllegalDataAddress),
            _ => Err(ExceptionCode::IllegalFunction),
        })
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_press_with_bits_only() {
    let mut press = example("plant-bits.toml");
    let bits = Arc::new(Mutex::new(BitPress { to_do: STROKES, ..BitPress::default() }));
    let listener = TcpListener::bind(("127.0.0.1", 0)).await.unwrap();
    press.link = Link::tcp("127.0.0.1", listener.local_addr().unwrap().port(), press.link.unit);
    let served = Served(Arc::clone(&bits));
    tokio::spawn(async move {
        let on_connected = |stream, address| {
            let served = served.clone();
            async move { accept_tcp_connection(stream, address, |_| Ok(Some(served.clone()))) }
        };
        Server::new(listener).serve(&on_connected, |_| {}).await
    });
    let program = Arc::clone(&bits);
    tokio::spawn(async move {
        let mut cycle = tokio::time::interval(Duration::from_millis(5));
        loop {
            cycle.tick().await;
            program.lock().unwrap().cycle();
        }
    });
    // The scanner measures a plate that is never bent.
    let cell = SimPress::start(Config { automatic: false, ..quick() }).await.unwrap();
    // Long enough for the press to see busy, by which alone it identifies its stroke.
    let mut host = Host::start(press, Memory::new(7), cell.control(), Duration::from_millis(200));
    host.until("every result acknowledged", |status| {
        status.metrics.result_to_ack.count == u64::from(STROKES)
    })
    .await;
    let scans = host.heard.scans.lock().unwrap().len();
    host.stop().await;
    let bits = bits.lock().unwrap();
    assert_eq!(bits.results, vec![(1000, -1, false, true); STROKES as usize], "gap, sense, pass, fail");
    assert_eq!((scans, bits.writes_outside, bits.h[0]), (STROKES as usize, 0, 0));
}
