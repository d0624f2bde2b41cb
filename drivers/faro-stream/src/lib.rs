//! Driver `faro-stream`: scans through a bridge, a small server beside the scanner's own software.
//!
//! The bridge implements the scan bridge protocol (`PROTOCOL.md` beside this crate, sufficient to write a bridge).
//!
//! # Method
//! The driver requests each scan under a job name of its own, so that a lost answer never causes a second scan. It
//! delivers columns as they arrive. After a broken connection it reconnects and resumes the scan; damaged columns are
//! requested again. A scan is complete only when every column has arrived and the CRC-32C digest over all of them
//! agrees. Late, repeated, shuffled or damaged frames therefore cannot produce an inconsistent lattice. Rows and
//! columns are brought into the host's order for either direction of rotation.
//!
//! # Example
//! ```toml
//! [scanner]
//! plugin = "faro-stream"
//! [scanner.options]
//! address = "192.168.43.20:7040"
//! divisor = 4
//! rate_kpts = 244
//! ```
//!
//! `platen plugins find faro-stream --option address=192.168.43.255:7040` lists the bridges of a network that answer.
//!
//! | key | meaning |
//! |---|---|
//! | `address` | host and port of the bridge |
//! | `client` | name of this host at the bridge; one per press |
//! | `divisor` | resolution 1/divisor |
//! | `rate_kpts` | thousands of points per second |
//! | `compression` | averaging n: n^2 samples become one |
//! | `serial` | required serial number of the scanner |

mod column;
mod device;
mod discovery;
mod error;
mod message;
mod session;
mod wire;

use std::time::{SystemTime, UNIX_EPOCH};

use platen_scan::Window;
use platen_sdk::{Device, Health, Info, Job, Result, ScanSink, Scanner, options};

use message::Settings;
use session::Request;

options! {
    /// Options of the driver, documented in the module head.
    pub struct Options {
        /// Host and port of the bridge.
        address: String;
        /// Name of this host at the bridge: one per press, unchanged over restarts.
        client: String = "platen";
        /// Resolution, as the divisor of the finest one.
        divisor: i64 = 4, min 1, max 32;
        /// Thousands of points per second.
        rate_kpts: i64 = 244, min 1, max 10000;
        /// Averaging n: n^2 samples become one.
        compression: i64 = 1, min 1, max 8;
        /// Required serial number of the scanner.
        serial: Option<String>;
    }
}

/// Driver `faro-stream`.
#[derive(Debug)]
pub struct FaroStream {
    options: Options,
    /// Start time, part of the job names of this run.
    run: u64,
    /// Last reported state of the instrument.
    health: Option<Health>,
}

impl Scanner for FaroStream {
    const INFO: Info = Info::new(
        c"faro-stream",
        c"Scan bridge",
        c"Receives scans from a bridge beside the scanner's own software; resumes after broken connections.",
        c"0.1.0",
    )
    .hardware();
    type Options = Options;

    fn new(options: Options) -> Result<Self> {
        let run = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_millis() as u64);
        Ok(Self { options, run, health: None })
    }

    fn open(&mut self) -> Result<()> {
        self.ask(None).map(drop)
    }

    fn estimate_s(&mut self, window: Option<&Window>) -> Option<f64> {
        self.ask(window).ok().flatten()
    }

    fn capture(&mut self, job: &Job<'_>, out: &mut ScanSink<'_>) -> Result<()> {
        let request = self.request(job.id(), out.window());
        let (health, ended) = device::scan(&self.options.address, request, out);
        self.health = health;
        ended.map_err(|error| error.at(&self.options.address))
    }

    fn discover(&mut self) -> Result<Vec<Device>> {
        discovery::bridges(&self.options.address, &self.options.client)
            .map_err(|error| error.at(&self.options.address))
    }

    fn health(&mut self) -> Option<Health> {
        self.health
    }
}

impl FaroStream {
    fn request(&self, job: u64, window: Option<&Window>) -> Request {
        let whole = |number: i64| u32::try_from(number).unwrap_or(1);
        Request {
            client: self.options.client.clone(),
            job: format!("{}-{:x}-{job}", self.options.client, self.run),
            settings: Settings {
                divisor: whole(self.options.divisor),
                rate_kpts: whole(self.options.rate_kpts),
                compression: whole(self.options.compression),
                window: window.map(Into::into),
            },
            serial: self.options.serial.clone(),
        }
    }

    fn ask(&mut self, window: Option<&Window>) -> Result<Option<f64>> {
        let request = self.request(0, window);
        self.health = None;
        let answer = device::ask(&self.options.address, &request, &request.settings, &mut self.health);
        answer.map_err(|error| error.at(&self.options.address))
    }
}

platen_sdk::export!(scanner FaroStream);

#[cfg(test)]
mod tests;
