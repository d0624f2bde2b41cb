//! Client of a link: time limits, checks of the answers, the allow-list of writes, and counters.

use std::collections::BTreeMap;
use std::time::Duration;

use platen_plant::press::{Block, Press, Refused, WriteAllow};
use tokio::time::{Instant, sleep_until, timeout};

use super::{Link, LinkError, Request, Response};

/// Counters of a link since the start.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Counts {
    /// Requests sent.
    pub requests: u64,
    /// Write requests sent.
    pub writes: u64,
    /// Writes not sent because the allow-list or the mode forbids them.
    pub writes_refused: u64,
    /// Connections established.
    pub connects: u64,
    /// Connections dropped because of an error, a timeout or a wrong answer.
    pub poisoned: u64,
    /// Requests without an answer in time.
    pub timeouts: u64,
    /// Exceptions by code.
    pub exceptions: BTreeMap<u8, u64>,
    /// Histogram of round trips: up to 1, 2, 5, 10, 20, 50, 100, 200, 500 ms, and longer.
    pub round_trips: [u64; 10],
}

/// Upper limits of the classes of [`Counts::round_trips`] in milliseconds.
pub const ROUND_TRIP_LIMITS_MS: [u64; 9] = [1, 2, 5, 10, 20, 50, 100, 200, 500];

/// Client of one press over one link.
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
    /// Returns a client for the press of the plant file.
    pub fn new(link: L, press: &Press) -> Self {
        // Connecting includes draining a serial line until it is silent.
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

    /// Returns the address of the peer.
    pub fn peer(&self) -> String {
        self.link.peer()
    }

    /// Returns the counters.
    pub fn counts(&self) -> &Counts {
        &self.counts
    }

    /// Returns whether a connection exists that no error has invalidated.
    pub fn connected(&self) -> bool {
        self.connected
    }

    /// Connects.
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
    /// Any [`LinkError`] except those of connecting and [`LinkError::Refused`]. The connection persists only after an
    /// exception.
    pub async fn read(&mut self, block: &Block, count: u16) -> Result<Vec<u16>, LinkError> {
        let request = Request::Read { table: block.table, start: block.start, count };
        match self.exchange(&request).await? {
            Response::Words(words) if words.len() == usize::from(count) => Ok(words),
            other => Err(self.mismatch(request, &other)),
        }
    }

    /// Writes holding registers (function 16); no other function of this program does so.
    ///
    /// Returns when the press has echoed address and quantity. After an error other than a refusal or an exception it
    /// is unknown whether the write was executed: every write must be idempotent.
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

    /// Reads the device identification of the press's controller: vendor, product, revision. Few controllers answer.
    ///
    /// # Errors
    /// As for [`read`](Self::read).
    pub async fn identify(&mut self) -> Result<Vec<String>, LinkError> {
        match self.exchange(&Request::Identify).await? {
            Response::Identity(texts) => Ok(texts),
            other => Err(self.mismatch(Request::Identify, &other)),
        }
    }

    /// Transfers one request and its answer within the time limit. Any other outcome drops the connection.
    async fn exchange(&mut self, request: &Request) -> Result<Response, LinkError> {
        // A time in the past is skipped: the timer would wait for its next whole millisecond.
        if let Some(moment) = self.not_before.filter(|&moment| moment > Instant::now()) {
            sleep_until(moment).await;
        }
        self.counts.requests += 1;
        let (sent, limit) = (Instant::now(), self.response_timeout);
        // If this future is dropped while it waits, the connection is invalid.
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
