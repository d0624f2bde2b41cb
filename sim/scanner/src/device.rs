//! Resolutions, measuring rates and scan times of a phase scanner of the FARO Focus family.
//!
//! A mirror rotates about a horizontal axis while the head rotates about the vertical. Each turn of the mirror writes
//! one column on the front face and one on the back face, so that half a turn of the head covers the full circle.
//! Figures are from published control code and the maker's table, whose times are reproduced to a second.

use std::f64::consts::{PI, TAU};

/// Columns of a full circle at resolution 1/1.
const FULL_COLUMNS: f64 = 40_960.0;

/// Highest mirror frequency, Hz. The permitted pairs of resolution and rate are exactly those below it.
const FASTEST_MIRROR: f64 = 97.0;

/// Rate at which the data sheet states its noise, points per second, and that noise at 10 m on mill scale at 60
/// degrees, metres: 0.6 mm at 90 % reflectivity, weaker echoes by the power 0.35.
const QUIET: (f64, f64) = (122e3, 1.06e-3);

/// Time until the mirror is at speed, seconds.
const SPIN_UP: f64 = 9.0;

/// Time after the last column until the scan's file no longer changes, seconds.
const SETTLE: f64 = 12.0;

/// Scan mode of a device: resolution, measuring rate and noise compression.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Device {
    divisor: u32,
    rate: f64,
    averaged: u32,
}

/// Error of an invalid scan mode.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum DeviceError {
    /// Unknown resolution.
    #[error(
        "resolution 1/{divisor} does not exist; choose 1/1, 1/2, 1/4, 1/5, 1/8, 1/10, 1/16, 1/20 or 1/32"
    )]
    Resolution {
        /// Requested value.
        divisor: u32,
    },
    /// Unknown measuring rate.
    #[error("{rate_kpts} kpts/s does not exist; choose 122, 244, 488 or 976")]
    Rate {
        /// Requested value.
        rate_kpts: u32,
    },
    /// Unknown noise compression.
    #[error("noise compression {compression} does not exist; choose 1, 2 or 4")]
    Compression {
        /// Requested value.
        compression: u32,
    },
    /// Mirror frequency above the limit.
    #[error(
        "1/{divisor} at {rate_kpts} kpts/s requires a mirror frequency of {mirror_hz:.0} Hz, at most 97 Hz are possible; choose a lower rate"
    )]
    Mirror {
        /// Requested value.
        divisor: u32,
        /// Requested value.
        rate_kpts: u32,
        /// Required mirror frequency.
        mirror_hz: f64,
    },
}

impl Device {
    /// Creates a mode of resolution 1/`divisor`, measuring rate, and noise compression (1: none; n: n^2 samples are
    /// averaged).
    ///
    /// # Errors
    /// [`DeviceError`] with the permitted values.
    pub fn new(divisor: u32, rate_kpts: u32, compression: u32) -> Result<Self, DeviceError> {
        if ![1, 2, 4, 5, 8, 10, 16, 20, 32].contains(&divisor) {
            return Err(DeviceError::Resolution { divisor });
        }
        if ![122, 244, 488, 976].contains(&rate_kpts) {
            return Err(DeviceError::Rate { rate_kpts });
        }
        if ![1, 2, 4].contains(&compression) {
            return Err(DeviceError::Compression { compression });
        }
        let device = Self { divisor, rate: 1e3 * f64::from(rate_kpts), averaged: compression };
        let mirror_hz = device.mirror_hz();
        if mirror_hz > FASTEST_MIRROR {
            return Err(DeviceError::Mirror { divisor, rate_kpts, mirror_hz });
        }
        Ok(device)
    }

    /// Returns the mirror frequency, turns per second.
    pub fn mirror_hz(&self) -> f64 {
        self.rate / FULL_COLUMNS * f64::from(self.divisor)
    }

    /// Returns the angle between columns and between rows, radians.
    pub fn step(&self) -> f64 {
        TAU / FULL_COLUMNS * f64::from(self.divisor * self.averaged)
    }

    /// Returns rows and columns of a full scan, from the zenith down to 62.5 degrees below the horizon.
    pub fn full_lattice(&self) -> [u32; 2] {
        let columns = FULL_COLUMNS / f64::from(self.divisor * self.averaged);
        [(columns * 152.5 / 360.0).round() as u32, columns.round() as u32]
    }

    /// Returns the sweep time of a horizontal window (radians), seconds. Up to half a circle only one face of each
    /// mirror turn is used; a vertical window saves no time.
    pub fn sweep_s(&self, width: f64) -> f64 {
        let full = FULL_COLUMNS / (2.0 * self.mirror_hz() * f64::from(self.divisor));
        full * (width / PI).min(1.0)
    }

    /// Returns the time from the command to a file that no longer changes, seconds: spin-up, sweep, settling.
    pub fn duration_s(&self, width: f64) -> f64 {
        SPIN_UP + self.sweep_s(width) + SETTLE
    }

    /// Returns the time after the command at which the share `done` of a window's columns is measured, seconds.
    pub fn column_s(&self, width: f64, done: f64) -> f64 {
        SPIN_UP + self.sweep_s(width) * done
    }

    /// Returns the standard deviation of a range at 10 m as defined by [`crate::Instrument::range_sigma`]: proportional
    /// to the root of the rate and inversely to compression.
    pub fn range_sigma(&self) -> f64 {
        let (rate, sigma) = QUIET;
        sigma * (self.rate / rate).sqrt() / f64::from(self.averaged)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn permitted_pairs_are_those_of_the_control_code() {
        let fastest = |divisor| match divisor {
            1 | 2 | 4 => 976,
            5 | 8 => 488,
            10 | 16 => 244,
            _ => 122,
        };
        for divisor in [1, 2, 4, 5, 8, 10, 16, 20, 32] {
            for rate in [122, 244, 488, 976] {
                assert_eq!(
                    Device::new(divisor, rate, 1).is_ok(),
                    rate <= fastest(divisor),
                    "1/{divisor} {rate}"
                );
            }
        }
        assert_eq!(Device::new(3, 122, 1), Err(DeviceError::Resolution { divisor: 3 }));
        assert!(Device::new(32, 976, 1).unwrap_err().to_string().contains("97 Hz"));
    }

    #[test]
    fn times_and_lattices_are_those_of_the_makers_table() {
        let seconds = |divisor, rate| Device::new(divisor, rate, 1).unwrap().sweep_s(TAU);
        // Minutes and seconds of the table, which rounds; rates are rounded too (976 for 976.6 kpts/s).
        for (divisor, rate, table) in [
            (1, 976, 860.0),
            (1, 122, 6876.0),
            (4, 976, 54.0),
            (4, 244, 215.0),
            (8, 488, 27.0),
            (32, 122, 7.0),
        ] {
            let found = seconds(divisor, rate);
            assert!((found - table).abs() < 0.5 + 0.002 * table, "1/{divisor} {rate}: {found}");
        }
        assert_eq!(Device::new(1, 976, 1).unwrap().full_lattice(), [17351, 40960]);
        assert_eq!(Device::new(4, 976, 1).unwrap().full_lattice(), [4338, 10240]);
        // A window of 60 degrees at 1/4, 244 kpts/s: a third of the table.
        let window = Device::new(4, 244, 1).unwrap();
        assert!((window.sweep_s(PI / 3.0) - 72.0).abs() < 1.0);
        assert!((90.0..100.0).contains(&window.duration_s(PI / 3.0)));
    }

    #[test]
    fn quality_costs_time_and_lowers_noise() {
        let [fast, slow] = [976, 122].map(|rate| Device::new(4, rate, 1).unwrap());
        assert!((fast.range_sigma() / slow.range_sigma() - 8_f64.sqrt()).abs() < 1e-12);
        let compressed = Device::new(4, 122, 4).unwrap();
        assert!((compressed.range_sigma() - slow.range_sigma() / 4.0).abs() < 1e-15);
        assert_eq!(compressed.full_lattice()[1], 2560);
    }
}
