//! Connections to the bridge over TCP with their time limits; the session continues across lost connections.

use std::io::{ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

use platen_sdk::{Health, ScanReceiver};

use crate::error::{Error, Result};
use crate::message::{self, Settings};
use crate::session::{Action, Request, Session, check_scanner, json, parse, refused};
use crate::wire::{Decoder, Frame, VERSION, encode, kind};

/// Longest wait for a byte between two checks of deadline, cancellation and heartbeat.
const TICK: Duration = Duration::from_millis(20);
/// Longest interval between two frames sent.
const HEARTBEAT: Duration = Duration::from_secs(1);
/// Silence after which a connection counts as broken; the bridge sends Status every second.
const SILENCE: Duration = Duration::from_secs(4);
/// Time limit of connecting.
const CONNECT: Duration = Duration::from_secs(2);
/// First and longest wait between two connections (exponential back-off).
const BACK_OFF: (Duration, Duration) = (Duration::from_millis(100), Duration::from_secs(5));
/// Time before the deadline reserved for reporting the reason of a missing scan.
const REPORT_TIME: Duration = Duration::from_millis(100);

/// Connection to a bridge.
struct Link {
    stream: TcpStream,
    decoder: Decoder,
    sequence: u64,
    last_received: Instant,
    last_sent: Instant,
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
                        last_received: now,
                        last_sent: now,
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
        self.last_sent = Instant::now();
        self.stream.write_all(&bytes).map_err(|error| Error::Broken(error.to_string()))
    }

    /// Returns the next frame, `None` after a tick without one.
    fn receive(&mut self) -> Result<Option<Frame>> {
        if let Some(frame) = self.decoder.next()? {
            return Ok(Some(frame));
        }
        let mut bytes = [0; 1 << 16];
        match self.stream.read(&mut bytes) {
            Ok(0) => return Err(Error::Broken("closed by the bridge".to_owned())),
            Ok(n) => {
                self.last_received = Instant::now();
                self.decoder.push(&bytes[..n]);
            }
            Err(error)
                if matches!(
                    error.kind(),
                    ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
                ) => {}
            Err(error) => return Err(Error::Broken(error.to_string())),
        }
        if self.last_received.elapsed() > SILENCE {
            return Err(Error::Broken(format!("no frame from the bridge for {} s", SILENCE.as_secs())));
        }
        if self.last_sent.elapsed() > HEARTBEAT {
            self.send(kind::HEARTBEAT, 0, &[])?;
        }
        self.decoder.next()
    }
}

/// Scans through the bridge at `address`, and delivers columns to the host as they arrive. Returns the outcome and the
/// last reported state of the instrument.
pub(crate) fn scan(
    address: &str,
    request: Request,
    host: &mut impl ScanReceiver,
) -> (Option<Health>, Result<()>) {
    let mut session = Session::new(request);
    let ended = attempts(address, &mut session, host);
    (session.health(), ended)
}

/// Connects repeatedly until the scan is complete or can no longer be completed.
fn attempts(address: &str, session: &mut Session, host: &mut impl ScanReceiver) -> Result<()> {
    let mut wait = BACK_OFF.0;
    loop {
        let started = Instant::now();
        let error = match connection(address, session, host) {
            Ok(()) => return Ok(()),
            Err(error @ (Error::Broken(_) | Error::Busy { .. })) => error,
            Err(error) => return Err(error),
        };
        // The back-off restarts after a connection that lasted for some time.
        wait = if started.elapsed() > SILENCE { BACK_OFF.0 } else { (wait * 2).min(BACK_OFF.1) };
        let pause = match &error {
            Error::Busy { retry_ms, .. } => Duration::from_millis(*retry_ms).min(BACK_OFF.1),
            _ => wait,
        };
        pause_for(pause, host, &error)?;
    }
}

/// Runs one connection until the scan is complete or the connection fails.
fn connection(address: &str, session: &mut Session, host: &mut impl ScanReceiver) -> Result<()> {
    let mut link = Link::connect(address)?;
    session.connected();
    loop {
        while let Some(action) = session.action() {
            match action {
                Action::Send(kind, scan, payload) => link.send(kind, scan, &payload)?,
                Action::Progress(fraction, phase) => host.progress(fraction, &phase),
                Action::Begin(header) => host.begin(&header)?,
                Action::Column(column) => host.column(&column)?,
                Action::End(end) => return Ok(host.end(&end)?),
            }
        }
        if let Err(cancelled) = host.check() {
            if let Action::Send(kind, scan, payload) = session.abort() {
                // The job ends even when Abort is not delivered: the lease expires by itself.
                let _ = link.send(kind, scan, &payload);
            }
            return Err(cancelled.into());
        }
        if host.remaining() < REPORT_TIME {
            return Err(Error::TooLate("the scan was still running".to_owned()));
        }
        if let Some(frame) = link.receive()? {
            session.frame(&frame)?;
        }
    }
}

fn pause_for(pause: Duration, host: &impl ScanReceiver, error: &Error) -> Result<()> {
    let started = Instant::now();
    while started.elapsed() < pause {
        host.check()?;
        if host.remaining() < REPORT_TIME {
            return Err(Error::TooLate(error.to_string()));
        }
        std::thread::sleep(TICK);
    }
    host.progress(0.0, &error.to_string());
    Ok(())
}

/// Queries a bridge whether the settings are possible; returns the duration of the scan in seconds. `health` receives
/// the state of the instrument if the bridge reports it meanwhile.
pub(crate) fn ask(
    address: &str,
    request: &Request,
    settings: &Settings,
    health: &mut Option<Health>,
) -> Result<Option<f64>> {
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
            kind::STATUS => *health = Some(parse::<message::Status>(&frame)?.health()),
            _ => {}
        }
    }
    Err(Error::Broken(format!("no answer in {} s", SILENCE.as_secs())))
}
