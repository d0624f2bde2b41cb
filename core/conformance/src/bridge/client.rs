//! Client connection to a bridge: sends and receives frames (sections 1 and 2 of the protocol).
//!
//! Every received frame is checked.

use std::io::{ErrorKind, Read as _, Write as _};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use serde_json::{Value as Json, json};

use super::BridgeSubject;
use crate::Verdict;

pub(super) const HELLO: u16 = 0x8001;
pub(super) const CAPABILITIES: u16 = 0x8002;
pub(super) const CONFIGURE: u16 = 0x8003;
pub(super) const CONFIGURED: u16 = 0x8004;
pub(super) const START: u16 = 0x8005;
pub(super) const ABORT: u16 = 0x8006;
pub(super) const RESUME: u16 = 0x8007;
pub(super) const HEARTBEAT: u16 = 0x0008;
pub(super) const STATUS: u16 = 0x0009;
pub(super) const ERROR: u16 = 0x800A;
pub(super) const SCAN_BEGIN: u16 = 0x8010;
pub(super) const COLUMN: u16 = 0x8011;
pub(super) const SCAN_END: u16 = 0x8012;

/// Name of the client: the same in each run, so that the lease of an earlier run does not prevent a connection.
pub(super) const CLIENT: &str = "platen bridge check";
/// Bit of a frame type that a receiver must support.
const CRITICAL: u16 = 0x8000;
const HEADER: usize = 32;
const LARGEST: usize = 1 << 20;
/// Time for an answer that needs no scanner. The protocol sets none; the driver closes the connection after 4 s without
/// a frame.
pub(super) const ANSWER: Duration = Duration::from_secs(4);
/// Time within which a bridge closes a connection that it must close.
const CLOSING: Duration = Duration::from_secs(4);

/// Returns a failure with this sentence.
pub(super) fn fault<T>(what: impl Into<String>) -> Result<T, Verdict> {
    Err(Verdict::Failed(what.into()))
}

/// Received frame with a correct checksum.
#[derive(Debug, Clone)]
pub(super) struct Frame {
    pub(super) kind: u16,
    pub(super) scan: u32,
    pub(super) payload: Vec<u8>,
    pub(super) crc: u32,
}

impl Frame {
    /// Parses a JSON payload.
    pub(super) fn json(&self) -> Result<Json, Verdict> {
        match serde_json::from_slice(&self.payload) {
            Ok(object @ Json::Object(_)) => Ok(object),
            _ => fault(format!("the payload of {} is no JSON object", name(self.kind))),
        }
    }
}

/// Returns the name of a frame's type.
pub(super) fn name(kind: u16) -> String {
    let name = match kind {
        CAPABILITIES => "Capabilities",
        CONFIGURED => "Configured",
        STATUS => "Status",
        ERROR => "Error",
        SCAN_BEGIN => "ScanBegin",
        COLUMN => "Column",
        SCAN_END => "ScanEnd",
        _ => return format!("a frame of type {kind:#06x}"),
    };
    name.to_owned()
}

/// Encodes a frame.
pub(super) fn encode(kind: u16, scan: u32, sequence: u64, payload: &[u8]) -> Vec<u8> {
    let mut head = [0; HEADER];
    head[..4].copy_from_slice(b"PSB1");
    head[4] = 1;
    head[6..8].copy_from_slice(&kind.to_le_bytes());
    head[8..12].copy_from_slice(&(payload.len() as u32).to_le_bytes());
    head[16..24].copy_from_slice(&sequence.to_le_bytes());
    head[24..28].copy_from_slice(&scan.to_le_bytes());
    seal(&mut head);
    [&head[..], payload, &crc32c::crc32c(payload).to_le_bytes()].concat()
}

/// Writes the checksum of a header.
pub(super) fn seal(head: &mut [u8]) {
    let crc = crc32c::crc32c_append(crc32c::crc32c(&head[..12]), &head[16..HEADER]);
    head[12..16].copy_from_slice(&crc.to_le_bytes());
}

/// A connection to the bridge.
pub(super) struct Client {
    stream: TcpStream,
    sent: u64,
    received: u64,
    spoke: Instant,
    /// Time of the last Status frame, and the longest time between two, both from Capabilities on.
    status: Option<Instant>,
    pub(super) longest_silence: Duration,
}

impl Client {
    /// Connects without sending anything.
    pub(super) fn connect(subject: &BridgeSubject) -> Result<Self, Verdict> {
        let stream = TcpStream::connect_timeout(&subject.address, ANSWER);
        let stream = stream.or_else(|why| fault(format!("no connection: {why}")))?;
        let _ = stream.set_nodelay(true);
        let now = Instant::now();
        Ok(Self { stream, sent: 0, received: 0, spoke: now, status: None, longest_silence: Duration::ZERO })
    }

    /// Connects as the controller of this run, or as another client.
    pub(super) fn hello(subject: &BridgeSubject, client: &str, role: &str) -> Result<Self, Verdict> {
        let mut this = Self::connect(subject)?;
        this.say_hello(client, role)?;
        this.expect(CAPABILITIES, ANSWER)?;
        this.status = Some(Instant::now());
        Ok(this)
    }

    /// Connects as the controller of this run.
    pub(super) fn controller(subject: &BridgeSubject) -> Result<Self, Verdict> {
        Self::hello(subject, CLIENT, "controller")
    }

    pub(super) fn say_hello(&mut self, client: &str, role: &str) -> Result<(), Verdict> {
        self.send(HELLO, 0, &json!({"versions": [[1, 0], [1, 0]], "client": client, "role": role}))
    }

    pub(super) fn send(&mut self, kind: u16, scan: u32, message: &Json) -> Result<(), Verdict> {
        self.send_payload(kind, scan, message.to_string().as_bytes())
    }

    pub(super) fn send_payload(&mut self, kind: u16, scan: u32, payload: &[u8]) -> Result<(), Verdict> {
        let bytes = encode(kind, scan, self.sent, payload);
        self.sent += 1;
        self.send_raw(&bytes)
    }

    /// Sends bytes unchanged.
    pub(super) fn send_raw(&mut self, bytes: &[u8]) -> Result<(), Verdict> {
        self.spoke = Instant::now();
        let _ = self.stream.set_write_timeout(Some(ANSWER));
        self.stream.write_all(bytes).or_else(|why| fault(format!("the connection cannot be written: {why}")))
    }

    /// Returns the number of the next frame.
    pub(super) fn sequence(&self) -> u64 {
        self.sent
    }

    /// Returns the next frame other than Status; `None` if none arrives in time or the bridge closed the connection.
    /// Sends heartbeats.
    pub(super) fn next(&mut self, limit: Duration) -> Result<Option<Frame>, Verdict> {
        let until = Instant::now() + limit;
        loop {
            let Some(frame) = self.read(until)? else { return Ok(None) };
            match frame.kind {
                STATUS => {}
                kind if kind & CRITICAL != 0 => return Ok(Some(frame)),
                // Frame of a later version, to be skipped.
                _ => continue,
            }
            let status = frame.json()?;
            if !(status["state"].is_string() && status["time_ns"].is_u64()) {
                return fault(format!("a Status without state and time_ns: {status}"));
            }
            let Some(last) = self.status.replace(Instant::now()) else {
                return fault("Status before Capabilities");
            };
            self.longest_silence = self.longest_silence.max(last.elapsed());
        }
    }

    /// Returns the next frame, which must be of this type.
    pub(super) fn expect(&mut self, kind: u16, limit: Duration) -> Result<Frame, Verdict> {
        match self.next(limit)? {
            Some(frame) if frame.kind == kind => Ok(frame),
            Some(frame) if frame.kind == ERROR => {
                let error = frame.json()?;
                fault(format!("{} expected, Error {}: {} came", name(kind), error["code"], error["text"]))
            }
            Some(frame) => fault(format!("{} expected, {} came", name(kind), name(frame.kind))),
            None => fault(format!("no {} within {} s", name(kind), limit.as_secs())),
        }
    }

    /// Checks that the bridge answers with an Error of this code.
    pub(super) fn expect_error(&mut self, code: &str) -> Result<Json, Verdict> {
        match self.next(ANSWER)? {
            Some(frame) if frame.kind == ERROR => {
                let error = frame.json()?;
                if error["code"] == code && error["text"].is_string() {
                    return Ok(error);
                }
                fault(format!("Error `{code}` with a text expected, {error} came"))
            }
            Some(frame) => fault(format!("Error `{code}` expected, {} came", name(frame.kind))),
            None => fault(format!("no Error `{code}` within {} s", ANSWER.as_secs())),
        }
    }

    /// Checks that the bridge closes the connection; frames that it sends before are ignored.
    pub(super) fn expect_close(mut self) -> Result<(), Verdict> {
        let until = Instant::now() + CLOSING;
        let mut bytes = [0; 4096];
        while let Some(left) = until.checked_duration_since(Instant::now()).filter(|left| !left.is_zero()) {
            let _ = self.stream.set_read_timeout(Some(left));
            match self.stream.read(&mut bytes) {
                Ok(0) => return Ok(()),
                Ok(_) => {}
                Err(why) if is_timeout(&why) => {}
                Err(_) => return Ok(()),
            }
        }
        fault(format!("the connection is open {} s later", CLOSING.as_secs()))
    }

    /// Reads a frame and checks it; `None` at the end of the time or of the connection.
    fn read(&mut self, until: Instant) -> Result<Option<Frame>, Verdict> {
        let mut head = [0; HEADER];
        if !self.fill(&mut head, until)? {
            return Ok(None);
        }
        let word = |at: usize| u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
        let mut sealed = head;
        seal(&mut sealed);
        let (kind, length) = (u16::from_le_bytes([head[6], head[7]]), word(8) as usize);
        let sequence = u64::from(word(16)) | u64::from(word(20)) << 32;
        if &head[..4] != b"PSB1" || head[4] != 1 {
            return fault(format!("a frame begins with {:02x?}, not with PSB1 and version 1", &head[..6]));
        } else if sealed != head {
            return fault(format!("the header of {} has a wrong checksum", name(kind)));
        } else if length > LARGEST {
            return fault(format!("{} announces {length} bytes, at most 1 MiB is allowed", name(kind)));
        } else if sequence != self.received {
            return fault(format!("frame number {sequence} came, {} was due", self.received));
        } else if word(28) != 0 {
            return fault(format!("the flags of {} are not 0", name(kind)));
        }
        self.received += 1;
        let mut rest = vec![0; length + 4];
        if !self.fill(&mut rest, until.max(Instant::now() + ANSWER))? {
            return fault(format!("the connection ended in the middle of {}", name(kind)));
        }
        let payload = rest[..length].to_vec();
        let crc = crc32c::crc32c(&payload);
        if rest[length..] != crc.to_le_bytes() {
            return fault(format!("the payload of {} has a wrong checksum", name(kind)));
        }
        Ok(Some(Frame { kind, scan: word(24), payload, crc }))
    }

    /// Fills a buffer and sends heartbeats meanwhile; returns false if no byte arrived.
    fn fill(&mut self, buffer: &mut [u8], until: Instant) -> Result<bool, Verdict> {
        let mut held = 0;
        while held < buffer.len() {
            let now = Instant::now();
            if now >= until {
                return if held == 0 { Ok(false) } else { fault("a frame came in part only") };
            }
            if self.spoke.elapsed() > Duration::from_millis(900) && self.status.is_some() {
                self.send_payload(HEARTBEAT, 0, b"")?;
            }
            let wait = (until - now).min(Duration::from_millis(200)).max(Duration::from_millis(1));
            let _ = self.stream.set_read_timeout(Some(wait));
            match self.stream.read(&mut buffer[held..]) {
                Ok(0) if held == 0 => return Ok(false),
                Ok(0) => return fault("the connection ended in the middle of a frame"),
                Ok(n) => held += n,
                Err(why) if is_timeout(&why) || why.kind() == ErrorKind::Interrupted => {}
                Err(why) if why.kind() == ErrorKind::ConnectionReset && held == 0 => return Ok(false),
                Err(why) => return fault(format!("the connection cannot be read: {why}")),
            }
        }
        Ok(true)
    }
}

fn is_timeout(why: &std::io::Error) -> bool {
    matches!(why.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut)
}
