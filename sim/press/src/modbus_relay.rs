//! Relay between host and Modbus server: TCP, RTU over TCP or a serial line, with fault injection.
//!
//! Each client has its own connection to the private Modbus server, and one message at a time is relayed. Faults are
//! injected at the level of requests and answers, not in a proxy of bytes.

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt, WriteHalf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Mutex;
use tokio_serial::{DataBits, Parity, SerialPortBuilderExt, SerialStream, StopBits};

use crate::answer_faults::{Answer, apply_fault, exception};
use crate::faults::LineFault;
use crate::frame::{Framing, Message, Split, split_tcp};
use crate::shared::Shared;

/// Silence after which a serial slave discards an incomplete frame.
const SILENCE: Duration = Duration::from_millis(30);
/// Pause before a failed line is reopened.
const RETRY: Duration = Duration::from_millis(50);

/// Accepts clients until the process ends.
pub(crate) async fn serve_tcp(
    listener: TcpListener,
    framing: Framing,
    unit: u8,
    server: SocketAddr,
    shared: Arc<Shared>,
) {
    loop {
        let Ok((client, _)) = listener.accept().await else {
            tokio::time::sleep(RETRY).await;
            continue;
        };
        let shared = Arc::clone(&shared);
        tokio::spawn(async move {
            // Without lingering, dropping a connection resets it, as a restart of a controller does.
            let options = client.set_nodelay(true).and_then(|()| client.set_zero_linger());
            let ended = match options {
                Ok(()) => Relay::new(client, framing, unit, shared).run(server).await,
                Err(error) => Err(error),
            };
            tracing::debug!(?ended, "Modbus client disconnected");
        });
    }
}

/// Opens a serial line, 8 data bits, even parity, 1 stop bit.
pub(crate) fn open_serial(device: &str, baud: u32) -> io::Result<SerialStream> {
    Ok(tokio_serial::new(device, baud)
        .data_bits(DataBits::Eight)
        .parity(Parity::Even)
        .stop_bits(StopBits::One)
        .open_native_async()?)
}

/// Serves a serial line until the process ends; reopens it with `reopen` when it fails or is unplugged.
pub(crate) async fn serve_serial<S: AsyncRead + AsyncWrite + Send + 'static>(
    first: S,
    reopen: impl Fn() -> io::Result<S>,
    unit: u8,
    server: SocketAddr,
    shared: Arc<Shared>,
) {
    let mut line = Some(first);
    loop {
        if let Some(line) = line.take() {
            let ended = Relay::new(line, Framing::Rtu, unit, Arc::clone(&shared)).run(server).await;
            tracing::debug!(?ended, "serial line closed, reopening");
        }
        tokio::time::sleep(RETRY).await;
        shared.plugged_in().await;
        line = reopen().inspect_err(|error| tracing::debug!(%error, "serial line not available")).ok();
    }
}

/// Writing half of the client's stream; `None` after a reset.
type Writer<S> = Arc<Mutex<Option<WriteHalf<S>>>>;

/// Relay of one client's messages.
struct Relay<S> {
    reader: tokio::io::ReadHalf<S>,
    writer: Writer<S>,
    framing: Framing,
    unit: u8,
    shared: Arc<Shared>,
    received: Vec<u8>,
}

impl<S: AsyncRead + AsyncWrite + Send + 'static> Relay<S> {
    fn new(stream: S, framing: Framing, unit: u8, shared: Arc<Shared>) -> Self {
        let (reader, writer) = tokio::io::split(stream);
        Self {
            reader,
            writer: Arc::new(Mutex::new(Some(writer))),
            framing,
            unit,
            shared,
            received: Vec::new(),
        }
    }

    /// Relays until the client disconnects, the press cuts the line, or a fault resets it.
    async fn run(mut self, server: SocketAddr) -> io::Result<()> {
        let shared = Arc::clone(&self.shared);
        let mut cuts = shared.cuts.subscribe();
        cuts.mark_unchanged();
        let mut server = TcpStream::connect(server).await?;
        server.set_nodelay(true)?;
        let writer = Arc::clone(&self.writer);
        let ended = tokio::select! {
            ended = self.pass(&mut server) => ended,
            _ = cuts.changed() => Ok(()),
            () = shared.stopped() => Ok(()),
        };
        writer.lock().await.take();
        ended
    }

    async fn pass(&mut self, server: &mut TcpStream) -> io::Result<()> {
        while let Some(request) = self.next_request().await? {
            self.shared.thaw().await;
            let fault = self.shared.draw_line_fault();
            if self.shared.line().faults.echo && self.framing == Framing::Rtu {
                send(&self.writer, &self.framing.encode(&request)).await?;
            }
            if fault == Some(LineFault::Reset) {
                return Ok(());
            }
            let answer = if fault == Some(LineFault::Exception) {
                exception(&request, self.shared.line().faults.exception_code)
            } else {
                exchange(server, &request).await?
            };
            self.shared.thaw().await;
            let faulty = {
                let mut line = self.shared.line();
                let line = &mut *line;
                apply_fault(answer, fault, self.framing, &line.faults, &mut line.random)
            };
            match faulty {
                Answer::Reset => return Ok(()),
                Answer::None => {}
                Answer::Bytes(bytes) => send(&self.writer, &bytes).await?,
                Answer::Late(bytes, delay) => {
                    let writer = Arc::clone(&self.writer);
                    tokio::spawn(async move {
                        tokio::time::sleep(delay).await;
                        // An error means that the host has disconnected by then.
                        let _ = send(&writer, &bytes).await;
                    });
                }
                Answer::Dribble(bytes) => {
                    for byte in bytes {
                        send(&self.writer, &[byte]).await?;
                        tokio::task::yield_now().await;
                    }
                }
            }
        }
        Ok(())
    }

    /// Returns the next request for this unit; `None` when the client has disconnected.
    async fn next_request(&mut self) -> io::Result<Option<Message>> {
        loop {
            match self.framing.split_request(&self.received) {
                Split::Message(message, length) => {
                    self.received.drain(..length);
                    // On a serial line requests to other units are ignored.
                    if self.framing == Framing::Tcp || message.unit == self.unit {
                        return Ok(Some(message));
                    }
                }
                Split::Junk(length) => {
                    self.received.drain(..length);
                }
                Split::More => {
                    let mut bytes = [0; 512];
                    let read = self.reader.read(&mut bytes);
                    let n = if self.framing == Framing::Rtu && !self.received.is_empty() {
                        match tokio::time::timeout(SILENCE, read).await {
                            Ok(n) => n?,
                            Err(_) => {
                                self.received.clear();
                                continue;
                            }
                        }
                    } else {
                        read.await?
                    };
                    if n == 0 {
                        return Ok(None);
                    }
                    self.received.extend(&bytes[..n]);
                }
            }
        }
    }
}

async fn send<S: AsyncWrite>(writer: &Writer<S>, bytes: &[u8]) -> io::Result<()> {
    match writer.lock().await.as_mut() {
        Some(writer) => {
            writer.write_all(bytes).await?;
            writer.flush().await
        }
        None => Err(io::ErrorKind::NotConnected.into()),
    }
}

/// Sends one request to the private server and returns its answer.
async fn exchange(server: &mut TcpStream, request: &Message) -> io::Result<Message> {
    server.write_all(&Framing::Tcp.encode(request)).await?;
    let mut received = Vec::new();
    loop {
        match split_tcp(&received) {
            Split::Message(answer, _) => return Ok(answer),
            Split::Junk(_) => return Err(io::ErrorKind::InvalidData.into()),
            Split::More => {
                if server.read_buf(&mut received).await? == 0 {
                    return Err(io::ErrorKind::UnexpectedEof.into());
                }
            }
        }
    }
}
