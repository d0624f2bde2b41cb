//! Link in memory with injected faults, for virtual time.

use std::time::Duration;

use platen_press::{Link, Request, Response, TransportError};

use super::SharedPlc;

/// Fault probabilities per request, in thousandths.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Chaos {
    pub(crate) late: u32,
    pub(crate) reset: u32,
    /// The request is carried out and its answer is lost.
    pub(crate) lost: u32,
}

#[derive(Debug)]
pub(crate) struct MemoryLink {
    plc: SharedPlc,
    chaos: Chaos,
    random: u64,
    connected: bool,
    pub(crate) reachable: std::sync::Arc<std::sync::atomic::AtomicBool>,
    /// The next request fails with a connection reset.
    pub(crate) reset_next: std::sync::Arc<std::sync::atomic::AtomicBool>,
    /// The next write that withdraws a result is lost; the press is unreachable afterwards.
    pub(crate) lose_withdrawal: std::sync::Arc<std::sync::atomic::AtomicBool>,
}

impl MemoryLink {
    pub(crate) fn new(plc: SharedPlc, chaos: Chaos, seed: u64) -> Self {
        let reachable = std::sync::Arc::new(true.into());
        let (reset_next, lose_withdrawal) = Default::default();
        Self { plc, chaos, random: seed | 1, connected: false, reachable, reset_next, lose_withdrawal }
    }

    /// Returns whether this request is the planned lost one.
    fn withdraws(&self, request: &Request) -> bool {
        let Request::Write { start, words } = request else { return false };
        self.plc.lock().unwrap().would_withdraw(*start, words)
            && self.lose_withdrawal.swap(false, std::sync::atomic::Ordering::SeqCst)
    }

    /// Returns a number below 1000 from xorshift64*.
    fn chance(&mut self) -> u32 {
        self.random ^= self.random >> 12;
        self.random ^= self.random << 25;
        self.random ^= self.random >> 27;
        (self.random.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 33) as u32 % 1000
    }
}

impl Link for MemoryLink {
    fn peer(&self) -> String {
        "memory".into()
    }

    async fn connect(&mut self) -> Result<(), TransportError> {
        if !self.reachable.load(std::sync::atomic::Ordering::SeqCst) {
            return Err(std::io::Error::from(std::io::ErrorKind::ConnectionRefused).into());
        }
        self.connected = true;
        Ok(())
    }

    async fn call(&mut self, request: &Request) -> Result<Response, TransportError> {
        if !self.connected || !self.reachable.load(std::sync::atomic::Ordering::SeqCst) {
            return Err(TransportError::NotConnected);
        }
        if self.withdraws(request) {
            self.reachable.store(false, std::sync::atomic::Ordering::SeqCst);
            return Err(TransportError::NotConnected);
        }
        tokio::time::sleep(Duration::from_micros(200)).await;
        let reset = self.reset_next.swap(false, std::sync::atomic::Ordering::SeqCst);
        if reset || self.chance() < self.chaos.reset {
            return Err(std::io::Error::from(std::io::ErrorKind::ConnectionReset).into());
        }
        let late = self.chance() < self.chaos.late;
        let lost = self.chance() < self.chaos.lost;
        let response = {
            let mut plc = self.plc.lock().unwrap();
            match request {
                Request::Read { start, count, .. } => plc.read(*start, *count).map(Response::Words),
                Request::Write { start, words } => plc
                    .write(*start, words)
                    .then_some(Response::Written { start: *start, count: words.len() as u16 }),
                Request::Identify => Some(Response::Exception(1)),
            }
        };
        if late {
            let wait = 200 + u64::from(self.chance());
            tokio::time::sleep(Duration::from_millis(wait)).await;
        }
        if lost {
            std::future::pending::<()>().await;
        }
        Ok(response.unwrap_or(Response::Exception(2)))
    }

    fn disconnect(&mut self) {
        self.connected = false;
    }
}
