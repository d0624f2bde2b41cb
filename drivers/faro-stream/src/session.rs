//! Session: the state machine of the protocol for one scan.
//!
//! It is a pure function of received frames, without socket or clock.
//!
//! ```text
//! connected -> Hello; Capabilities -> Start, or Resume when the scan is known; ScanBegin; Columns;
//! ScanEnd -> done, or Resume for the missing columns
//! ```
//! No data is lost with a broken connection: the next connection continues the scan. Each column is delivered once,
//! even if frames are repeated, late, out of order or damaged. The end is delivered when every column has arrived and
//! the digest agrees.

use std::collections::VecDeque;

use platen_scan::{Column, Outcome, ScanEnd, ScanHeader, State};
use platen_sdk::Health;

use crate::column::Layout;
use crate::error::{Error, Result};
use crate::message::{self, Settings};
use crate::wire::{Frame, VERSION, kind};

/// Number of consecutive Resume requests without progress after which the scan fails.
const MAX_FRUITLESS_RESUMES: u32 = 3;

/// Action to be executed by the connection.
#[derive(Debug, PartialEq)]
pub(crate) enum Action {
    /// Sends a frame: type, scan, payload.
    Send(u16, u32, Vec<u8>),
    /// Reports the scanner's progress to the host.
    Progress(f64, String),
    /// Delivers the header.
    Begin(Box<ScanHeader>),
    /// Delivers a column.
    Column(Box<Column>),
    /// Delivers the end; the session is over.
    End(ScanEnd),
}

/// Request for a scan.
#[derive(Debug, Clone)]
pub(crate) struct Request {
    pub(crate) client: String,
    pub(crate) job: String,
    pub(crate) settings: Settings,
    /// Required serial number of the scanner.
    pub(crate) serial: Option<String>,
}

/// Received part of the scan.
#[derive(Debug)]
struct Scan {
    number: u32,
    layout: Layout,
    /// Payload checksum of every received column, by its number at the bridge.
    columns: Vec<Option<u32>>,
    /// Records received.
    points: u64,
    /// Cells delivered as valid.
    delivered: u64,
    /// Columns missing at the previous ScanEnd.
    missed: usize,
    fruitless: u32,
}

/// Session of one scan.
#[derive(Debug)]
pub(crate) struct Session {
    request: Request,
    greeted: bool,
    scanner: String,
    scan: Option<Scan>,
    /// State of the instrument in the newest Status.
    health: Option<Health>,
    actions: VecDeque<Action>,
}

impl Session {
    /// Creates a session before its first connection.
    pub(crate) fn new(request: Request) -> Self {
        let (scanner, actions) = (String::new(), VecDeque::new());
        Self { request, greeted: false, scanner, scan: None, health: None, actions }
    }

    /// Returns the last reported state of the instrument.
    pub(crate) fn health(&self) -> Option<Health> {
        self.health
    }

    /// Returns the next action.
    pub(crate) fn action(&mut self) -> Option<Action> {
        self.actions.pop_front()
    }

    /// Starts a connection, the first or a later one.
    pub(crate) fn connected(&mut self) {
        self.greeted = false;
        // Frames queued for the previous connection are discarded.
        self.actions.retain(|action| !matches!(action, Action::Send(..)));
        let hello =
            message::Hello { versions: [VERSION; 2], client: &self.request.client, role: "controller" };
        self.actions.push_back(Action::Send(kind::HELLO, 0, json(&hello)));
    }

    /// Returns the frame that aborts the scan at the bridge.
    pub(crate) fn abort(&self) -> Action {
        let number = self.scan.as_ref().map_or(0, |scan| scan.number);
        Action::Send(kind::ABORT, number, json(&message::Abort { job: &self.request.job }))
    }

    /// Processes a received frame.
    ///
    /// # Errors
    /// [`Error::Broken`] and [`Error::Busy`] when reconnecting may help; all others end the scan.
    pub(crate) fn frame(&mut self, frame: &Frame) -> Result<()> {
        if frame.kind == kind::COLUMN {
            return self.column(frame);
        }
        if !frame.sound() {
            return Err(Error::Broken(format!(
                "the checksum of a frame of type {:#06x} is wrong",
                frame.kind
            )));
        }
        match frame.kind {
            kind::CAPABILITIES => self.capabilities(&parse(frame)?),
            kind::STATUS => {
                self.status(parse(frame)?);
                Ok(())
            }
            kind::ERROR => Err(refused(parse(frame)?)),
            kind::SCAN_BEGIN => self.scan_begin(frame.scan, parse(frame)?),
            kind::SCAN_END => self.scan_end(frame.scan, &parse(frame)?),
            other if other & kind::CRITICAL == 0 => Ok(()),
            other => {
                Err(Error::Bridge(format!("critical frames of type {other:#06x}, unknown to version 1.0")))
            }
        }
    }

    fn capabilities(&mut self, found: &message::Capabilities) -> Result<()> {
        check_scanner(found, self.request.serial.as_deref())?;
        if std::mem::replace(&mut self.greeted, true) {
            return Err(Error::Bridge("a second Capabilities frame".to_owned()));
        }
        self.scanner = format!("{} {}", found.model, found.serial).trim().to_owned();
        let next = match &self.scan {
            Some(scan) => self.resume(scan),
            None => {
                let start = message::Start { job: &self.request.job, settings: &self.request.settings };
                Action::Send(kind::START, 0, json(&start))
            }
        };
        self.actions.push_back(next);
        Ok(())
    }

    fn resume(&self, scan: &Scan) -> Action {
        let resume = message::Resume { job: &self.request.job, missing: scan.missing() };
        Action::Send(kind::RESUME, scan.number, json(&resume))
    }

    fn status(&mut self, status: message::Status) {
        self.health = Some(status.health());
        let worst = status.exceptions.into_iter().filter(|e| e.level <= 3).min_by_key(|e| e.level);
        let text = worst.map_or(status.state.clone(), |e| format!("{}: {}", status.state, e.text));
        self.actions.push_back(Action::Progress(status.progress.clamp(0.0, 1.0), text));
    }

    fn scan_begin(&mut self, number: u32, begin: message::ScanBegin) -> Result<()> {
        if begin.job != self.request.job {
            return Ok(()); // Late ScanBegin of another scan.
        }
        let layout = Layout::new(begin)?;
        match &self.scan {
            None => {
                self.actions.push_back(Action::Begin(Box::new(layout.header(&self.scanner))));
                let columns = vec![None; layout.begin().columns as usize];
                self.scan = Some(Scan {
                    number,
                    layout,
                    columns,
                    points: 0,
                    delivered: 0,
                    missed: usize::MAX,
                    fruitless: 0,
                });
                Ok(())
            }
            Some(scan) if scan.number == number && scan.layout == layout => Ok(()),
            Some(scan) => {
                let before = scan.number;
                Err(Error::Bridge(format!("scan {number} started for the job of scan {before}")))
            }
        }
    }

    fn column(&mut self, frame: &Frame) -> Result<()> {
        let Some(scan) = self.scan.as_mut().filter(|scan| scan.number == frame.scan) else {
            return Ok(()); // Late frame of another scan.
        };
        if !frame.sound() {
            return Ok(()); // Remains missing, and is requested after ScanEnd.
        }
        let (number, mut column) = scan.layout.column(&frame.payload)?;
        match &mut scan.columns[number as usize] {
            Some(before) if *before == frame.crc => Ok(()),
            Some(_) => Err(Error::Bridge(format!("column {number} received twice with different content"))),
            slot => {
                *slot = Some(frame.crc);
                scan.points += valid(&column);
                scan.layout.invalidate_warm_up(number, &mut column);
                scan.delivered += valid(&column);
                self.actions.push_back(Action::Column(Box::new(column)));
                Ok(())
            }
        }
    }

    fn scan_end(&mut self, number: u32, end: &message::ScanEnd) -> Result<()> {
        let Some(scan) = self.scan.as_mut().filter(|scan| scan.number == number) else { return Ok(()) };
        if end.outcome != "complete" {
            let (outcome, reason) = (end.outcome.clone(), end.reason.clone());
            return Err(Error::Ended { outcome, reason });
        }
        let missing = scan.columns.iter().filter(|column| column.is_none()).count();
        if missing == 0 {
            let end = scan.close(end)?;
            self.actions.push_back(Action::End(end));
            return Ok(());
        }
        scan.fruitless = if missing < scan.missed { 0 } else { scan.fruitless + 1 };
        scan.missed = missing;
        if scan.fruitless == MAX_FRUITLESS_RESUMES {
            return Err(Error::Bridge(format!(
                "{missing} columns missing after {MAX_FRUITLESS_RESUMES} requests"
            )));
        }
        let again = self.scan.as_ref().map(|scan| self.resume(scan));
        self.actions.extend(again);
        Ok(())
    }
}

impl Scan {
    /// Returns the runs of columns that have not arrived intact.
    fn missing(&self) -> Vec<(u32, u32)> {
        let mut runs: Vec<(u32, u32)> = Vec::new();
        for (number, _) in (0..).zip(&self.columns).filter(|(_, column)| column.is_none()) {
            match runs.last_mut() {
                Some((_, last)) if *last + 1 == number => *last = number,
                _ => runs.push((number, number)),
            }
        }
        runs
    }

    /// Returns the end of the scan if columns, points and digest agree with the bridge's ScanEnd.
    fn close(&self, end: &message::ScanEnd) -> Result<ScanEnd> {
        let add = |digest, crc: &u32| crc32c::crc32c_append(digest, &crc.to_le_bytes());
        let digest = self.columns.iter().flatten().fold(0, add);
        let columns = self.layout.begin().columns;
        if (end.columns, end.points, end.digest) != (columns, self.points, digest) {
            let what = format!(
                "received {columns} columns, {} points, digest {digest:#010x}, but ScanEnd states {} columns, {} points, digest {:#010x}",
                self.points, end.columns, end.points, end.digest
            );
            return Err(Error::Bridge(what));
        }
        Ok(ScanEnd {
            columns,
            points: self.delivered,
            warm_up_columns: self.layout.warm_up_columns(),
            outcome: Outcome::Complete,
        })
    }
}

fn valid(column: &Column) -> u64 {
    column.state.iter().filter(|state| **state == State::Valid).count() as u64
}

/// Checks version and serial number of the scanner that answers.
pub(crate) fn check_scanner(found: &message::Capabilities, serial: Option<&str>) -> Result<()> {
    if found.version.0 != VERSION.0 {
        return Err(Error::Version { bridge: found.version });
    }
    match serial {
        Some(expected) if expected != found.serial => {
            Err(Error::WrongScanner { found: found.serial.clone(), expected: expected.to_owned() })
        }
        _ => Ok(()),
    }
}

/// Converts an Error frame to an error.
pub(crate) fn refused(refusal: message::Refusal) -> Error {
    match (refusal.code.as_str(), refusal.retry_ms) {
        ("busy", retry) => Error::Busy { text: refusal.text, retry_ms: retry.unwrap_or(1000) },
        (_, Some(retry_ms)) => Error::Busy { text: format!("{}: {}", refusal.code, refusal.text), retry_ms },
        _ => Error::Refused { code: refusal.code, text: refusal.text },
    }
}

/// Parses the message in a frame.
pub(crate) fn parse<T: serde::de::DeserializeOwned>(frame: &Frame) -> Result<T> {
    serde_json::from_slice(&frame.payload).map_err(|error| {
        Error::Bridge(format!("invalid message in a frame of type {:#06x}: {error}", frame.kind))
    })
}

/// Encodes a message; its types contain nothing that JSON cannot represent.
pub(crate) fn json(message: &impl serde::Serialize) -> Vec<u8> {
    serde_json::to_vec(message).unwrap_or_default()
}
