//! JSON messages of the protocol, sections 2 to 7 of its document.

use serde::{Deserialize, Serialize};

/// Angular window, radians.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Window {
    /// First azimuth.
    pub azimuth_start: f64,
    /// Width towards increasing azimuth.
    pub azimuth_width: f64,
    /// Lowest elevation.
    pub elevation_min: f64,
    /// Highest elevation.
    pub elevation_max: f64,
}

/// Settings of a scan, requested or planned.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ScanSettings {
    /// Resolution 1/divisor.
    pub divisor: u32,
    /// Thousands of points per second.
    pub rate_kpts: u32,
    /// Averaging n: n^2 samples become one.
    #[serde(default = "one")]
    pub compression: u32,
    /// Angular window; `None`: everything.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub window: Option<Window>,
}

fn one() -> u32 {
    1
}

/// Content of a record of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Values {
    /// Range and intensity.
    Range,
    /// Range, intensity, and angular deviation of the beam from the regular lattice.
    Polar,
}

/// ScanBegin without its job: the lattice in the order of transmission.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ScanLayout {
    /// Number of rows.
    pub rows: u32,
    /// Number of columns.
    pub columns: u32,
    /// Azimuth of column 0, radians.
    pub azimuth_start: f64,
    /// Azimuth step, radians.
    pub azimuth_step: f64,
    /// Elevation of row 0, radians.
    pub elevation_start: f64,
    /// Elevation step, radians.
    pub elevation_step: f64,
    /// Content of a record.
    pub values: Values,
    /// Unit of range, metres.
    pub range_unit_m: f64,
    /// Lowest and highest intensity.
    pub intensity: [u16; 2],
    /// First column of the back face.
    pub seam_column: Option<u32>,
    /// Number of columns at the start of each face that must not be used.
    pub warm_up_columns: u32,
    /// `azimuth` or `time`.
    pub order: String,
    /// Manufacturer, model, serial number.
    pub instrument: String,
    /// Seconds since 1970, when known.
    pub acquired_unix_s: Option<f64>,
    /// Range error of the data sheet, one standard deviation, metres; absent when not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub range_error_m: Option<f64>,
    /// True for a simulated scan.
    pub simulated: bool,
    /// Deviations from the requested settings.
    #[serde(default)]
    pub altered: Vec<String>,
}

/// Message ScanBegin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct ScanBegin {
    pub(super) job: String,
    #[serde(flatten)]
    pub(super) begin: ScanLayout,
}

/// Message ScanEnd.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct ScanEnd {
    pub(super) outcome: Outcome,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) reason: Option<String>,
    pub(super) columns: u32,
    pub(super) points: u64,
    pub(super) digest: u32,
}

/// Outcome of a scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Outcome {
    Complete,
    Aborted,
    Failed,
}

#[derive(Debug, Deserialize)]
pub(super) struct Hello {
    pub(super) versions: [[u8; 2]; 2],
    pub(super) client: String,
    pub(super) role: Role,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Role {
    Controller,
    Monitor,
}

#[derive(Debug, Deserialize)]
pub(super) struct Start {
    pub(super) job: String,
    #[serde(flatten)]
    pub(super) settings: ScanSettings,
}

#[derive(Debug, Deserialize)]
pub(super) struct Abort {
    pub(super) job: String,
}

#[derive(Debug, Deserialize)]
pub(super) struct Resume {
    pub(super) job: String,
    /// First and last column of each run.
    pub(super) missing: Vec<[u32; 2]>,
}

/// Message Error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Refusal {
    pub(super) code: &'static str,
    pub(super) text: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) retry_ms: Option<u64>,
}

impl Refusal {
    pub(super) fn new(code: &'static str, text: impl Into<String>) -> Self {
        Self { code, text: text.into(), retry_ms: None }
    }

    pub(super) fn retry(self, retry_ms: u64) -> Self {
        Self { retry_ms: Some(retry_ms), ..self }
    }
}

#[derive(Debug, Serialize)]
pub(super) struct Status {
    pub(super) state: &'static str,
    pub(super) progress: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) temperature_c: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) battery: Option<f64>,
    pub(super) tilt_deg: f64,
    pub(super) dirty: bool,
    pub(super) exceptions: Vec<Exception>,
    pub(super) time_ns: u64,
    pub(super) synced: bool,
}

#[derive(Debug, Serialize)]
pub(super) struct Exception {
    pub(super) level: u8,
    pub(super) text: String,
}
