//! State shared by the cycle of the program, the Modbus server, the relay and the control port.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::watch;
use tokio::time::Instant;

use crate::config::Config;
use crate::faults::{LineFault, LineFaults};
use crate::press::Press;
use crate::registers::Table;
use crate::{Error, Result};

/// Press and its registers.
#[derive(Debug)]
pub(crate) struct Machine {
    pub(crate) press: Press,
    pub(crate) table: Table,
}

/// Faults of the line.
#[derive(Debug)]
pub(crate) struct Line {
    pub(crate) faults: LineFaults,
    pub(crate) random: fastrand::Rng,
    pub(crate) frozen_until: Option<Instant>,
    pub(crate) pulled_until: Option<Instant>,
}

/// State shared by the tasks of one press.
#[derive(Debug)]
pub(crate) struct Shared {
    machine: Mutex<Machine>,
    line: Mutex<Line>,
    started: Instant,
    /// Number of cycles.
    pub(crate) cycles: watch::Sender<u64>,
    /// Incremented to cut all connections.
    pub(crate) cuts: watch::Sender<u64>,
    /// Set to true to stop the press.
    pub(crate) stop: watch::Sender<bool>,
}

impl Shared {
    pub(crate) fn new(config: &Config) -> Result<Self> {
        Ok(Self {
            machine: Mutex::new(Machine {
                press: Press::new(config)?,
                table: Table::new(config.p_base, config.h_base, config.advice_base),
            }),
            line: Mutex::new(Line {
                faults: config.line_faults.clone(),
                random: fastrand::Rng::with_seed(config.seed),
                frozen_until: None,
                pulled_until: None,
            }),
            started: Instant::now(),
            cycles: watch::Sender::new(0),
            cuts: watch::Sender::new(0),
            stop: watch::Sender::new(false),
        })
    }

    /// Returns the time since the start.
    pub(crate) fn now(&self) -> Duration {
        self.started.elapsed()
    }

    pub(crate) fn machine(&self) -> MutexGuard<'_, Machine> {
        self.machine.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn line(&self) -> MutexGuard<'_, Line> {
        self.line.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Executes one cycle of the controller.
    pub(crate) fn cycle(&self) -> Result<()> {
        let mut machine = self.machine();
        // Under the lock: the press never sees a time before that of an earlier command.
        let now = self.now();
        let Machine { press, table } = &mut *machine;
        let restarts = press.counters.restarts;
        press.step(table, now)?;
        if press.counters.restarts != restarts {
            self.cut();
        }
        // Under the lock as well: the cycle counted next contains every command executed before.
        self.cycles.send_modify(|cycle| *cycle += 1);
        Ok(())
    }

    /// Waits until the registers show the commands executed so far, or the press stops.
    pub(crate) async fn next_cycle(&self) {
        let mut cycles = self.cycles.subscribe();
        tokio::select! {
            _ = cycles.changed() => {}
            () = self.stopped() => {}
        }
    }

    /// Cuts all connections.
    pub(crate) fn cut(&self) {
        self.cuts.send_modify(|cut| *cut += 1);
    }

    /// Draws the fault of the next request and counts it.
    pub(crate) fn draw_line_fault(&self) -> Option<LineFault> {
        let mut line = self.line();
        let Line { faults, random, .. } = &mut *line;
        let fault = faults.draw(random)?;
        drop(line);
        *self.machine().press.counters.line_faults.entry(format!("{fault:?}")).or_default() += 1;
        Some(fault)
    }

    /// Waits until the line is no longer frozen.
    pub(crate) async fn thaw(&self) {
        loop {
            let until = self.line().frozen_until;
            match until {
                Some(until) if until > Instant::now() => tokio::time::sleep_until(until).await,
                _ => return,
            }
        }
    }

    /// Waits until the serial adapter is plugged in.
    pub(crate) async fn plugged_in(&self) {
        let until = self.line().pulled_until.take();
        if let Some(until) = until {
            tokio::time::sleep_until(until).await;
        }
    }

    /// Waits for the request to stop.
    pub(crate) async fn stopped(&self) {
        let mut stop = self.stop.subscribe();
        // An error would mean that the sender was dropped, but it is in `self`.
        let _ = stop.wait_for(|&stop| stop).await;
    }

    /// Waits until `holds` is true of the counters.
    pub(crate) async fn until(
        &self,
        what: &str,
        limit: Duration,
        holds: impl Fn(&crate::counters::Counters) -> bool,
    ) -> Result<crate::counters::Counters> {
        let mut cycles = self.cycles.subscribe();
        let wait = async {
            loop {
                if let Some(counters) =
                    Some(&self.machine().press.counters).filter(|counters| holds(counters))
                {
                    return counters.clone();
                }
                // The sender is in `self`: this cannot fail.
                let _ = cycles.changed().await;
            }
        };
        match tokio::time::timeout(limit, wait).await {
            Ok(counters) => Ok(counters),
            Err(_) => {
                let counters = serde_json::to_string(&self.machine().press.counters).unwrap_or_default();
                Err(Error::Late { what: what.to_owned(), limit, counters })
            }
        }
    }
}
