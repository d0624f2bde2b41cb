//! Running bridge: a listening port, and a thread for each connection.

use std::io;
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use super::config::BridgeConfig;
use super::connection;
use super::counters::BridgeCounters;
use super::frame::{self, Frame};
use super::head::Head;
use super::message::{Hello, Role};
use super::shared::Shared;

/// Running bridge; dropping it stops it.
#[derive(Debug)]
pub struct Bridge {
    address: SocketAddr,
    shared: Arc<Shared>,
    port: Option<JoinHandle<()>>,
    discovery: Option<JoinHandle<()>>,
}

impl Bridge {
    /// Starts listening; scans are taken by `head`.
    ///
    /// # Errors
    /// The port is in use, or the folder of recordings cannot be created.
    pub fn start(config: BridgeConfig, head: Box<dyn Head>) -> std::io::Result<Self> {
        if let Some(folder) = &config.record {
            std::fs::create_dir_all(folder)?;
        }
        let listener = TcpListener::bind(config.address)?;
        let address = listener.local_addr()?;
        let shared = Arc::new(Shared::new(config, head));
        let port = {
            let shared = Arc::clone(&shared);
            std::thread::spawn(move || accept(&listener, &shared))
        };
        // If the port number is in use for datagrams, the bridge cannot be discovered, which is allowed.
        let discovery = datagrams(address).ok().map(|socket| {
            let shared = Arc::clone(&shared);
            std::thread::spawn(move || answer(&socket, &shared))
        });
        Ok(Self { address, shared, port: Some(port), discovery })
    }

    /// Returns the address of the port.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Returns the counters since the start.
    pub fn counters(&self) -> BridgeCounters {
        self.shared.counts.read()
    }
}

impl Drop for Bridge {
    fn drop(&mut self) {
        self.shared.end();
        // Unblocks the thread that accepts connections.
        let _ = TcpStream::connect(self.address);
        if let Some(port) = self.port.take() {
            let _ = port.join();
        }
        if let Some(discovery) = self.discovery.take() {
            let _ = discovery.join();
        }
    }
}

/// Interval between checks whether the bridge ends.
const NAP: Duration = Duration::from_millis(100);

/// Opens the port for discovery (section 8 of the protocol). Broadcasts reach only a socket that is bound to all
/// addresses.
fn datagrams(address: SocketAddr) -> io::Result<UdpSocket> {
    let everywhere = SocketAddr::from((Ipv4Addr::UNSPECIFIED, address.port()));
    let local = address.ip().is_loopback() || address.is_ipv6();
    let socket = UdpSocket::bind(if local { address } else { everywhere })?;
    socket.set_read_timeout(Some(NAP))?;
    Ok(socket)
}

/// Answers discovery requests.
fn answer(socket: &UdpSocket, shared: &Shared) {
    let mut datagram = [0; 2048];
    while !shared.is_ending() {
        let Ok((length, from)) = socket.recv_from(&mut datagram) else { continue };
        let Ok(asked) = frame::read(&mut &datagram[..length], 0) else { continue };
        let hello = serde_json::from_slice::<Hello>(&asked.payload);
        if asked.kind != frame::HELLO || !hello.is_ok_and(|hello| hello.role == Role::Monitor) {
            continue;
        }
        let payload = connection::capabilities(shared).to_string().into_bytes();
        let answer = Frame { kind: frame::CAPABILITIES, scan: 0, payload };
        // The client may have ended.
        let _ = socket.send_to(&frame::bytes(&answer, 0), from);
    }
}

fn accept(listener: &TcpListener, shared: &Arc<Shared>) {
    for stream in listener.incoming().flatten() {
        if shared.is_ending() {
            return;
        }
        let Some(number) = shared.admit(&stream) else { continue };
        let shared = Arc::clone(shared);
        std::thread::spawn(move || {
            connection::serve(stream, number, &shared);
            shared.remove(number);
        });
    }
}
