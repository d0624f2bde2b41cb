//! Header and trailer of a scan.

/// Header of a scan, before its first column.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ScanHeader {
    /// Number of rows of the lattice.
    pub n_rows: u32,
    /// Number of columns expected by the driver.
    pub n_columns: u32,
    /// Nominal azimuth of column 0, radians.
    pub azimuth_start: f64,
    /// Angle between neighbouring columns, radians, positive.
    pub azimuth_step: f64,
    /// Nominal elevation of row 0, radians; rows go down from here.
    pub elevation_start: f64,
    /// Angle between neighbouring rows, radians, positive.
    pub elevation_step: f64,
    /// First column of the second face where the scan has two faces: that of the back face, or of the front face where
    /// the head turns clockwise.
    pub seam_column: Option<u32>,
    /// Smallest and largest intensity that the instrument can report.
    pub intensity_range: (u16, u16),
    /// True when the scan was simulated.
    pub simulated: bool,
    /// Maker, model and serial number, as far as known.
    pub instrument: String,
    /// Time of the scan, seconds since 1970 UTC, where known.
    pub acquired_unix_s: Option<f64>,
    /// Range error that neighbouring cells share and averaging does not reduce, one standard deviation, metres, as
    /// stated by the instrument's data sheet; `None` where it is not known.
    pub range_error_m: Option<f64>,
    /// Decisions and changes of the driver, one sentence each (orientation, units, handedness).
    pub notes: Vec<String>,
}

/// Outcome of a scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Outcome {
    /// All columns were sent.
    #[default]
    Complete,
    /// Stopped on request.
    Aborted,
    /// Ended by a fault.
    Failed,
}

/// Trailer of a scan, after its last column; a scan without one is not used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ScanEnd {
    /// Number of columns sent.
    pub columns: u32,
    /// Number of valid cells sent.
    pub points: u64,
    /// Number of columns at the start, in time, that are laser warm-up and must not be used.
    pub warm_up_columns: u32,
    /// Outcome.
    pub outcome: Outcome,
}
