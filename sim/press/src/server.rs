//! Modbus server on its private port: holding-register services (functions 3, 6 and 16 of "MODBUS Application Protocol V1.1b3") and
//! the checks of each connection's writes.

use std::future::{Ready, ready};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use tokio::net::TcpListener;
use tokio_modbus::prelude::*;
use tokio_modbus::server::Service;
use tokio_modbus::server::tcp::{Server, accept_tcp_connection};

use crate::shared::{Machine, Shared};

/// Pause before the server restarts after a failed accept.
const RESTART_PAUSE: Duration = Duration::from_millis(10);

/// Serves until the process ends; restarts the library's server, which ends on a failed accept.
pub(crate) async fn serve(listener: TcpListener, unit: u8, shared: Arc<Shared>) {
    let server = Server::new(listener);
    let new_service = |_| Ok(Some(Connection::new(unit, Arc::clone(&shared))));
    let on_connected = |stream, address| async move { accept_tcp_connection(stream, address, new_service) };
    loop {
        let ended = server.serve(&on_connected, |error| tracing::debug!(%error, "connection ended")).await;
        tracing::debug!(?ended, "Modbus server ended, restarting");
        tokio::time::sleep(RESTART_PAUSE).await;
    }
}

/// Connection of one client.
struct Connection {
    unit: u8,
    shared: Arc<Shared>,
    read_p: AtomicBool,
    read_h: AtomicBool,
}

impl Connection {
    fn new(unit: u8, shared: Arc<Shared>) -> Self {
        shared.machine().press.counters.connections += 1;
        Self { unit, shared, read_p: AtomicBool::new(false), read_h: AtomicBool::new(false) }
    }

    fn read(&self, address: u16, count: u16) -> Result<Response, ExceptionCode> {
        let mut machine = self.shared.machine();
        let Machine { press, table } = &mut *machine;
        press.counters.reads += 1;
        let words = table.read(address, count).ok_or(ExceptionCode::IllegalDataAddress)?;
        if table.touches_p_block(address, count) {
            self.read_p.store(true, Ordering::Relaxed);
        }
        if table.touches_h_block(address, count) {
            self.read_h.store(true, Ordering::Relaxed);
        }
        Ok(Response::ReadHoldingRegisters(words.to_vec()))
    }

    fn write(&self, address: u16, words: &[u16]) -> Result<(), ExceptionCode> {
        let mut machine = self.shared.machine();
        let Machine { press, table } = &mut *machine;
        press.counters.writes += 1;
        if !(self.read_p.load(Ordering::Relaxed) && self.read_h.load(Ordering::Relaxed)) {
            press.counters.writes_before_sync += 1;
        }
        if !press.serves_the_map() {
            press.counters.writes_while_void += 1;
        }
        if !table.in_h_block(address, words.len()) {
            press.counters.writes_outside += 1;
        }
        if !table.write(address, words) {
            return Err(ExceptionCode::IllegalDataAddress);
        }
        press.write_monitor.observe(&table.h_block(), &mut press.counters);
        Ok(())
    }
}

impl Service for Connection {
    type Request = SlaveRequest<'static>;
    type Response = Response;
    type Exception = ExceptionCode;
    type Future = Ready<Result<Response, ExceptionCode>>;

    fn call(&self, request: SlaveRequest<'static>) -> Self::Future {
        if request.slave != self.unit {
            return ready(Err(ExceptionCode::GatewayTargetDevice));
        }
        ready(match request.request {
            Request::ReadHoldingRegisters(address, count) => self.read(address, count),
            Request::WriteSingleRegister(address, word) => {
                self.write(address, &[word]).map(|()| Response::WriteSingleRegister(address, word))
            }
            Request::WriteMultipleRegisters(address, words) => self
                .write(address, &words)
                .map(|()| Response::WriteMultipleRegisters(address, words.len() as u16)),
            _ => Err(ExceptionCode::IllegalFunction),
        })
    }
}
