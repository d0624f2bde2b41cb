//! Results of a stroke's stages: the plate after the scan and after the measurement.

use std::time::Duration;

use platen_scan::ScanHeader;

use super::Measurement;
use crate::outline::Outline;
use crate::{Blank, Patch};

/// A plate after its scan: the scanned face and properties of the scan.
#[derive(Debug)]
pub struct Scanned {
    /// Header of the scan, as the driver sent it.
    pub header: ScanHeader,
    /// Number of valid cells of the whole scan.
    pub n_valid: u64,
    /// Number of columns before the laser was warm; they are not used.
    pub warm_up_columns: u32,
    /// The plate's scanned face.
    pub patch: Patch,
    /// Time from the start to the last column.
    pub acquire: Duration,
    /// Time from the last column to the patch.
    pub extract: Duration,
}

/// A plate after its measurement.
#[derive(Debug)]
pub struct Measured {
    /// Corners and edges.
    pub outline: Outline,
    /// The blank's outline, to which (u, v) refer; without one they refer to the rectangle as ordered.
    pub blank: Option<Blank>,
    /// Mid-surface, mesh, chart, S(u, v).
    pub measurement: Measurement,
    /// Time from patch to outline.
    pub outline_time: Duration,
}
