//! Results of a stroke's stages: the plate after the scan and after the measurement.

use std::time::Duration;

use platen_scan::ScanHeader;

use super::Measurement;
use crate::outline::Outline;
use crate::{Blank, Patch};

/// A plate after its scan: the scanned face, and facts about the scan.
#[derive(Debug)]
pub struct Scanned {
    /// Header of the scan, as the driver sent it.
    pub header: ScanHeader,
    /// Valid cells of the whole scan.
    pub n_valid: u64,
    /// Columns before the laser was warm; they are not used.
    pub warm_up_columns: u32,
    /// The plate's scanned face.
    pub patch: Patch,
    /// From the start to the last column.
    pub acquire: Duration,
    /// From the last column to the patch.
    pub extract: Duration,
}

/// A plate after its measurement.
#[derive(Debug)]
pub struct Measured {
    /// Corners and edges.
    pub outline: Outline,
    /// The blank's outline, which (u, v) refer to; without one it is the rectangle as ordered.
    pub blank: Option<Blank>,
    /// Mid-surface, mesh, chart, S(u, v).
    pub measurement: Measurement,
    /// From patch to outline.
    pub outline_time: Duration,
}
