//! JSON messages of the protocol, sections 2 to 7 of `PROTOCOL.md`.
//!
//! A member that a bridge may omit is an `Option` or has a default.

use serde::{Deserialize, Serialize};

use platen_scan::Window;
use platen_sdk::Health;

#[derive(Debug, Serialize)]
pub(crate) struct Hello<'a> {
    pub(crate) versions: [(u8, u8); 2],
    pub(crate) client: &'a str,
    pub(crate) role: &'a str,
}

#[derive(Debug, Clone, Deserialize)]
pub(crate) struct Capabilities {
    pub(crate) version: (u8, u8),
    #[serde(default)]
    pub(crate) model: String,
    #[serde(default)]
    pub(crate) serial: String,
}

/// Requested settings of a scan.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Settings {
    pub(crate) divisor: u32,
    pub(crate) rate_kpts: u32,
    pub(crate) compression: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) window: Option<Region>,
}

/// Angular window, radians.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Region {
    azimuth_start: f64,
    azimuth_width: f64,
    elevation_min: f64,
    elevation_max: f64,
}

impl From<&Window> for Region {
    fn from(window: &Window) -> Self {
        Self {
            azimuth_start: window.azimuth_start,
            azimuth_width: window.azimuth_width,
            elevation_min: window.elevation_min,
            elevation_max: window.elevation_max,
        }
    }
}

#[derive(Debug, Clone, Deserialize)]
pub(crate) struct Configured {
    pub(crate) duration_s: Option<f64>,
}

#[derive(Debug, Serialize)]
pub(crate) struct Start<'a> {
    pub(crate) job: &'a str,
    #[serde(flatten)]
    pub(crate) settings: &'a Settings,
}

#[derive(Debug, Serialize)]
pub(crate) struct Abort<'a> {
    pub(crate) job: &'a str,
}

#[derive(Debug, Serialize)]
pub(crate) struct Resume<'a> {
    pub(crate) job: &'a str,
    /// First and last column of each run.
    pub(crate) missing: Vec<(u32, u32)>,
}

#[derive(Debug, Clone, Deserialize)]
pub(crate) struct Status {
    pub(crate) state: String,
    #[serde(default)]
    pub(crate) progress: f64,
    pub(crate) temperature_c: Option<f64>,
    pub(crate) battery: Option<f64>,
    pub(crate) tilt_deg: Option<f64>,
    #[serde(default)]
    pub(crate) dirty: bool,
    #[serde(default)]
    pub(crate) on_battery: bool,
    #[serde(default)]
    pub(crate) warming_up: bool,
    #[serde(default)]
    pub(crate) exceptions: Vec<Exception>,
}

impl Status {
    /// Returns the instrument's state; values that the bridge does not report stay unknown.
    pub(crate) fn health(&self) -> Health {
        Health {
            temperature_c: self.temperature_c,
            battery: self.battery,
            tilt: self.tilt_deg.map(f64::to_radians),
            dirty: self.dirty,
            on_battery: self.on_battery,
            warming_up: self.warming_up,
        }
    }
}

#[derive(Debug, Clone, Deserialize)]
pub(crate) struct Exception {
    pub(crate) level: u8,
    pub(crate) text: String,
}

#[derive(Debug, Clone, Deserialize)]
pub(crate) struct Refusal {
    pub(crate) code: String,
    #[serde(default)]
    pub(crate) text: String,
    pub(crate) retry_ms: Option<u64>,
}

/// Content of a record of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Values {
    /// Range and intensity; the beam lies on the regular lattice.
    Range,
    /// Range, intensity, and angular deviation of the beam from the regular lattice.
    Polar,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(crate) struct ScanBegin {
    pub(crate) job: String,
    pub(crate) rows: u32,
    pub(crate) columns: u32,
    pub(crate) azimuth_start: f64,
    pub(crate) azimuth_step: f64,
    pub(crate) elevation_start: f64,
    pub(crate) elevation_step: f64,
    pub(crate) values: Values,
    pub(crate) range_unit_m: f64,
    pub(crate) intensity: (u16, u16),
    pub(crate) seam_column: Option<u32>,
    #[serde(default)]
    pub(crate) warm_up_columns: u32,
    #[serde(default)]
    pub(crate) instrument: String,
    pub(crate) acquired_unix_s: Option<f64>,
    pub(crate) range_error_m: Option<f64>,
    #[serde(default)]
    pub(crate) simulated: bool,
    #[serde(default)]
    pub(crate) altered: Vec<String>,
}

#[derive(Debug, Clone, Deserialize)]
pub(crate) struct ScanEnd {
    pub(crate) outcome: String,
    #[serde(default)]
    pub(crate) reason: String,
    pub(crate) columns: u32,
    pub(crate) points: u64,
    pub(crate) digest: u32,
}
