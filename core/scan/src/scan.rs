//! What is said before the first column and after the last.

/// What a driver says before the first column.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ScanHeader {
    /// Rows of the lattice.
    pub n_rows: u32,
    /// Columns that will come, as far as the driver knows.
    pub n_columns: u32,
    /// Nominal azimuth of column 0, radians.
    pub azimuth_start: f64,
    /// Angle between neighbouring columns, radians, positive.
    pub azimuth_step: f64,
    /// Nominal elevation of row 0, radians; rows go down from here.
    pub elevation_start: f64,
    /// Angle between neighbouring rows, radians, positive.
    pub elevation_step: f64,
    /// First column of the other face where the scan has two: of the back face, of the front face where the head turns
    /// clockwise.
    pub seam_column: Option<u32>,
    /// Smallest and largest intensity that the instrument can report.
    pub intensity_range: (u16, u16),
    /// True when no real instrument stood there.
    pub simulated: bool,
    /// Maker, model and serial number, as far as known.
    pub instrument: String,
    /// Time of the scan, seconds since 1970 UTC, where the source knows it.
    pub acquired_unix_s: Option<f64>,
    /// What the driver decided or changed, one sentence each (orientation, units, handedness).
    pub notes: Vec<String>,
}

/// How a scan ended.
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

/// What a driver says after the last column. No end, no scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ScanEnd {
    /// Columns sent.
    pub columns: u32,
    /// Valid cells sent.
    pub points: u64,
    /// Columns at the start, in time, that are laser warm-up and must not be used.
    pub warm_up_columns: u32,
    /// How it ended.
    pub outcome: Outcome,
}
