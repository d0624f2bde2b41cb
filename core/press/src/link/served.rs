//! The host as Modbus server, for presses that have client blocks only: the press writes its block here and reads the
//! host's.
//!
//! For the rest of the host this is a link like any other: reading the press means looking at what it wrote last. A
//! press that has not asked for anything for a while is not connected.

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

/// Connections at a time: the press, its predecessor whose end was not noticed, and two people's tools.
const CONNECTIONS: usize = 4;
/// A press that is silent this long is gone.
const SILENCE: Duration = Duration::from_secs(2);
/// Time between two looks whether the press is there, and before a server that ended is started again.
const LOOK: Duration = Duration::from_millis(10);
/// Modbus unit ids that mean "whoever answers at this address" on TCP.
const ANY_UNIT: [u8; 2] = [0, 255];

/// A link to a press that asks.
#[derive(Debug)]
pub struct ServedLink {
    socket: Socket,
    unit: u8,
    registers: Arc<Registers>,
    server: Option<Listening>,
}

/// The server, and where it is reached.
#[derive(Debug)]
struct Listening {
    address: SocketAddr,
    task: AbortHandle,
}

/// Both blocks, as the press sees them.
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
    /// When the press last wrote its block.
    heard: Option<Instant>,
}

impl ServedLink {
    /// A link as the plant file describes it; `socket` is where to listen.
    pub(super) fn new(press: &Press, socket: &Socket) -> Self {
        let (read, write) = (press.map.read, press.map.write);
        let zeros = |block: Block| vec![0; usize::from(block.count)];
        let words = Mutex::new(Words { press: zeros(read), host: zeros(write), heard: None });
        let registers = Arc::new(Registers { press: read, host: write, words });
        Self { socket: socket.clone(), unit: press.link.unit, registers, server: None }
    }

    /// Listens from now on, and says where: with port 0 the system chooses. Later calls find it listening.
    ///
    /// # Errors
    /// When the address is not this computer's, or the port is taken.
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

impl Drop for ServedLink {
    fn drop(&mut self) {
        if let Some(server) = &self.server {
            server.task.abort();
        }
    }
}

impl Link for ServedLink {
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
            // A press that asks cannot be asked.
            Request::Identify => return Ok(Response::Exception(ExceptionCode::IllegalFunction.into())),
        };
        Ok(response.unwrap_or(Response::Exception(ExceptionCode::IllegalDataAddress.into())))
    }

    /// The server goes on: it is the press that connects.
    fn disconnect(&mut self) {}
}

/// Where consecutive registers lie in a block, if they do.
fn part(block: &Block, start: u16, count: u16) -> Option<Range<usize>> {
    let first = start.checked_sub(block.start)?;
    let inside = count > 0 && u32::from(first) + u32::from(count) <= u32::from(block.count);
    inside.then(|| usize::from(first)..usize::from(first) + usize::from(count))
}

impl Registers {
    /// Words are plain numbers: a panic elsewhere cannot have left them half done.
    fn lock(&self) -> MutexGuard<'_, Words> {
        self.words.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn press_is_there(&self) -> bool {
        self.lock().heard.is_some_and(|heard| heard.elapsed() < SILENCE)
    }

    /// What the press asks: it may read both blocks and write its own, nothing else.
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

/// One connection's requests.
#[derive(Clone)]
struct Service {
    registers: Arc<Registers>,
    unit: u8,
    /// Gives the place back when the connection ends.
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

/// Serves for ever: the library's server ends at the first `accept` that fails, so it is started again.
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
