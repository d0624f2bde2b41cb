//! Conformance tests of a scan bridge over TCP, for `platen bridge check`.
//!
//! They test the scan bridge protocol 1.0 and are written from its document alone (`drivers/faro-stream/PROTOCOL.md`).
//!
//! The tests act as a driver of their own. Each test opens new connections. Tests that scan use the given settings, and
//! the scanner turns. A test that the answers of the bridge make impossible (for example, the scan has already ended)
//! is left out and gives the reason.

mod client;
mod hello;
mod hostile;
mod scans;

use std::cell::OnceCell;
use std::net::SocketAddr;
use std::time::{Duration, Instant};

use serde_json::Value as Json;

use crate::{Outcome, Verdict};
use scans::Recorded;

/// Bridge under test: its address, members of Start, limits, and the scan that several tests use.
#[derive(Debug)]
pub struct BridgeSubject {
    address: SocketAddr,
    /// Members of Start beside the job: `divisor`, `rate_kpts`, `compression`, `window`.
    settings: Json,
    /// Longest time of a scan.
    limit: Duration,
    /// Prefix of job names that no earlier run has used.
    run: String,
    /// Scan that several tests use, made once.
    scan: OnceCell<Result<Recorded, String>>,
}

impl BridgeSubject {
    /// Prepares the tests of the bridge at an address.
    #[must_use]
    pub fn new(address: SocketAddr, settings: Json, limit: Duration) -> Self {
        let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default();
        let run = format!("check-{}-{}", std::process::id(), now.as_millis());
        Self { address, settings, limit, run, scan: OnceCell::new() }
    }
}

/// A test of a bridge.
struct Test {
    name: &'static str,
    demands: &'static str,
    run: fn(&BridgeSubject) -> Result<(), Verdict>,
}

impl Test {
    const fn new(
        name: &'static str,
        demands: &'static str,
        run: fn(&BridgeSubject) -> Result<(), Verdict>,
    ) -> Self {
        Self { name, demands, run }
    }
}

/// Runs the tests whose names contain `only`, and reports each. Without an answer to Hello the others are left out.
pub fn run_bridge(
    subject: &BridgeSubject,
    only: Option<&str>,
    mut report: impl FnMut(&Outcome),
) -> Vec<Outcome> {
    let mut outcomes: Vec<Outcome> = Vec::new();
    let mut dumb = None;
    let all = hello::TESTS.iter().chain(scans::TESTS).chain(hostile::TESTS);
    for test in all.filter(|test| only.is_none_or(|only| test.name.contains(only))) {
        let start = Instant::now();
        let verdict = match &dumb {
            Some(why) => Verdict::LeftOut(String::clone(why)),
            None => (test.run)(subject).err().unwrap_or(Verdict::Passed),
        };
        if test.name == hello::TESTS[0].name && matches!(verdict, Verdict::Failed(_)) {
            dumb = Some(format!("{} has not passed", test.name));
        }
        let seconds = start.elapsed().as_secs_f64();
        let outcome = Outcome { test: test.name, level: 2, demands: test.demands, verdict, seconds };
        report(&outcome);
        outcomes.push(outcome);
    }
    outcomes
}
