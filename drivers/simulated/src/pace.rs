//! Timing of a scan as on a real scanner, scaled by a factor.

use crate::Options;
use crate::error::Error;
use platen_sdk::Result;
use platen_sim_scanner::Device;
use std::time::{Duration, Instant};

/// Longest sleep between two checks for cancellation.
const NAP: Duration = Duration::from_millis(40);

/// Schedule of a scan.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pace {
    device: Device,
    /// Width of the window, radians.
    width: f64,
    /// Factor to the real time.
    scale: f64,
}

impl Pace {
    /// Creates the schedule of a window; `None` when scans are not paced.
    pub(crate) fn new(options: &Options, width: f64) -> std::result::Result<Option<Self>, Error> {
        if options.time_scale == 0.0 {
            return Ok(None);
        }
        Ok(Some(Self { device: device(options)?, width, scale: options.time_scale }))
    }

    /// Returns the duration from trigger to end, seconds.
    pub(crate) fn duration_s(&self) -> f64 {
        self.scale * self.device.duration_s(self.width)
    }

    /// Waits until the share `done` of the columns is due.
    pub(crate) fn wait_for_column(
        &self,
        started: Instant,
        done: f64,
        check: impl FnMut() -> Result<()>,
    ) -> Result<()> {
        wait_until(started, self.scale * self.device.column_s(self.width, done), check)
    }

    /// Waits until the time at which a real scanner's file would be complete.
    pub(crate) fn wait_for_end(&self, started: Instant, check: impl FnMut() -> Result<()>) -> Result<()> {
        wait_until(started, self.duration_s(), check)
    }
}

/// Returns the scan mode whose step is nearest to the option `step_deg`.
pub(crate) fn device(options: &Options) -> std::result::Result<Device, Error> {
    let wanted = options.step_deg.to_radians();
    let off = |divisor: &u32| (f64::from(*divisor) * std::f64::consts::TAU / 40_960.0 / wanted).ln().abs();
    let divisors = [1, 2, 4, 5, 8, 10, 16, 20, 32];
    let nearest = divisors.into_iter().min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(1);
    let rate_kpts = options.rate_kpts.parse().unwrap_or(0);
    Device::new(nearest, rate_kpts, 1).map_err(|error| Error::Options(format!("rate_kpts: {error}")))
}

fn wait_until(started: Instant, due_s: f64, mut check: impl FnMut() -> Result<()>) -> Result<()> {
    let due = Duration::from_secs_f64(due_s);
    loop {
        let left = due.saturating_sub(started.elapsed());
        if left.is_zero() {
            return Ok(());
        }
        check()?;
        std::thread::sleep(left.min(NAP));
    }
}
