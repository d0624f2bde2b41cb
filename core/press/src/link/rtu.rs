//! RTU framing on a serial port or through a serial-to-Ethernet gateway (MODBUS over Serial Line V1.02).
//!
//! RTU has no transaction identifier: an answer after its time limit would be taken for the next one. A new connection
//! therefore drains the line until it has been silent for longer than the press takes to answer.

use std::collections::VecDeque;
use std::io;
use std::path::Path;
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use platen_plant::press::{Parity, Serial};
use serial2::rs4xx::Rs485Config;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, ReadBuf};
use tokio::time::timeout;
use tokio_serial::{SerialPortBuilderExt, SerialStream};

/// Longest drain; a line that is never silent is unusable.
pub(super) const DRAIN_MAX: Duration = Duration::from_secs(3);

/// Opens a serial port for Modbus RTU.
pub(super) fn open(serial: &Serial) -> io::Result<SerialStream> {
    let parity = match serial.parity {
        Parity::Even => tokio_serial::Parity::Even,
        Parity::Odd => tokio_serial::Parity::Odd,
        Parity::None => tokio_serial::Parity::None,
    };
    let stop_bits =
        if serial.stop_bits == 2 { tokio_serial::StopBits::Two } else { tokio_serial::StopBits::One };
    let port =
        tokio_serial::new(serial.device.to_string_lossy(), serial.baud).parity(parity).stop_bits(stop_bits);
    // Held until the port is open: settings may be lost while no process has the port open.
    let _told = serial.rs485.then(|| switch_direction(&serial.device)).transpose()?;
    port.open_native_async().map_err(io::Error::from)
}

/// Enables RS-485 direction control by the port's driver: RTS is high while it sends (Linux, `TIOCSRS485`,
/// Documentation/driver-api/serial/serial-rs485.rst).
fn switch_direction(device: &Path) -> io::Result<serial2::SerialPort> {
    let port = serial2::SerialPort::open(device, serial2::KeepSettings)?;
    let refused = |error: io::Error| {
        io::Error::other(format!(
            "the driver of {} cannot switch the direction of an RS-485 line ({error}); an adapter that does so itself \
             needs no rs485 = true",
            device.display()
        ))
    };
    port.set_rs4xx_mode(Rs485Config::new()).map_err(refused)?;
    Ok(port)
}

/// Discards input until the line has been silent for `quiet`.
pub(super) async fn drain(stream: &mut (impl AsyncRead + Unpin), quiet: Duration) -> io::Result<()> {
    let silence = async {
        let mut scrap = [0; 256];
        loop {
            match timeout(quiet, stream.read(&mut scrap)).await {
                Err(_) => return Ok(()),
                Ok(Ok(0)) => return Err(io::ErrorKind::UnexpectedEof.into()),
                Ok(Ok(_)) => {}
                Ok(Err(error)) => return Err(error),
            }
        }
    };
    timeout(DRAIN_MAX.max(quiet * 2), silence)
        .await
        .unwrap_or_else(|_| Err(io::Error::other("the line is never quiet; is there a second master on it?")))
}

/// Stream with local echo: written bytes return first and are removed.
#[derive(Debug)]
pub(super) struct EchoFree<S> {
    stream: S,
    expected: VecDeque<u8>,
}

impl<S> EchoFree<S> {
    pub(super) fn new(stream: S) -> Self {
        Self { stream, expected: VecDeque::new() }
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for EchoFree<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        out: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        loop {
            let this = &mut *self;
            let mut bytes = [0; 256];
            let room = out.remaining().min(bytes.len());
            let mut heard = ReadBuf::new(&mut bytes[..room]);
            ready!(Pin::new(&mut this.stream).poll_read(cx, &mut heard))?;
            let heard = heard.filled();
            let echo = heard.len().min(this.expected.len());
            if this.expected.drain(..echo).ne(heard[..echo].iter().copied()) {
                return Poll::Ready(Err(io::Error::other(
                    "the echo differs from what was sent; is echo = true right?",
                )));
            }
            out.put_slice(&heard[echo..]);
            if heard.is_empty() || heard.len() > echo {
                return Poll::Ready(Ok(()));
            }
        }
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for EchoFree<S> {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        let sent = ready!(Pin::new(&mut self.stream).poll_write(cx, bytes))?;
        self.expected.extend(&bytes[..sent]);
        Poll::Ready(Ok(sent))
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serialport::{SerialPort, TTYPort};
    use tokio::io::{AsyncWriteExt, duplex};

    #[tokio::test(start_paused = true)]
    async fn drains_until_the_line_has_been_silent() {
        let (mut host, mut line) = duplex(64);
        let late = tokio::spawn(async move {
            tokio::time::sleep(Duration::from_millis(300)).await;
            line.write_all(b"late").await.unwrap();
            tokio::time::sleep(Duration::from_millis(600)).await;
            line.write_all(b"new").await.unwrap();
            line
        });
        drain(&mut host, Duration::from_millis(400)).await.unwrap();
        let mut word = [0; 3];
        host.read_exact(&mut word).await.unwrap();
        assert_eq!(&word, b"new");
        drop(late.await.unwrap());
        assert!(drain(&mut host, Duration::from_millis(400)).await.is_err(), "the far end is gone");
    }

    #[tokio::test(start_paused = true)]
    async fn a_line_that_is_never_silent_is_an_error() {
        let (mut host, mut line) = duplex(64);
        tokio::spawn(async move {
            while line.write_all(b"x").await.is_ok() {
                tokio::time::sleep(Duration::from_millis(50)).await;
            }
        });
        assert!(drain(&mut host, Duration::from_millis(400)).await.is_err());
    }

    #[tokio::test]
    async fn a_port_that_cannot_switch_the_direction_says_so() {
        let (_line, host) = TTYPort::pair().unwrap();
        let serial = Serial::new(host.name().unwrap(), 38_400);
        assert!(open(&serial).is_ok());
        let refused = open(&Serial { rs485: true, ..serial }).unwrap_err().to_string();
        assert!(
            refused.contains("cannot switch the direction") && refused.contains("rs485 = true"),
            "{refused}"
        );
    }

    #[tokio::test]
    async fn takes_its_own_words_out() {
        let (near, mut line) = duplex(64);
        let mut host = EchoFree::new(near);
        host.write_all(b"ask").await.unwrap();
        line.write_all(b"as").await.unwrap();
        line.write_all(b"kanswer").await.unwrap();
        let mut answer = [0; 6];
        host.read_exact(&mut answer).await.unwrap();
        assert_eq!(&answer, b"answer");
        host.write_all(b"ask").await.unwrap();
        line.write_all(b"axe").await.unwrap();
        assert!(host.read_exact(&mut answer).await.is_err());
    }
}
