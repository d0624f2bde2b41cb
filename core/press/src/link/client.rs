//! The one user of a link: time limits, checks, the allow-list, and what was counted on the way.

use std::collections::BTreeMap;
use std::time::Duration;

use platen_plant::press::{Block, Press, Refused, WriteAllow};
use tokio::time::{Instant, sleep_until, timeout};

use super::{Link, LinkError, Request, Response};

/// What happened on a link since the start.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Counts {
    /// Requests sent.
    pub requests: u64,
    /// Write requests sent.
    pub writes: u64,
    /// Writes that were never sent because the allow-list or the mode forbids them.
    pub writes_refused: u64,
    /// Connections built.
    pub connects: u64,
    /// Connections dropped because of an error, a timeout or a wrong answer.
    pub poisoned: u64,
    /// Requests without an answer in time.
    pub timeouts: u64,
    /// Refusals by Modbus exception code.
    pub exceptions: BTreeMap<u8, u64>,
    /// Round trips by time: up to 1, 2, 5, 10, 20, 50, 100, 200, 500 ms, and longer.
    pub round_trips: [u64; 10],
}

/// Upper limits of the classes of [`Counts::round_trips`] in milliseconds.
pub const ROUND_TRIP_LIMITS_MS: [u64; 9] = [1, 2, 5, 10, 20, 50, 100, 200, 500];

/// Asks one press over one link.
#[derive(Debug)]
pub struct Client<L> {
    link: L,
    connected: bool,
    allow: WriteAllow,
    may_write: bool,
    connect_timeout: Duration,
    response_timeout: Duration,
    pause_after_connect: Duration,
    pause_between_requests: Duration,
    not_before: Option<Instant>,
    counts: Counts,
}

impl<L: Link> Client<L> {
    /// A client for the press that the plant file describes.
    pub fn new(link: L, press: &Press) -> Self {
        // Draining a serial line until it is quiet is part of connecting.
        let drain = press.link.quiet().map_or(Duration::ZERO, |_| super::DRAIN_MAX);
        Self {
            link,
            connected: false,
            allow: press.write.clone(),
            may_write: press.mode.writes(),
            connect_timeout: press.link.connect_timeout + drain,
            response_timeout: press.link.response_timeout,
            pause_after_connect: press.link.pause_after_connect,
            pause_between_requests: press.link.pause_between_requests,
            not_before: None,
            counts: Counts::default(),
        }
    }

    /// Where the link leads.
    pub fn peer(&self) -> String {
        self.link.peer()
    }

    /// What happened so far.
    pub fn counts(&self) -> &Counts {
        &self.counts
    }

    /// Whether there is a connection that no error has poisoned.
    pub fn connected(&self) -> bool {
        self.connected
    }

    /// Builds a connection.
    ///
    /// # Errors
    /// [`LinkError::Connect`] or [`LinkError::ConnectTimeout`].
    pub async fn connect(&mut self) -> Result<(), LinkError> {
        self.disconnect();
        let limit = self.connect_timeout;
        match timeout(limit, self.link.connect()).await {
            Ok(Ok(())) => {
                self.connected = true;
                self.counts.connects += 1;
                self.not_before = Some(Instant::now() + self.pause_after_connect);
                Ok(())
            }
            Ok(Err(source)) => {
                self.disconnect();
                Err(LinkError::Connect { peer: self.peer(), source })
            }
            Err(_) => {
                self.disconnect();
                Err(LinkError::ConnectTimeout { peer: self.peer(), limit })
            }
        }
    }

    /// Drops the connection.
    pub fn disconnect(&mut self) {
        self.link.disconnect();
        self.connected = false;
    }

    /// Reads the first `count` registers of a block.
    ///
    /// # Errors
    /// Any [`LinkError`] but those of connecting and [`LinkError::Refused`]. Only after an exception is the connection
    /// still there.
    pub async fn read(&mut self, block: &Block, count: u16) -> Result<Vec<u16>, LinkError> {
        let request = Request::Read { table: block.table, start: block.start, count };
        match self.exchange(&request).await? {
            Response::Words(words) if words.len() == usize::from(count) => Ok(words),
            other => Err(self.mismatch(request, &other)),
        }
    }

    /// Writes holding registers: the only function of this program that does.
    ///
    /// Returns when the press has echoed the address and the number of registers. An error other than a refusal or an
    /// exception leaves open whether the write was done: it must be harmless to do it again.
    ///
    /// # Errors
    /// [`LinkError::Refused`] outside the allow-list and in modes that never write; else as for [`read`](Self::read).
    pub async fn guarded_write(&mut self, start: u16, words: &[u16]) -> Result<(), LinkError> {
        let count = u16::try_from(words.len()).unwrap_or(u16::MAX);
        let allowed =
            if self.may_write { self.allow.check(start, count) } else { Err(Refused { start, count }) };
        if let Err(refused) = allowed {
            self.counts.writes_refused += 1;
            return Err(LinkError::Refused { peer: self.peer(), refused });
        }
        self.counts.writes += 1;
        let request = Request::Write { start, words: words.to_vec() };
        match self.exchange(&request).await? {
            Response::Written { start: at, count: n } if at == start && n == count => Ok(()),
            other => Err(self.mismatch(request, &other)),
        }
    }

    /// Asks the press's controller who made it: maker, product, revision. Few controllers answer.
    ///
    /// # Errors
    /// As for [`read`](Self::read).
    pub async fn identify(&mut self) -> Result<Vec<String>, LinkError> {
        match self.exchange(&Request::Identify).await? {
            Response::Identity(texts) => Ok(texts),
            other => Err(self.mismatch(Request::Identify, &other)),
        }
    }

    /// One request and its answer within the time limit. Everything but an answer drops the connection.
    async fn exchange(&mut self, request: &Request) -> Result<Response, LinkError> {
        if let Some(moment) = self.not_before {
            sleep_until(moment).await;
        }
        self.counts.requests += 1;
        let (sent, limit) = (Instant::now(), self.response_timeout);
        // Should this future be dropped while it waits, the connection counts as gone.
        let was_connected = std::mem::replace(&mut self.connected, false);
        let answer = timeout(limit, self.link.call(request)).await;
        self.not_before = Some(Instant::now() + self.pause_between_requests);
        match answer {
            Ok(Ok(Response::Exception(code))) => {
                self.connected = was_connected;
                *self.counts.exceptions.entry(code).or_default() += 1;
                Err(LinkError::Exception { peer: self.peer(), request: request.clone(), code })
            }
            Ok(Ok(answer)) => {
                self.connected = was_connected;
                let took = sent.elapsed();
                let class =
                    ROUND_TRIP_LIMITS_MS.partition_point(|&limit| Duration::from_millis(limit) < took);
                self.counts.round_trips[class] += 1;
                Ok(answer)
            }
            Ok(Err(source)) => {
                self.poison();
                Err(LinkError::Broken { peer: self.peer(), request: request.clone(), source })
            }
            Err(_) => {
                self.counts.timeouts += 1;
                self.poison();
                Err(LinkError::Timeout { peer: self.peer(), request: request.clone(), limit })
            }
        }
    }

    fn poison(&mut self) {
        self.counts.poisoned += 1;
        self.disconnect();
    }

    fn mismatch(&mut self, request: Request, answer: &Response) -> LinkError {
        self.poison();
        let answer = match answer {
            Response::Words(words) => format!("{} registers", words.len()),
            Response::Written { start, count } => format!("{count} registers written from {start} on"),
            Response::Identity(_) => "an identity".into(),
            Response::Exception(code) => format!("exception {code:02X}"),
        };
        LinkError::Mismatch { peer: self.peer(), request, answer }
    }
}
