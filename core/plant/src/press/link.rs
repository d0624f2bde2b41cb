//! Connection to the press and its time limits.

use std::net::IpAddr;
use std::path::PathBuf;
use std::time::Duration;

/// Connection to the press and its time limits.
#[derive(Debug, Clone, PartialEq)]
pub struct Link {
    /// Transport.
    pub transport: Transport,
    /// Modbus unit id; gateways need the real one.
    pub unit: u8,
    /// Longest wait for a connection.
    pub connect_timeout: Duration,
    /// Longest wait for an answer.
    pub response_timeout: Duration,
    /// Wait after connecting, for controllers that are not ready at once.
    pub pause_after_connect: Duration,
    /// Wait between two requests.
    pub pause_between_requests: Duration,
    /// Time from one poll to the next.
    pub poll: Duration,
    /// Shortest wait before a new attempt to connect.
    pub backoff_min: Duration,
    /// Longest wait before a new attempt to connect.
    pub backoff_max: Duration,
}

/// Transport of Modbus frames.
#[derive(Debug, Clone, PartialEq)]
pub enum Transport {
    /// Modbus TCP.
    Tcp(Socket),
    /// Modbus RTU on a serial port.
    Rtu(Serial, Quiet),
    /// Modbus RTU frames through a serial-to-Ethernet gateway.
    RtuOverTcp(Socket, Quiet),
}

/// TCP address: that of the press if the host is the client, or the one on which the host listens if it is the server.
#[derive(Debug, Clone, PartialEq)]
pub struct Socket {
    /// Name or address.
    pub host: String,
    /// Port.
    pub port: u16,
    /// Server role only: addresses that may connect; empty admits loopback only.
    pub peers: Vec<IpAddr>,
}

/// Serial port.
#[derive(Debug, Clone, PartialEq)]
pub struct Serial {
    /// Device file; a name in `/dev/serial/by-id` survives replugging.
    pub device: PathBuf,
    /// Bits per second.
    pub baud: u32,
    /// Parity bit.
    pub parity: Parity,
    /// Stop bits, 1 or 2.
    pub stop_bits: u8,
    /// The adapter receives its own requests, which are removed from the answers.
    pub echo: bool,
    /// The kernel's driver of the port switches the direction of a two-wire RS-485 line by RTS. Most adapters switch it
    /// themselves.
    pub rs485: bool,
}

/// Parity bit of a serial line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Parity {
    /// Even, the Modbus default.
    #[default]
    Even,
    /// Odd.
    Odd,
    /// None.
    None,
}

/// Silence required on a serial line after a fault, before the next request.
///
/// RTU frames have no transaction number, so a late answer would be taken for the next one. Must exceed the longest
/// answer time of the press.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Quiet(pub Duration);

impl Link {
    /// Makes a Modbus TCP link to `host:port` with default time limits.
    pub fn tcp(host: impl Into<String>, port: u16, unit: u8) -> Self {
        Self::new(Transport::Tcp(Socket::new(host, port)), unit)
    }

    /// Makes a Modbus RTU link on a serial port; the response time follows from the line's speed.
    pub fn rtu(serial: Serial, unit: u8) -> Self {
        Self::new(Transport::rtu(serial), unit)
    }

    /// Makes a link of Modbus RTU frames over TCP to a gateway.
    pub fn rtu_over_tcp(host: impl Into<String>, port: u16, unit: u8) -> Self {
        Self::new(Transport::rtu_over_tcp(Socket::new(host, port)), unit)
    }

    /// Makes a link with the default time limits of its transport.
    pub(super) fn new(transport: Transport, unit: u8) -> Self {
        let (response_timeout, poll_ms) = match &transport {
            Transport::Tcp(_) => (Duration::from_millis(300), 20),
            Transport::Rtu(serial, _) => (serial.response_timeout(), 100),
            Transport::RtuOverTcp(..) => (Duration::from_millis(500), 100),
        };
        Self {
            transport,
            unit,
            connect_timeout: Duration::from_secs(1),
            response_timeout,
            pause_after_connect: Duration::ZERO,
            pause_between_requests: Duration::ZERO,
            poll: Duration::from_millis(poll_ms),
            backoff_min: Duration::from_millis(100),
            backoff_max: Duration::from_secs(1),
        }
    }

    /// Returns whether requests and answers share a slow line, on which each poll reads as little as possible.
    pub fn is_serial(&self) -> bool {
        !matches!(self.transport, Transport::Tcp(_))
    }

    /// Returns the silence required after a fault; `None` for frames with transaction numbers.
    pub fn quiet(&self) -> Option<Duration> {
        match &self.transport {
            Transport::Tcp(_) => None,
            Transport::Rtu(_, Quiet(quiet)) | Transport::RtuOverTcp(_, Quiet(quiet)) => Some(*quiet),
        }
    }
}

impl Transport {
    pub(super) fn rtu(serial: Serial) -> Self {
        let quiet = Quiet(serial.response_timeout().mul_f64(1.5));
        Self::Rtu(serial, quiet)
    }

    pub(super) fn rtu_over_tcp(socket: Socket) -> Self {
        Self::RtuOverTcp(socket, Quiet(Duration::from_millis(750)))
    }
}

impl Socket {
    /// Makes an address that only loopback may connect to.
    pub(super) fn new(host: impl Into<String>, port: u16) -> Self {
        Self { host: host.into(), port, peers: Vec::new() }
    }
}

impl Serial {
    /// Makes a port with the Modbus defaults: even parity, one stop bit.
    pub fn new(device: impl Into<PathBuf>, baud: u32) -> Self {
        Self { device: device.into(), baud, parity: Parity::Even, stop_bits: 1, echo: false, rs485: false }
    }

    /// Returns the line time of `bytes` characters of 11 bits.
    pub fn line_time(&self, bytes: u32) -> Duration {
        Duration::from_secs_f64(f64::from(bytes) * 11.0 / f64::from(self.baud.max(1)))
    }

    /// Returns the default response time limit: three times the line time of the longest exchange (60 registers
    /// written, 139 bytes) and 60 ms for the press to answer and the adapter to buffer.
    pub fn response_timeout(&self) -> Duration {
        self.line_time(139) * 3 + Duration::from_millis(60)
    }
}

impl std::fmt::Display for Transport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Tcp(socket) => write!(f, "{}:{}", socket.host, socket.port),
            Self::Rtu(serial, _) => write!(f, "{} at {} baud", serial.device.display(), serial.baud),
            Self::RtuOverTcp(socket, _) => write!(f, "{}:{} (RTU)", socket.host, socket.port),
        }
    }
}
