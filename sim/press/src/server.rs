//! Modbus server on its private port: holding-register services (functions 3, 6 and 16 of "MODBUS Application Protocol
//! V1.1b3") and the checks of each connection's writes.
//!
//! A connection ends with the run of the controller that accepted it. A request in transit at a restart is neither
//! executed nor answered, as on a real controller, whose sockets do not outlive it (RFC 9293, 3.5.1, half-open
//! connections). A host cannot avoid such a request, because it has not yet been able to detect the restart. It can
//! avoid a write after it has read registers without a valid map: a write is counted if the last read of the P block on
//! its connection contained another map version.

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
    /// Restarts of the controller before this connection.
    restarts: u64,
    read_p: AtomicBool,
    read_h: AtomicBool,
    /// The last read of the P block contained another map version.
    read_void: AtomicBool,
}

impl Connection {
    fn new(unit: u8, shared: Arc<Shared>) -> Self {
        let restarts = {
            let counters = &mut shared.machine().press.counters;
            counters.connections += 1;
            counters.restarts
        };
        let [read_p, read_h, read_void] = [false; 3].map(AtomicBool::new);
        Self { unit, shared, restarts, read_p, read_h, read_void }
    }

    fn read(&self, machine: &mut Machine, address: u16, count: u16) -> Result<Response, ExceptionCode> {
        let Machine { press, table } = machine;
        press.counters.reads += 1;
        let words = table.read(address, count).ok_or(ExceptionCode::IllegalDataAddress)?;
        if table.touches_p_block(address, count) {
            self.read_p.store(true, Ordering::Relaxed);
            self.read_void.store(!table.contains_map(), Ordering::Relaxed);
        }
        if table.touches_h_block(address, count) {
            self.read_h.store(true, Ordering::Relaxed);
        }
        Ok(Response::ReadHoldingRegisters(words.to_vec()))
    }

    fn write(&self, machine: &mut Machine, address: u16, words: &[u16]) -> Result<(), ExceptionCode> {
        let Machine { press, table } = machine;
        press.counters.writes += 1;
        if !(self.read_p.load(Ordering::Relaxed) && self.read_h.load(Ordering::Relaxed)) {
            press.counters.writes_before_sync += 1;
        }
        if self.read_void.load(Ordering::Relaxed) {
            press.counters.writes_while_void += 1;
        }
        if !table.is_of_host(address, words.len()) {
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
    /// `None`: no answer.
    type Response = Option<Response>;
    type Exception = ExceptionCode;
    type Future = Ready<Result<Option<Response>, ExceptionCode>>;

    fn call(&self, request: SlaveRequest<'static>) -> Self::Future {
        let mut machine = self.shared.machine();
        if machine.press.counters.restarts != self.restarts {
            return ready(Ok(None));
        }
        if request.slave != self.unit {
            return ready(Err(ExceptionCode::GatewayTargetDevice));
        }
        let answer = match request.request {
            Request::ReadHoldingRegisters(address, count) => self.read(&mut machine, address, count),
            Request::WriteSingleRegister(address, word) => self
                .write(&mut machine, address, &[word])
                .map(|()| Response::WriteSingleRegister(address, word)),
            Request::WriteMultipleRegisters(address, words) => self
                .write(&mut machine, address, &words)
                .map(|()| Response::WriteMultipleRegisters(address, words.len() as u16)),
            _ => Err(ExceptionCode::IllegalFunction),
        };
        ready(answer.map(Some))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Config, Timings};

    /// Returns a machine after one cycle, whose restart lasts until the next cycle.
    fn running() -> Arc<Shared> {
        let timings = Timings { restart_ms: 0, ..Timings::default() };
        let shared = Shared::new(&Config { automatic: false, timings, ..Config::default() }).unwrap();
        shared.cycle().unwrap();
        Arc::new(shared)
    }

    fn restart(shared: &Shared) {
        let Machine { press, table } = &mut *shared.machine();
        press.restart(table, shared.now());
    }

    fn call(connection: &Connection, request: Request<'static>) -> Option<Response> {
        connection.call(SlaveRequest { slave: 1, request }).into_inner().unwrap()
    }

    fn read_both(connection: &Connection) {
        for (address, count) in [(0, 32), (100, 64)] {
            assert!(call(connection, Request::ReadHoldingRegisters(address, count)).is_some());
        }
    }

    /// Writes a heartbeat; returns whether it is answered, and the number of writes without a map until now.
    fn beat(connection: &Connection) -> (bool, u64) {
        let answer = call(connection, Request::WriteMultipleRegisters(101, vec![7].into()));
        (answer.is_some(), connection.shared.machine().press.counters.writes_while_void)
    }

    #[test]
    fn a_request_under_way_at_a_restart_is_not_executed() {
        let shared = running();
        let connection = Connection::new(1, Arc::clone(&shared));
        read_both(&connection);
        assert_eq!(beat(&connection), (true, 0));
        restart(&shared);
        for _ in ["while the registers are 0", "in the next session"] {
            assert_eq!(beat(&connection), (false, 0));
            assert_eq!(call(&connection, Request::ReadHoldingRegisters(0, 32)), None);
            shared.cycle().unwrap();
            assert_eq!(shared.machine().table.h_block().word(1), 0);
        }
        assert_eq!(shared.machine().press.counters.writes, 1);
    }

    #[test]
    fn a_host_that_writes_after_reading_no_map_is_counted() {
        let shared = running();
        restart(&shared);
        let connection = Connection::new(1, Arc::clone(&shared));
        read_both(&connection);
        assert_eq!(beat(&connection), (true, 1), "while the registers are 0");
        shared.cycle().unwrap();
        assert!(shared.machine().table.contains_map());
        assert_eq!(beat(&connection), (true, 2), "the map is back, but the host has not read it");
        read_both(&connection);
        assert_eq!(beat(&connection), (true, 2), "a map was read");
    }
}
