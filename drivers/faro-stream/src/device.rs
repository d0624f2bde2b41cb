//! Socket and clock: connections come and go, the session goes on.

use std::io::{ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

use platen_scan::{Column, ScanEnd, ScanHeader};
use platen_sdk::{Job, ScanSink};

use crate::error::{Error, Result};
use crate::message::{self, Settings};
use crate::session::{Action, Request, Session, check_scanner, json, parse, refused};
use crate::wire::{Decoder, Frame, VERSION, encode, kind};

/// Longest wait for a byte before deadline, cancelling and heartbeat are looked at.
const TICK: Duration = Duration::from_millis(20);
/// Longest time between two frames of ours.
const HEARTBEAT: Duration = Duration::from_secs(1);
/// Longest silence of a bridge that must speak every second.
const SILENCE: Duration = Duration::from_secs(4);
/// Longest wait for a connection.
const CONNECT: Duration = Duration::from_secs(2);
/// Waits between two connections, doubling.
const BACK_OFF: (Duration, Duration) = (Duration::from_millis(100), Duration::from_secs(5));
/// Time before the deadline that is kept for saying why there is no scan.
const LAST_WORDS: Duration = Duration::from_millis(100);

/// Who wants the scan.
pub(crate) trait Host {
    /// An error when the job was cancelled.
    fn check(&self) -> Result<()>;
    /// Time until the deadline.
    fn remaining(&self) -> Duration;
    /// Says how far the work is.
    fn progress(&self, fraction: f64, phase: &str);
    /// Takes what the session delivers.
    fn begin(&mut self, header: &ScanHeader) -> Result<()>;
    /// One column.
    fn column(&mut self, column: &Column) -> Result<()>;
    /// The end.
    fn end(&mut self, end: &ScanEnd) -> Result<()>;
}

/// The host behind the plugin boundary.
pub(crate) struct ToHost<'a, 'j, 's> {
    pub(crate) job: &'a Job<'j>,
    pub(crate) out: &'a mut ScanSink<'s>,
}

impl Host for ToHost<'_, '_, '_> {
    fn check(&self) -> Result<()> {
        Ok(self.job.check()?)
    }

    fn remaining(&self) -> Duration {
        self.job.remaining()
    }

    fn progress(&self, fraction: f64, phase: &str) {
        self.job.progress(fraction, phase);
    }

    fn begin(&mut self, header: &ScanHeader) -> Result<()> {
        Ok(self.out.begin(header)?)
    }

    fn column(&mut self, column: &Column) -> Result<()> {
        Ok(self.out.column(column)?)
    }

    fn end(&mut self, end: &ScanEnd) -> Result<()> {
        Ok(self.out.end(end)?)
    }
}

/// A connection to a bridge.
struct Link {
    stream: TcpStream,
    decoder: Decoder,
    sequence: u64,
    heard: Instant,
    spoke: Instant,
}

impl Link {
    fn connect(address: &str) -> Result<Self> {
        let broken = |error: std::io::Error| Error::Broken(error.to_string());
        let mut last = Error::Broken("the name has no address".to_owned());
        for address in address.to_socket_addrs().map_err(broken)? {
            match TcpStream::connect_timeout(&address, CONNECT) {
                Ok(stream) => {
                    stream.set_nodelay(true).map_err(broken)?;
                    stream.set_read_timeout(Some(TICK)).map_err(broken)?;
                    stream.set_write_timeout(Some(HEARTBEAT)).map_err(broken)?;
                    let now = Instant::now();
                    return Ok(Self {
                        stream,
                        decoder: Decoder::default(),
                        sequence: 0,
                        heard: now,
                        spoke: now,
                    });
                }
                Err(error) => last = broken(error),
            }
        }
        Err(last)
    }

    fn send(&mut self, kind: u16, scan: u32, payload: &[u8]) -> Result<()> {
        let bytes = encode(kind, scan, self.sequence, payload);
        self.sequence += 1;
        self.spoke = Instant::now();
        self.stream.write_all(&bytes).map_err(|error| Error::Broken(error.to_string()))
    }

    /// The next frame, `None` after a tick without one.
    fn receive(&mut self) -> Result<Option<Frame>> {
        if let Some(frame) = self.decoder.next()? {
            return Ok(Some(frame));
        }
        let mut bytes = [0; 1 << 16];
        match self.stream.read(&mut bytes) {
            Ok(0) => return Err(Error::Broken("the bridge closed it".to_owned())),
            Ok(n) => {
                self.heard = Instant::now();
                self.decoder.push(&bytes[..n]);
            }
            Err(error)
                if matches!(
                    error.kind(),
                    ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
                ) => {}
            Err(error) => return Err(Error::Broken(error.to_string())),
        }
        if self.heard.elapsed() > SILENCE {
            return Err(Error::Broken(format!("the bridge was silent for {} s", SILENCE.as_secs())));
        }
        if self.spoke.elapsed() > HEARTBEAT {
            self.send(kind::HEARTBEAT, 0, &[])?;
        }
        self.decoder.next()
    }
}

/// Scans through the bridge at `address`; the host gets the columns as they come.
pub(crate) fn scan(address: &str, request: Request, host: &mut impl Host) -> Result<()> {
    let mut session = Session::new(request);
    let mut wait = BACK_OFF.0;
    loop {
        let started = Instant::now();
        let error = match connection(address, &mut session, host) {
            Ok(()) => return Ok(()),
            Err(error @ (Error::Broken(_) | Error::Busy { .. })) => error,
            Err(error) => return Err(error),
        };
        // A connection that held is no reason to wait longer for the next.
        wait = if started.elapsed() > SILENCE { BACK_OFF.0 } else { (wait * 2).min(BACK_OFF.1) };
        let pause = match &error {
            Error::Busy { retry_ms, .. } => Duration::from_millis(*retry_ms).min(BACK_OFF.1),
            _ => wait,
        };
        pause_for(pause, host, &error)?;
    }
}

/// One connection, until the scan is whole or the connection fails.
fn connection(address: &str, session: &mut Session, host: &mut impl Host) -> Result<()> {
    let mut link = Link::connect(address)?;
    session.connected();
    loop {
        while let Some(action) = session.action() {
            match action {
                Action::Send(kind, scan, payload) => link.send(kind, scan, &payload)?,
                Action::Progress(fraction, phase) => host.progress(fraction, &phase),
                Action::Begin(header) => host.begin(&header)?,
                Action::Column(column) => host.column(&column)?,
                Action::End(end) => return host.end(&end),
            }
        }
        if let Err(cancelled) = host.check() {
            if let Action::Send(kind, scan, payload) = session.abort() {
                // The job is over whether the bridge hears of it or not: its lease ends by itself.
                let _ = link.send(kind, scan, &payload);
            }
            return Err(cancelled);
        }
        if host.remaining() < LAST_WORDS {
            return Err(Error::TooLate("the scan was still running".to_owned()));
        }
        if let Some(frame) = link.receive()? {
            session.frame(&frame)?;
        }
    }
}

fn pause_for(pause: Duration, host: &impl Host, error: &Error) -> Result<()> {
    let started = Instant::now();
    while started.elapsed() < pause {
        host.check()?;
        if host.remaining() < LAST_WORDS {
            return Err(Error::TooLate(error.to_string()));
        }
        std::thread::sleep(TICK);
    }
    host.progress(0.0, &error.to_string());
    Ok(())
}

/// Asks a bridge whether it could scan so, and how long that takes, seconds.
pub(crate) fn ask(address: &str, request: &Request, settings: &Settings) -> Result<Option<f64>> {
    let mut link = Link::connect(address)?;
    let hello = message::Hello { versions: [VERSION; 2], client: &request.client, role: "controller" };
    link.send(kind::HELLO, 0, &json(&hello))?;
    let started = Instant::now();
    while started.elapsed() < SILENCE {
        let Some(frame) = link.receive()? else { continue };
        if !frame.sound() {
            return Err(Error::Broken("the checksum of an answer is wrong".to_owned()));
        }
        match frame.kind {
            kind::CAPABILITIES => {
                check_scanner(&parse(&frame)?, request.serial.as_deref())?;
                link.send(kind::CONFIGURE, 0, &json(settings))?;
            }
            kind::CONFIGURED => return Ok(parse::<message::Configured>(&frame)?.duration_s),
            kind::ERROR => return Err(refused(parse(&frame)?)),
            _ => {}
        }
    }
    Err(Error::Broken(format!("no answer in {} s", SILENCE.as_secs())))
}
