//! State shared by the connections of a bridge: the lease, and the scans that run or have run.

use std::collections::VecDeque;
use std::net::{Shutdown, TcpStream};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use super::config::BridgeConfig;
use super::counters::{AtomicCounters, increment};
use super::fault::FaultKind;
use super::frame_faults::FrameFaults;
use super::head::{Head, Plan, Receiver};
use super::message::{Outcome, Refusal, ScanLayout};
use super::payload;
use super::spool::Spool;

/// Duration of a lease from each frame of its holder.
const LEASE: Duration = Duration::from_secs(5);

/// Longest sleep between two checks for an abort.
const NAP: Duration = Duration::from_millis(20);

/// Time of one attempt to bring the mirror to speed, seconds, and the number of attempts.
const STALL: (f64, u32) = (45.0, 5);

/// State shared by all connections.
pub(super) struct Shared {
    pub(super) config: BridgeConfig,
    pub(super) head: Box<dyn Head>,
    pub(super) counts: AtomicCounters,
    pub(super) frame_faults: Mutex<FrameFaults>,
    pub(super) begun: Instant,
    /// Start of the scan numbers, from the clock, so that numbers are not reused after a restart.
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
    /// Connections are refused until then.
    closed_until: Option<Instant>,
    open: Vec<(u32, TcpStream)>,
}

#[derive(Debug)]
struct Lease {
    client: String,
    connection: u32,
    until: Instant,
}

/// Scan that runs or has run.
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

    /// Returns true when the bridge's disk was full.
    pub(super) fn overflowed(&self) -> bool {
        self.overflowed.load(Ordering::Relaxed)
    }

    /// Returns the number of failed attempts to bring the mirror to speed.
    pub(super) fn stalls(&self) -> u32 {
        self.stalls.load(Ordering::Relaxed)
    }
}

impl Shared {
    pub(super) fn new(config: BridgeConfig, head: Box<dyn Head>) -> Self {
        let frame_faults = Mutex::new(FrameFaults::new(&config.faults, config.seed));
        Self {
            config,
            head,
            counts: AtomicCounters::default(),
            frame_faults,
            begun: Instant::now(),
            first_number: tenths_since_1970(),
            ending: AtomicBool::new(false),
            state: Mutex::default(),
        }
    }

    /// Ends all scans and connections.
    pub(super) fn end(&self) {
        self.ending.store(true, Ordering::Relaxed);
        for (_, stream) in &self.state().open {
            // An error means that it is closed already.
            let _ = stream.shutdown(Shutdown::Both);
        }
        for scan in &self.state().scans {
            scan.aborted.store(true, Ordering::Relaxed);
        }
    }

    pub(super) fn is_ending(&self) -> bool {
        self.ending.load(Ordering::Relaxed)
    }

    /// Registers a connection and returns its number; `None` while connections are refused.
    pub(super) fn admit(&self, stream: &TcpStream) -> Option<u32> {
        let mut state = self.state();
        if state.closed_until.is_some_and(|until| Instant::now() < until) {
            return None;
        }
        let handle = stream.try_clone().ok()?;
        let number = self.counts.connections.fetch_add(1, Ordering::Relaxed);
        state.open.push((number, handle));
        Some(number)
    }

    /// Removes a connection that has ended.
    pub(super) fn remove(&self, number: u32) {
        self.state().open.retain(|(open, _)| *open != number);
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn frame_faults(&self) -> MutexGuard<'_, FrameFaults> {
        self.frame_faults.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns true when this persistent fault is configured.
    pub(super) fn is_active(&self, kind: FaultKind) -> bool {
        self.frame_faults().persistent(kind).is_some()
    }

    /// Returns the remaining time of a fault that lasts for the first n milliseconds of the bridge.
    pub(super) fn remaining_at_start(&self, kind: FaultKind) -> Option<Duration> {
        let ms = self.frame_faults().persistent(kind)?;
        Duration::from_millis(ms.into()).checked_sub(self.begun.elapsed())
    }

    /// Grants the lease to a client, or refuses it with the holder's name. The same client takes it over: its previous
    /// connection is closed.
    pub(super) fn lease(&self, client: &str, connection: u32) -> Result<(), Refusal> {
        if let Some(left) = self.remaining_at_start(FaultKind::LeaseStuck) {
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
                    // An error means that it is closed already.
                    let _ = stream.shutdown(Shutdown::Both);
                }
            }
        }
        state.lease = Some(Lease { client: client.to_owned(), connection, until: now + LEASE });
        Ok(())
    }

    /// Renews the lease of a connection that has sent a frame.
    pub(super) fn renew_lease(&self, connection: u32) {
        if let Some(lease) = self.state().lease.as_mut().filter(|lease| lease.connection == connection) {
            lease.until = Instant::now() + LEASE;
        }
    }

    /// Returns the scan of a job.
    pub(super) fn scan_of(&self, job: &str) -> Option<Arc<Scan>> {
        self.state().scans.iter().find(|scan| scan.spool.job == job).cloned()
    }

    /// Returns the running scan.
    pub(super) fn running(&self) -> Option<Arc<Scan>> {
        self.state().scans.iter().find(|scan| !scan.spool.is_over()).cloned()
    }

    /// Returns the scan of a job; starts it when there is none.
    pub(super) fn begin(self: &Arc<Self>, job: &str, plan: Plan) -> Result<Arc<Scan>, Refusal> {
        if let Some(scan) = self.scan_of(job) {
            return Ok(scan);
        }
        if let Some(running) = self.running() {
            let text = format!("job {} is running", running.spool.job);
            return Err(Refusal::new("busy", text).retry(1000));
        }
        let failed = |error: std::io::Error| Refusal::new("scanner", format!("the bridge's disk: {error}"));
        let mut state = self.state();
        state.scans_begun += 1;
        let nth = state.scans_begun;
        // Every second number stays unused, so that injected frames of another scan have one that no scan uses.
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

    /// Aborts the scan of a job.
    pub(super) fn abort(&self, job: &str) {
        if let Some(scan) = self.scan_of(job).filter(|scan| !scan.spool.is_over())
            && !scan.aborted.swap(true, Ordering::Relaxed)
        {
            increment(&self.counts.aborts);
        }
    }

    /// Records a connection cut by a fault; discards all scans when the bridge restarted (`died`).
    pub(super) fn connection_cut(&self, died: bool) {
        increment(&self.counts.cuts);
        let closed = self.frame_faults().persistent(FaultKind::ReconnectTooFast);
        let mut state = self.state();
        state.closed_until = closed.map(|ms| Instant::now() + Duration::from_millis(ms.into()));
        if died {
            state.scans.drain(..).for_each(|scan| scan.aborted.store(true, Ordering::Relaxed));
        }
    }

    /// Takes a scan to its end at the pace of a real scanner.
    fn run(&self, plan: &Plan, scan: &Scan, nth: u32) {
        let spool = &scan.spool;
        increment(&self.counts.scans);
        let mut due = PacedReceiver { shared: self, scan, started: Instant::now(), taken: 0, why: None };
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

/// Receiver that writes columns to the spool at the times of a real scanner.
struct PacedReceiver<'a> {
    shared: &'a Shared,
    scan: &'a Scan,
    started: Instant,
    taken: u32,
    why: Option<String>,
}

impl PacedReceiver<'_> {
    /// Waits until this time of the scanner, seconds; breaks when the scan is aborted.
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

    /// Simulates the spin-up of the mirror with its failed attempts.
    fn spin_up(&mut self) -> ControlFlow<()> {
        let stalls = self.shared.frame_faults().persistent(FaultKind::StartStall).unwrap_or(0);
        for stall in 1..=stalls.min(STALL.1) {
            self.scan.stalls.store(stall, Ordering::Relaxed);
            self.started = Instant::now();
            self.wait_until(STALL.0)?;
        }
        if stalls > STALL.1 {
            self.why = Some(format!("the mirror did not reach its speed in {} attempts", STALL.1));
            return ControlFlow::Break(());
        }
        self.started = Instant::now();
        ControlFlow::Continue(())
    }

    fn fail(&mut self, why: impl Into<String>) -> ControlFlow<()> {
        self.why = Some(why.into());
        ControlFlow::Break(())
    }

    /// Applies the faults that stop a scanner before its next column.
    fn injected_failure(&mut self) -> ControlFlow<()> {
        let (taken, bytes) = (self.taken, self.scan.spool.bytes());
        let at = |kind| self.shared.frame_faults().persistent(kind);
        if at(FaultKind::StorageFull).is_some_and(|column| taken >= column) {
            return self.fail("the memory card is full");
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

impl Receiver for PacedReceiver<'_> {
    fn begin(&mut self, mut begin: ScanLayout) -> ControlFlow<()> {
        if self.shared.is_active(FaultKind::ClockJump) {
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
        self.injected_failure()?;
        self.taken += 1;
        if self.taken > 3 && self.shared.is_active(FaultKind::ClockJump) {
            payload::set_clock_back(&mut bytes);
        }
        match self.scan.spool.column(bytes) {
            Ok(()) => ControlFlow::Continue(()),
            Err(error) => self.fail(format!("the bridge's disk: {error}")),
        }
    }
}
