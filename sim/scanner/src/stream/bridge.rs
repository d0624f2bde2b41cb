//! A bridge: its port, its lease, its scans.

use std::collections::VecDeque;
use std::net::{Ipv4Addr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use serde::Serialize;

use super::connection;
use super::disturb::Disturb;
use super::fault::{Fault, FaultKind};
use super::head::{Head, Plan, Receiver};
use super::message::{Begin, Outcome, Refusal, Wanted};
use super::payload;
use super::spool::Spool;

/// How long a lease lasts from each frame of its holder.
const LEASE: Duration = Duration::from_secs(5);

/// Longest sleep between two looks at whether a scan is still wanted.
const NAP: Duration = Duration::from_millis(20);

/// Seconds between two tries to bring the mirror up to speed, and how many there are.
const STALL: (f64, u32) = (45.0, 5);

/// How a bridge serves.
#[derive(Debug, Clone)]
pub struct BridgeConfig {
    /// Where it listens; port 0 lets the system choose.
    pub address: SocketAddr,
    /// Serial number of its scanner.
    pub serial: String,
    /// Columns are sent while the head turns. The vendor's software gives none before the scan's file is closed.
    pub live: bool,
    /// So many scans are kept.
    pub kept_scans: usize,
    /// Share of a real scanner's time that a scan takes; 0: no longer than the computer needs.
    pub time_scale: f64,
    /// Folder in which every scan is kept as a recording, `scan-NUMBER.psb`.
    pub record: Option<PathBuf>,
    /// What goes wrong.
    pub faults: Vec<Fault>,
    /// Seed of what goes wrong by chance.
    pub seed: u64,
}

impl Default for BridgeConfig {
    /// Loopback, live, in no time, without faults.
    fn default() -> Self {
        Self {
            address: (Ipv4Addr::LOCALHOST, 0).into(),
            serial: "SIM0001".to_owned(),
            live: true,
            kept_scans: 3,
            time_scale: 0.0,
            record: None,
            faults: Vec::new(),
            seed: 1,
        }
    }
}

/// What a bridge has done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct BridgeTally {
    /// Connections taken.
    pub connections: u32,
    /// Scans that the head began.
    pub scans: u32,
    /// Start frames.
    pub starts: u32,
    /// Resume frames.
    pub resumes: u32,
    /// Scans that were aborted.
    pub aborts: u32,
    /// Column frames sent.
    pub columns_sent: u32,
    /// Columns of the scan that was begun last.
    pub columns: u32,
    /// Connections that a fault has cut.
    pub cuts: u32,
}

/// A running bridge; dropping it ends it.
#[derive(Debug)]
pub struct Bridge {
    address: SocketAddr,
    shared: Arc<Shared>,
    port: Option<JoinHandle<()>>,
}

/// Counters of [`BridgeTally`].
#[derive(Debug, Default)]
pub(super) struct Counts {
    pub(super) connections: AtomicU32,
    pub(super) scans: AtomicU32,
    pub(super) starts: AtomicU32,
    pub(super) resumes: AtomicU32,
    pub(super) aborts: AtomicU32,
    pub(super) columns_sent: AtomicU32,
    pub(super) columns: AtomicU32,
    pub(super) cuts: AtomicU32,
}

/// Counts one up.
pub(super) fn count(counter: &AtomicU32) {
    counter.fetch_add(1, Ordering::Relaxed);
}

/// What all connections share.
pub(super) struct Shared {
    pub(super) config: BridgeConfig,
    pub(super) head: Box<dyn Head>,
    pub(super) counts: Counts,
    pub(super) disturb: Mutex<Disturb>,
    pub(super) begun: Instant,
    /// Scans are numbered from here on: numbers never return, even when a bridge starts again.
    first_number: u32,
    ending: AtomicBool,
    state: Mutex<State>,
}

impl std::fmt::Debug for Shared {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Shared").field("config", &self.config).finish_non_exhaustive()
    }
}

#[derive(Debug, Default)]
struct State {
    lease: Option<Lease>,
    scans: VecDeque<Arc<Scan>>,
    scans_begun: u32,
    /// Nobody is let in before.
    closed_until: Option<Instant>,
    open: Vec<(u32, TcpStream)>,
}

#[derive(Debug)]
struct Lease {
    client: String,
    connection: u32,
    until: Instant,
}

/// A scan that runs or has run.
#[derive(Debug)]
pub(super) struct Scan {
    pub(super) spool: Spool,
    aborted: AtomicBool,
    overflowed: AtomicBool,
    stalls: AtomicU32,
}

impl Scan {
    fn new(spool: Spool) -> Self {
        let no = || AtomicBool::new(false);
        Self { spool, aborted: no(), overflowed: no(), stalls: AtomicU32::new(0) }
    }

    /// True when the bridge's disk could not take all of it.
    pub(super) fn overflowed(&self) -> bool {
        self.overflowed.load(Ordering::Relaxed)
    }

    /// How often the mirror has not come up to speed.
    pub(super) fn stalls(&self) -> u32 {
        self.stalls.load(Ordering::Relaxed)
    }
}

impl Bridge {
    /// Listens; scans are taken with `head`.
    ///
    /// # Errors
    /// When the port is taken.
    pub fn start(config: BridgeConfig, head: Box<dyn Head>) -> std::io::Result<Self> {
        if let Some(folder) = &config.record {
            std::fs::create_dir_all(folder)?;
        }
        let listener = TcpListener::bind(config.address)?;
        let address = listener.local_addr()?;
        let disturb = Mutex::new(Disturb::new(&config.faults, config.seed));
        let shared = Arc::new(Shared {
            config,
            head,
            counts: Counts::default(),
            disturb,
            begun: Instant::now(),
            first_number: tenths_since_1970(),
            ending: AtomicBool::new(false),
            state: Mutex::default(),
        });
        let port = {
            let shared = Arc::clone(&shared);
            std::thread::spawn(move || accept(&listener, &shared))
        };
        Ok(Self { address, shared, port: Some(port) })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// What it has done so far.
    pub fn tally(&self) -> BridgeTally {
        let counts = &self.shared.counts;
        let read = |counter: &AtomicU32| counter.load(Ordering::Relaxed);
        BridgeTally {
            connections: read(&counts.connections),
            scans: read(&counts.scans),
            starts: read(&counts.starts),
            resumes: read(&counts.resumes),
            aborts: read(&counts.aborts),
            columns_sent: read(&counts.columns_sent),
            columns: read(&counts.columns),
            cuts: read(&counts.cuts),
        }
    }
}

impl Drop for Bridge {
    fn drop(&mut self) {
        self.shared.ending.store(true, Ordering::Relaxed);
        for (_, stream) in &self.shared.state().open {
            // One that has gone already needs no hanging up.
            let _ = stream.shutdown(Shutdown::Both);
        }
        for scan in &self.shared.state().scans {
            scan.aborted.store(true, Ordering::Relaxed);
        }
        // Wakes the thread that waits for connections.
        let _ = TcpStream::connect(self.address);
        if let Some(port) = self.port.take() {
            let _ = port.join();
        }
    }
}

fn accept(listener: &TcpListener, shared: &Arc<Shared>) {
    for stream in listener.incoming().flatten() {
        if shared.ending.load(Ordering::Relaxed) {
            return;
        }
        if shared.state().closed_until.is_some_and(|until| Instant::now() < until) {
            continue;
        }
        let number = shared.counts.connections.fetch_add(1, Ordering::Relaxed);
        let Ok(handle) = stream.try_clone() else { continue };
        shared.state().open.push((number, handle));
        let shared = Arc::clone(shared);
        std::thread::spawn(move || {
            connection::serve(stream, number, &shared);
            shared.state().open.retain(|(open, _)| *open != number);
        });
    }
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn disturb(&self) -> MutexGuard<'_, Disturb> {
        self.disturb.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// True when this fault lasts.
    pub(super) fn suffers(&self, kind: FaultKind) -> bool {
        self.disturb().lasting(kind).is_some()
    }

    /// True for the first so many milliseconds of the bridge that the fault says; gives what is left.
    pub(super) fn at_first(&self, kind: FaultKind) -> Option<Duration> {
        let ms = self.disturb().lasting(kind)?;
        Duration::from_millis(ms.into()).checked_sub(self.begun.elapsed())
    }

    /// Gives the lease to a client, or says who holds it. The same client takes it over: its connection before is
    /// closed.
    pub(super) fn lease(&self, client: &str, connection: u32) -> Result<(), Refusal> {
        if let Some(left) = self.at_first(FaultKind::LeaseStuck) {
            return Err(busy("press-4", left));
        }
        let now = Instant::now();
        let mut state = self.state();
        if let Some(lease) = &state.lease {
            if lease.client != client && now < lease.until {
                return Err(busy(&lease.client, lease.until - now));
            }
            if lease.client == client && lease.connection != connection {
                let before = lease.connection;
                for (_, stream) in state.open.iter().filter(|(open, _)| *open == before) {
                    // One that has gone already needs no hanging up.
                    let _ = stream.shutdown(Shutdown::Both);
                }
            }
        }
        state.lease = Some(Lease { client: client.to_owned(), connection, until: now + LEASE });
        Ok(())
    }

    /// A frame of this connection has come.
    pub(super) fn heard(&self, connection: u32) {
        if let Some(lease) = self.state().lease.as_mut().filter(|lease| lease.connection == connection) {
            lease.until = Instant::now() + LEASE;
        }
    }

    /// The scan of a job.
    pub(super) fn scan_of(&self, job: &str) -> Option<Arc<Scan>> {
        self.state().scans.iter().find(|scan| scan.spool.job == job).cloned()
    }

    /// The scan that runs.
    pub(super) fn running(&self) -> Option<Arc<Scan>> {
        self.state().scans.iter().find(|scan| !scan.spool.is_over()).cloned()
    }

    /// The scan of a job, begun now when there is none.
    pub(super) fn begin(self: &Arc<Self>, job: &str, plan: Plan) -> Result<Arc<Scan>, Refusal> {
        if let Some(scan) = self.scan_of(job) {
            return Ok(scan);
        }
        if let Some(running) = self.running() {
            let text = format!("job {} runs", running.spool.job);
            return Err(Refusal::new("busy", text).retry(1000));
        }
        let failed = |error: std::io::Error| Refusal::new("scanner", format!("the bridge's disk: {error}"));
        let mut state = self.state();
        state.scans_begun += 1;
        let nth = state.scans_begun;
        // Leaves a number free, so that frames of another scan have one that this bridge never used.
        let number = self.first_number.wrapping_add(2 * nth);
        let file = self.config.record.as_ref().map(|folder| folder.join(format!("scan-{nth:05}.psb")));
        let spool = Spool::new(job, number, file.as_deref(), !self.config.live).map_err(failed)?;
        let scan = Arc::new(Scan::new(spool));
        state.scans.push_back(Arc::clone(&scan));
        while state.scans.len() > self.config.kept_scans.max(1) {
            state.scans.pop_front();
        }
        drop(state);
        let (shared, running) = (Arc::clone(self), Arc::clone(&scan));
        std::thread::spawn(move || shared.run(&plan, &running, nth));
        Ok(scan)
    }

    /// Ends the scan of a job.
    pub(super) fn abort(&self, job: &str) {
        if let Some(scan) = self.scan_of(job).filter(|scan| !scan.spool.is_over()) {
            scan.aborted.store(true, Ordering::Relaxed);
            count(&self.counts.aborts);
        }
    }

    /// A connection was cut by a fault; the bridge forgets its scans when it died.
    pub(super) fn was_cut(&self, died: bool) {
        count(&self.counts.cuts);
        let closed = self.disturb().lasting(FaultKind::ReconnectTooFast);
        let mut state = self.state();
        state.closed_until = closed.map(|ms| Instant::now() + Duration::from_millis(ms.into()));
        if died {
            state.scans.drain(..).for_each(|scan| scan.aborted.store(true, Ordering::Relaxed));
        }
    }

    /// Takes a scan to its end, which takes as long as with a real scanner.
    fn run(&self, plan: &Plan, scan: &Scan, nth: u32) {
        let spool = &scan.spool;
        count(&self.counts.scans);
        let mut due = Due { shared: self, scan, started: Instant::now(), taken: 0, why: None };
        let taken = match due.spin_up() {
            ControlFlow::Continue(()) => self.head.scan(plan, nth, &mut due),
            ControlFlow::Break(()) => Ok(()),
        };
        let settled = due.wait_until(plan.duration_s);
        let why = due.why.take();
        if spool.has_begun() {
            let ended = match (taken, why, settled) {
                (Err(why), _, _) | (Ok(()), Some(why), _) => spool.end(Outcome::Failed, Some(why)),
                (Ok(()), None, ControlFlow::Break(())) => spool.end(Outcome::Aborted, None),
                (Ok(()), None, ControlFlow::Continue(())) => spool.end(Outcome::Complete, None),
            };
            if let Err(error) = ended {
                spool.refuse(format!("the bridge's disk: {error}"));
            }
        } else {
            spool.refuse(taken.err().or(why).unwrap_or_else(|| "aborted".to_owned()));
        }
    }
}

fn tenths_since_1970() -> u32 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(0, |since| (since.as_millis() / 100) as u32)
}

fn busy(holder: &str, left: Duration) -> Refusal {
    let ms = left.as_millis() as u64 + 1;
    Refusal::new("busy", format!("held by {holder} for {ms} ms")).retry(ms)
}

/// Puts what the head measures into the spool when a real scanner would have measured it.
struct Due<'a> {
    shared: &'a Shared,
    scan: &'a Scan,
    started: Instant,
    taken: u32,
    why: Option<String>,
}

impl Due<'_> {
    /// Waits for this second of the scanner's time; breaks when the scan was aborted.
    fn wait_until(&self, second: f64) -> ControlFlow<()> {
        let due = Duration::from_secs_f64(self.shared.config.time_scale * second);
        loop {
            if self.scan.aborted.load(Ordering::Relaxed) {
                return ControlFlow::Break(());
            }
            let left = due.saturating_sub(self.started.elapsed());
            if left.is_zero() {
                return ControlFlow::Continue(());
            }
            std::thread::sleep(left.min(NAP));
        }
    }

    /// The mirror comes up to speed, sooner or later.
    fn spin_up(&mut self) -> ControlFlow<()> {
        let stalls = self.shared.disturb().lasting(FaultKind::StartStall).unwrap_or(0);
        for stall in 1..=stalls.min(STALL.1) {
            self.scan.stalls.store(stall, Ordering::Relaxed);
            self.started = Instant::now();
            self.wait_until(STALL.0)?;
        }
        if stalls > STALL.1 {
            self.why = Some(format!("the mirror did not come up to speed in {} tries", STALL.1));
            return ControlFlow::Break(());
        }
        self.started = Instant::now();
        ControlFlow::Continue(())
    }

    fn fail(&mut self, why: impl Into<String>) -> ControlFlow<()> {
        self.why = Some(why.into());
        ControlFlow::Break(())
    }

    /// What stops a scanner before its next column.
    fn mishap(&mut self) -> ControlFlow<()> {
        let (taken, bytes) = (self.taken, self.scan.spool.bytes());
        let at = |kind| self.shared.disturb().lasting(kind);
        if at(FaultKind::StorageFull).is_some_and(|column| taken >= column) {
            return self.fail("the card is full");
        }
        if at(FaultKind::Tilted).is_some_and(|column| taken >= column) {
            return self.fail("the scanner was moved: its inclination changed by 0.4 degrees");
        }
        if at(FaultKind::Overflow).is_some_and(|kilobytes| bytes > 1000 * u64::from(kilobytes)) {
            self.scan.overflowed.store(true, Ordering::Relaxed);
            return self.fail("the bridge's disk is full");
        }
        ControlFlow::Continue(())
    }
}

impl Receiver for Due<'_> {
    fn begin(&mut self, mut begin: Begin) -> ControlFlow<()> {
        if self.shared.suffers(FaultKind::ClockJump) {
            begin.acquired_unix_s = Some(0.0);
        }
        self.shared.counts.columns.store(begin.columns, Ordering::Relaxed);
        match self.scan.spool.begin(begin) {
            Ok(()) => ControlFlow::Continue(()),
            Err(error) => self.fail(format!("the bridge's disk: {error}")),
        }
    }

    fn column(&mut self, mut bytes: Vec<u8>) -> ControlFlow<()> {
        self.wait_until(payload::time_s(&bytes))?;
        self.mishap()?;
        self.taken += 1;
        if self.taken > 3 && self.shared.suffers(FaultKind::ClockJump) {
            payload::set_clock_back(&mut bytes);
        }
        match self.scan.spool.column(bytes) {
            Ok(()) => ControlFlow::Continue(()),
            Err(error) => self.fail(format!("the bridge's disk: {error}")),
        }
    }
}

/// What is wanted, as the scanner takes it.
pub(super) fn altered(shared: &Shared, wanted: Wanted) -> (Wanted, Vec<String>) {
    if !shared.suffers(FaultKind::ParamsAltered) || wanted.rate_kpts <= 122 {
        return (wanted, Vec::new());
    }
    let note =
        format!("rate_kpts: {} was asked for, the scanner took {}", wanted.rate_kpts, wanted.rate_kpts / 2);
    (Wanted { rate_kpts: wanted.rate_kpts / 2, ..wanted }, vec![note])
}
