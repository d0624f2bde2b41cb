//! Connection to one driver.
//!
//! One thread reads, another sends, so that Heartbeat and Abort take effect however many columns wait to be sent.

use std::collections::VecDeque;
use std::io::Write;
use std::net::{Shutdown, TcpStream};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::json;

use super::counters::increment;
use super::event::Event;
use super::fault::FaultKind;
use super::frame::{self, Frame, FrameError};
use super::frame_faults::Step;
use super::message::{
    Abort, Exception, Hello, Refusal, Resume, Role, ScanBegin, ScanEnd, ScanSettings, Start, Status,
};
use super::shared::{Scan, Shared};

/// Interval of Status frames.
const STATUS: Duration = Duration::from_millis(900);

/// Columns sent between two checks for incoming frames.
const ROUND: usize = 16;

/// End of the connection.
struct Hangup;

type Flow = Result<(), Hangup>;

/// Progress of sending a scan.
struct Sending {
    scan: Arc<Scan>,
    /// Columns still to be sent, by number; `None` until the lattice is known.
    requested: Option<Vec<bool>>,
    missing: Option<Vec<[u32; 2]>>,
    /// Number of columns examined, in the order of measurement.
    examined: usize,
    /// Columns to send next.
    next: VecDeque<u32>,
}

struct Connection<'a> {
    shared: &'a Arc<Shared>,
    number: u32,
    stream: TcpStream,
    sequence: u64,
    client: Option<(String, Role)>,
    sending: Option<Sending>,
    columns_sent: u32,
    events: Sender<Event>,
}

/// Serves a driver until one side closes the connection.
pub(super) fn serve(stream: TcpStream, number: u32, shared: &Arc<Shared>) {
    let (events, incoming) = channel();
    let Ok(reading) = stream.try_clone() else { return };
    let reader = {
        let (events, shared) = (events.clone(), Arc::clone(shared));
        std::thread::spawn(move || read(reading, number, &shared, &events))
    };
    let mut connection = Connection {
        shared,
        number,
        stream,
        sequence: 0,
        client: None,
        sending: None,
        columns_sent: 0,
        events,
    };
    // Small frames must not be delayed by Nagle's algorithm.
    let _ = connection.stream.set_nodelay(true);
    let Err(Hangup) = connection.run(&incoming);
    // The reader ends with the connection; an error means that it is closed already.
    let _ = connection.stream.shutdown(Shutdown::Both);
    let _ = reader.join();
}

/// Returns the Capabilities of a bridge.
pub(super) fn capabilities(shared: &Shared) -> serde_json::Value {
    let modes: Vec<_> = [1, 2, 4, 5, 8, 10, 16, 20, 32]
        .into_iter()
        .flat_map(|divisor| [122, 244, 488, 976].map(|rate_kpts| (divisor, rate_kpts)))
        .filter(|(divisor, rate_kpts)| crate::Device::new(*divisor, *rate_kpts, 1).is_ok())
        .map(|(divisor, rate_kpts)| json!({"divisor": divisor, "rate_kpts": rate_kpts}))
        .collect();
    let config = &shared.config;
    let serial = if shared.is_active(FaultKind::WrongScanner) { "SIM9999" } else { config.serial.as_str() };
    json!({
        "version": frame::VERSION, "model": "platen simulated scanner", "serial": serial,
        "firmware": env!("CARGO_PKG_VERSION"), "live": config.live, "modes": modes, "max_rows": 17351,
        "max_columns": 40960, "faces": 2, "kept_scans": config.kept_scans, "clock": "monotonic",
        "clock_synced": false,
    })
}

/// Reads frames until the connection ends. Renews the lease and executes Abort at once.
fn read(mut stream: TcpStream, connection: u32, shared: &Shared, events: &Sender<Event>) {
    for due in 0.. {
        let frame = match frame::read(&mut stream, due) {
            Ok(frame) => frame,
            Err(error) => {
                if !matches!(error, FrameError::Closed) {
                    tracing::warn!(connection, %error, "connection to the driver closed: invalid frame");
                }
                // An error means that the sending thread has ended.
                let _ = events.send(Event::Closed);
                return;
            }
        };
        shared.renew_lease(connection);
        if frame.kind == frame::ABORT
            && let Ok(abort) = serde_json::from_slice::<Abort>(&frame.payload)
        {
            shared.abort(&abort.job);
        }
        if events.send(Event::Frame(frame)).is_err() {
            return;
        }
    }
}

impl Connection<'_> {
    fn run(&mut self, incoming: &Receiver<Event>) -> Result<std::convert::Infallible, Hangup> {
        let mut status_due = Instant::now() + STATUS;
        loop {
            let wait = if self.can_send() { Duration::ZERO } else { status_due - Instant::now() };
            match incoming.recv_timeout(wait) {
                Ok(Event::Frame(frame)) => self.command(&frame)?,
                Ok(Event::Closed) | Err(RecvTimeoutError::Disconnected) => return Err(Hangup),
                Ok(Event::ScanAdvanced) | Err(RecvTimeoutError::Timeout) => {}
            }
            self.send_available()?;
            if Instant::now() >= status_due {
                if self.client.is_some() {
                    self.status()?;
                }
                status_due = Instant::now() + STATUS;
            }
        }
    }

    fn send_message(&mut self, kind: u16, scan: u32, message: &impl Serialize) -> Flow {
        let payload = serde_json::to_vec(message).map_err(|_| Hangup)?;
        self.send(Frame { kind, scan, payload })
    }

    fn refuse(&mut self, scan: u32, refusal: &Refusal) -> Flow {
        self.send_message(frame::ERROR, scan, refusal)
    }

    fn command(&mut self, frame: &Frame) -> Flow {
        let controls = matches!(self.client, Some((_, Role::Controller)));
        match (frame.kind, &self.client) {
            (frame::HELLO, None) => self.hello(frame),
            (frame::HEARTBEAT, _) => Ok(()),
            (kind, Some(_)) if kind & frame::CRITICAL == 0 => Ok(()),
            (frame::CONFIGURE | frame::START | frame::RESUME | frame::ABORT, Some(_)) if !controls => {
                self.refuse(0, &Refusal::new("denied", "a monitor may not send commands"))
            }
            (frame::CONFIGURE, Some(_)) => self.configure(frame),
            (frame::START, Some(_)) => self.start(frame),
            (frame::RESUME, Some(_)) => self.resume(frame),
            // Executed by the reader already, unless it came before its Start was.
            (frame::ABORT, Some(_)) => {
                let abort: Abort = self.parse(frame)?;
                self.shared.abort(&abort.job);
                Ok(())
            }
            (kind, _) => {
                self.refuse(0, &Refusal::new("unknown_type", format!("{kind:#06x} is not allowed here")))?;
                Err(Hangup)
            }
        }
    }

    /// Parses the message in a frame; refuses an invalid one with the reason.
    fn parse<T: DeserializeOwned>(&mut self, frame: &Frame) -> Result<T, Hangup> {
        match serde_json::from_slice(&frame.payload) {
            Ok(message) => Ok(message),
            Err(error) => {
                self.refuse(frame.scan, &Refusal::new("config", format!("{:#06x}: {error}", frame.kind)))?;
                Err(Hangup)
            }
        }
    }

    fn hello(&mut self, frame: &Frame) -> Flow {
        let hello: Hello = self.parse(frame)?;
        let [lowest, highest] = hello.versions;
        if lowest > frame::VERSION || highest < frame::VERSION {
            self.refuse(0, &Refusal::new("version", "this bridge supports version 1.0"))?;
            return Err(Hangup);
        }
        if hello.role == Role::Controller
            && let Err(busy) = self.shared.lease(&hello.client, self.number)
        {
            self.refuse(0, &busy)?;
            return Err(Hangup);
        }
        let late = self.shared.frame_faults().once(FaultKind::ConnectLate, |_| true);
        if let Some(ms) = late {
            std::thread::sleep(Duration::from_millis(ms.into()));
        }
        self.client = Some((hello.client, hello.role));
        let capabilities = capabilities(self.shared);
        self.send_message(frame::CAPABILITIES, 0, &capabilities)
    }

    /// Plans a scan, with the faults that prevent or alter it.
    fn plan(&self, settings: ScanSettings) -> Result<super::head::Plan, Refusal> {
        if let Some(left) = self.shared.remaining_at_start(FaultKind::Asleep) {
            let text = "the scanner is starting up";
            return Err(Refusal::new("scanner", text).retry(left.as_millis() as u64 + 1));
        }
        if self.shared.is_active(FaultKind::SdkMissing) {
            return Err(Refusal::new("scanner", "the scanner's library is not registered on this computer"));
        }
        let (settings, notes) = altered(self.shared, settings);
        let mut plan = self.shared.head.plan(&settings).map_err(|why| Refusal::new("config", why))?;
        plan.altered.splice(0..0, notes);
        Ok(plan)
    }

    fn configure(&mut self, frame: &Frame) -> Flow {
        let settings = self.parse(frame)?;
        match self.plan(settings) {
            Ok(plan) => {
                let s = plan.settings;
                let duration_s = (self.shared.config.time_scale * plan.duration_s).max(plan.computing_s);
                self.send_message(frame::CONFIGURED, 0, &json!({
                    "divisor": s.divisor, "rate_kpts": s.rate_kpts, "compression": s.compression, "window": s.window,
                    "duration_s": duration_s, "altered": plan.altered,
                }))
            }
            Err(refusal) => self.refuse(0, &refusal),
        }
    }

    fn start(&mut self, frame: &Frame) -> Flow {
        increment(&self.shared.counts.starts);
        let start: Start = self.parse(frame)?;
        let card_missing = self.shared.is_active(FaultKind::CardMissing);
        let scan = match self.plan(start.settings) {
            Ok(_) if card_missing => Err(Refusal::new("scanner", "there is no card in the scanner")),
            Ok(plan) => self.shared.begin(&start.job, plan),
            Err(refusal) => Err(refusal),
        };
        match scan {
            Ok(scan) => {
                let lost = self.shared.frame_faults().once(FaultKind::ReplyLost, |_| true);
                if lost.is_some() {
                    self.shared.connection_cut(false);
                    return Err(Hangup);
                }
                self.sending_of(scan, None);
                Ok(())
            }
            Err(refusal) => self.refuse(0, &refusal),
        }
    }

    fn resume(&mut self, frame: &Frame) -> Flow {
        increment(&self.shared.counts.resumes);
        let resume: Resume = self.parse(frame)?;
        match self.shared.scan_of(&resume.job).filter(|scan| scan.spool.number == frame.scan) {
            Some(scan) => {
                self.sending_of(scan, Some(resume.missing));
                Ok(())
            }
            None => {
                let text = format!("scan {} of job {} is not kept here", frame.scan, resume.job);
                self.refuse(frame.scan, &Refusal::new("gone", text))
            }
        }
    }

    fn sending_of(&mut self, scan: Arc<Scan>, missing: Option<Vec<[u32; 2]>>) {
        scan.spool.listen(self.events.clone());
        let next = VecDeque::new();
        self.sending = Some(Sending { scan, requested: None, missing, examined: 0, next });
    }

    /// Returns true when a frame of the scan can be sent at once.
    fn can_send(&self) -> bool {
        let Some(sending) = &self.sending else { return false };
        let spool = &sending.scan.spool;
        match sending.requested {
            None => spool.begun().is_some() || spool.is_over(),
            Some(_) => spool.arrival(sending.examined).is_some() || spool.is_over(),
        }
    }

    /// Sends the available frames of the requested scan.
    fn send_available(&mut self) -> Flow {
        let Some(mut sending) = self.sending.take() else { return Ok(()) };
        let scan = Arc::clone(&sending.scan);
        let (spool, number) = (&scan.spool, scan.spool.number);
        if let Some(why) = spool.refused() {
            return self.refuse(number, &Refusal::new("scanner", why));
        }
        if sending.requested.is_none() {
            let Some(begin) = spool.begun() else {
                self.sending = Some(sending);
                return Ok(());
            };
            sending.requested = Some(requested_columns(begin.columns, sending.missing.as_deref()));
            self.send_message(frame::SCAN_BEGIN, number, &ScanBegin { job: spool.job.clone(), begin })?;
        }
        // Read before the columns, so that no column before the end is missed.
        let ended = spool.ended();
        if sending.collect(&mut |end| self.shared.frame_faults().below(end), self.within()) {
            for column in sending.next.drain(..) {
                self.column(number, spool.payload(column).map_err(|_| Hangup)?)?;
            }
        }
        match ended.filter(|_| spool.arrival(sending.examined).is_none()) {
            Some(_) if scan.overflowed() => {
                self.refuse(number, &Refusal::new("overflow", "the bridge's disk is full; make room on it"))
            }
            Some(end) => self.end(number, end),
            None => {
                self.sending = Some(sending);
                Ok(())
            }
        }
    }

    /// Returns the number of columns within which the order is shuffled.
    fn within(&self) -> usize {
        self.shared.frame_faults().persistent(FaultKind::Shuffled).map_or(1, |n| n.max(1) as usize)
    }

    fn column(&mut self, scan: u32, payload: Vec<u8>) -> Flow {
        self.send(Frame { kind: frame::COLUMN, scan, payload })?;
        self.columns_sent += 1;
        increment(&self.shared.counts.columns_sent);
        Ok(())
    }

    fn end(&mut self, scan: u32, mut end: ScanEnd) -> Flow {
        if self.shared.is_active(FaultKind::WrongDigest) {
            end.digest ^= 1;
        }
        self.send_message(frame::SCAN_END, scan, &end)
    }

    /// Sends a frame through the fault injection.
    fn send(&mut self, frame: Frame) -> Flow {
        let steps = self.shared.frame_faults().apply(frame, self.columns_sent);
        for step in steps {
            match step {
                Step::Send(frame) => self.write(&frame, None)?,
                Step::SendCorrupted(frame, bit) => self.write(&frame, Some(bit))?,
                Step::Header(length, bit) => {
                    let mut head = frame::header(frame::COLUMN, 0, self.sequence, length, frame::VERSION[0]);
                    if let Some(bit) = bit {
                        head[bit / 8] ^= 1 << (bit % 8);
                    }
                    self.stream.write_all(&head).map_err(|_| Hangup)?;
                    increment(&self.shared.counts.cuts);
                    return Err(Hangup);
                }
                Step::Wait(long) => std::thread::sleep(long),
                Step::Cut | Step::Die => {
                    self.shared.connection_cut(step == Step::Die);
                    return Err(Hangup);
                }
            }
        }
        Ok(())
    }

    fn write(&mut self, frame: &Frame, corrupted: Option<usize>) -> Flow {
        let mut bytes = frame::bytes(frame, self.sequence);
        if self.shared.is_active(FaultKind::VersionMismatch) {
            let head = frame::header(frame.kind, frame.scan, self.sequence, frame.payload.len() as u32, 2);
            bytes[..frame::HEADER].copy_from_slice(&head);
        }
        if let Some(bit) = corrupted {
            bytes[frame::HEADER + bit / 8] ^= 1 << (bit % 8);
        }
        self.sequence += 1;
        self.stream.write_all(&bytes).map_err(|_| Hangup)
    }

    fn status(&mut self) -> Flow {
        let status = status(self.shared);
        self.send_message(frame::STATUS, 0, &status)
    }
}

impl Sending {
    /// Moves the next requested columns to `next`, shuffled among `within`; returns false when there are none.
    fn collect(&mut self, below: &mut dyn FnMut(u32) -> u32, within: usize) -> bool {
        let Some(requested) = &mut self.requested else { return false };
        while self.next.len() < ROUND.max(within) {
            let Some(column) = self.scan.spool.arrival(self.examined) else { break };
            self.examined += 1;
            if std::mem::take(&mut requested[column as usize]) {
                self.next.push_back(column);
            }
        }
        if within > 1 {
            for last in (1..self.next.len()).rev() {
                self.next.swap(last, below(last as u32 + 1) as usize);
            }
        }
        !self.next.is_empty()
    }
}

/// Returns which columns are to be sent, by number.
fn requested_columns(columns: u32, missing: Option<&[[u32; 2]]>) -> Vec<bool> {
    let Some(missing) = missing else { return vec![true; columns as usize] };
    let asked = |column: u32| missing.iter().any(|[first, last]| (*first..=*last).contains(&column));
    (0..columns).map(asked).collect()
}

/// Builds a Status message.
fn status(shared: &Shared) -> Status {
    let is_active = |kind| shared.is_active(kind);
    let running = shared.running();
    let (state, progress) = match &running {
        _ if is_active(FaultKind::StaleStatus) => ("ready", 1.0),
        _ if shared.remaining_at_start(FaultKind::Asleep).is_some() => ("connecting", 0.0),
        None => ("ready", 0.0),
        Some(_) if is_active(FaultKind::ProgressJump) => ("scanning", 0.0),
        Some(scan) if !scan.spool.has_begun() || scan.spool.progress() == 0.0 => ("starting", 0.0),
        Some(scan) if scan.spool.progress() < 1.0 => ("scanning", scan.spool.progress()),
        Some(_) => ("finishing", 1.0),
    };
    let mut exceptions = Vec::new();
    let mut except = |level: u8, text: String| exceptions.push(Exception { level, text });
    if let Some(stalls @ 1..) = running.filter(|scan| !scan.spool.has_begun()).map(|scan| scan.stalls()) {
        except(3, format!("the mirror is not up to speed, try {stalls} of 5"));
    }
    if is_active(FaultKind::BatteryLow) {
        except(3, "the battery is at 4 %".to_owned());
    }
    if is_active(FaultKind::Temperature) {
        except(3, "the temperature is 46 degrees C, at most 40 are permitted".to_owned());
    }
    if is_active(FaultKind::Contamination) {
        except(3, "the mirror is contaminated; clean it".to_owned());
    }
    Status {
        state,
        progress,
        temperature_c: Some(if is_active(FaultKind::Temperature) { 46.0 } else { 31.5 }),
        battery: Some(if is_active(FaultKind::BatteryLow) { 0.04 } else { 0.8 }),
        tilt_deg: 0.02,
        dirty: is_active(FaultKind::Contamination),
        exceptions,
        time_ns: shared.begun.elapsed().as_nanos() as u64,
        synced: false,
    }
}

/// Applies the fault `params-altered` to the requested settings; returns them with a note.
fn altered(shared: &Shared, settings: ScanSettings) -> (ScanSettings, Vec<String>) {
    if !shared.is_active(FaultKind::ParamsAltered) || settings.rate_kpts <= 122 {
        return (settings, Vec::new());
    }
    let note = format!(
        "rate_kpts: {} was requested, the scanner set {}",
        settings.rate_kpts,
        settings.rate_kpts / 2
    );
    (ScanSettings { rate_kpts: settings.rate_kpts / 2, ..settings }, vec![note])
}
