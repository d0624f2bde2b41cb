//! Modbus TCP server in the host, for presses with client function blocks only: the press writes its block here and
//! reads the host's block.
//!
//! It implements [`Link`]: a read of the press returns the block that the press wrote last. A press that has sent no
//! request for a time counts as not connected.

use std::future::{Ready, ready};
use std::net::{IpAddr, SocketAddr};
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use platen_plant::press::{Block, Press, Socket};
use tokio::net::TcpListener;
use tokio::sync::Semaphore;
use tokio::task::AbortHandle;
use tokio::time::{Instant, sleep};
use tokio_modbus::server::tcp::{Server, accept_tcp_connection};
use tokio_modbus::{ExceptionCode, Request as Wire, Response as WireResponse, SlaveRequest};

use super::{Link, Request, Response, TransportError};

/// Concurrent connections: the press, a previous connection whose end was not noticed, and two tools.
const CONNECTIONS: usize = 4;
/// Time without a request after which the press counts as disconnected.
const SILENCE: Duration = Duration::from_secs(2);
/// Period of the check for the press, and pause before the server is started again.
const LOOK: Duration = Duration::from_millis(10);
/// Unit ids that any TCP server accepts.
const ANY_UNIT: [u8; 2] = [0, 255];

/// Link to a press that is the Modbus client.
#[derive(Debug)]
pub struct ServerLink {
    socket: Socket,
    unit: u8,
    registers: Arc<Registers>,
    server: Option<Listening>,
}

/// The server and its address.
#[derive(Debug)]
struct Listening {
    address: SocketAddr,
    task: AbortHandle,
}

/// Both blocks as the press sees them.
#[derive(Debug)]
struct Registers {
    press: Block,
    host: Block,
    words: Mutex<Words>,
}

#[derive(Debug)]
struct Words {
    press: Vec<u16>,
    host: Vec<u16>,
    /// Time of the last write of the press.
    heard: Option<Instant>,
}

impl ServerLink {
    /// Returns the link of the plant file; `socket` is the address to listen on.
    pub(super) fn new(press: &Press, socket: &Socket) -> Self {
        let (read, write) = (press.map.read, press.map.write);
        let zeros = |block: Block| vec![0; usize::from(block.count)];
        let words = Mutex::new(Words { press: zeros(read), host: zeros(write), heard: None });
        let registers = Arc::new(Registers { press: read, host: write, words });
        Self { socket: socket.clone(), unit: press.link.unit, registers, server: None }
    }

    /// Starts to listen and returns the address: with port 0 the system chooses. Later calls return the same address.
    ///
    /// # Errors
    /// The address is not one of this computer, or the port is in use.
    pub async fn listen(&mut self) -> Result<SocketAddr, TransportError> {
        if let Some(server) = self.server.as_ref().filter(|server| !server.task.is_finished()) {
            return Ok(server.address);
        }
        let listener = TcpListener::bind((self.socket.host.as_str(), self.socket.port)).await?;
        let address = listener.local_addr()?;
        let (registers, peers) = (Arc::clone(&self.registers), self.socket.peers.clone());
        let task = tokio::spawn(serve(listener, registers, self.unit, peers)).abort_handle();
        self.server = Some(Listening { address, task });
        Ok(address)
    }
}

impl Drop for ServerLink {
    fn drop(&mut self) {
        if let Some(server) = &self.server {
            server.task.abort();
        }
    }
}

impl Link for ServerLink {
    fn peer(&self) -> String {
        format!("expected at {}:{} unit {}", self.socket.host, self.socket.port, self.unit)
    }

    /// Listens, then waits for the press to write its block.
    async fn connect(&mut self) -> Result<(), TransportError> {
        self.listen().await?;
        while !self.registers.press_is_there() {
            sleep(LOOK).await;
        }
        Ok(())
    }

    async fn call(&mut self, request: &Request) -> Result<Response, TransportError> {
        if !self.registers.press_is_there() {
            return Err(TransportError::NotConnected);
        }
        let (press, host) = (self.registers.press, self.registers.host);
        let mut words = self.registers.lock();
        let response = match request {
            Request::Read { table, start, count }
                if *table == press.table && part(&press, *start, *count).is_some() =>
            {
                part(&press, *start, *count).map(|part| Response::Words(words.press[part].to_vec()))
            }
            Request::Read { start, count, .. } => {
                part(&host, *start, *count).map(|part| Response::Words(words.host[part].to_vec()))
            }
            Request::Write { start, words: new } => {
                let count = u16::try_from(new.len()).unwrap_or(u16::MAX);
                part(&host, *start, count).map(|part| {
                    words.host[part].copy_from_slice(new);
                    Response::Written { start: *start, count }
                })
            }
            // A client has no identification that could be read.
            Request::Identify => return Ok(Response::Exception(ExceptionCode::IllegalFunction.into())),
        };
        Ok(response.unwrap_or(Response::Exception(ExceptionCode::IllegalDataAddress.into())))
    }

    /// Does nothing: the server continues, and the press connects.
    fn disconnect(&mut self) {}
}

/// Returns the place of consecutive registers in a block, if they lie in it.
fn part(block: &Block, start: u16, count: u16) -> Option<Range<usize>> {
    let first = start.checked_sub(block.start)?;
    let inside = count > 0 && u32::from(first) + u32::from(count) <= u32::from(block.count);
    inside.then(|| usize::from(first)..usize::from(first) + usize::from(count))
}

impl Registers {
    /// Locks the words. They are plain numbers, so a panic elsewhere cannot leave them inconsistent.
    fn lock(&self) -> MutexGuard<'_, Words> {
        self.words.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn press_is_there(&self) -> bool {
        self.lock().heard.is_some_and(|heard| heard.elapsed() < SILENCE)
    }

    /// Answers a request: the press may read both blocks and write its own, nothing else.
    fn serve(&self, request: Wire<'_>) -> Result<WireResponse, ExceptionCode> {
        let mut words = self.lock();
        match request {
            Wire::ReadHoldingRegisters(start, count) => {
                let host = part(&self.host, start, count).map(|part| words.host[part].to_vec());
                let press = || part(&self.press, start, count).map(|part| words.press[part].to_vec());
                let found = host.or_else(press).ok_or(ExceptionCode::IllegalDataAddress)?;
                Ok(WireResponse::ReadHoldingRegisters(found))
            }
            Wire::WriteMultipleRegisters(start, new) => {
                let count = u16::try_from(new.len()).unwrap_or(u16::MAX);
                self.take(&mut words, start, count, &new)?;
                Ok(WireResponse::WriteMultipleRegisters(start, count))
            }
            Wire::WriteSingleRegister(start, word) => {
                self.take(&mut words, start, 1, &[word])?;
                Ok(WireResponse::WriteSingleRegister(start, word))
            }
            _ => Err(ExceptionCode::IllegalFunction),
        }
    }

    fn take(&self, words: &mut Words, start: u16, count: u16, new: &[u16]) -> Result<(), ExceptionCode> {
        let part = part(&self.press, start, count).ok_or(ExceptionCode::IllegalDataAddress)?;
        words.press[part].copy_from_slice(new);
        words.heard = Some(Instant::now());
        Ok(())
    }
}

/// Requests of one connection.
#[derive(Clone)]
struct Service {
    registers: Arc<Registers>,
    unit: u8,
    /// Released when the connection ends.
    _place: Arc<tokio::sync::OwnedSemaphorePermit>,
}

impl tokio_modbus::server::Service for Service {
    type Request = SlaveRequest<'static>;
    type Response = Option<WireResponse>;
    type Exception = ExceptionCode;
    type Future = Ready<Result<Option<WireResponse>, ExceptionCode>>;

    fn call(&self, request: SlaveRequest<'static>) -> Self::Future {
        let mine = request.slave == self.unit || ANY_UNIT.contains(&request.slave);
        ready(if mine { self.registers.serve(request.request).map(Some) } else { Ok(None) })
    }
}

/// Serves without end: the library's server ends at the first failing `accept` and is started again.
async fn serve(listener: TcpListener, registers: Arc<Registers>, unit: u8, peers: Vec<IpAddr>) {
    let places = Arc::new(Semaphore::new(CONNECTIONS));
    let admit = |address: SocketAddr| {
        let known = if peers.is_empty() { address.ip().is_loopback() } else { peers.contains(&address.ip()) };
        let place = Arc::clone(&places).try_acquire_owned().ok().filter(|_| known);
        if place.is_none() {
            tracing::warn!(%address, known, "connection refused");
        }
        place.map(|place| Service { registers: Arc::clone(&registers), unit, _place: Arc::new(place) })
    };
    let server = Server::new(listener);
    loop {
        let on_connected = |stream, address| async move {
            accept_tcp_connection(stream, address, |address| Ok(admit(address)))
        };
        let served =
            server.serve(&on_connected, |error| tracing::debug!(%error, "connection of the press")).await;
        if let Err(error) = served {
            tracing::warn!(%error, "the Modbus server is started again");
        }
        sleep(LOOK).await;
    }
}
