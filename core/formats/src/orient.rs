//! Orientation, handedness and units of a stored lattice by monotone fits of elevation and azimuth to row and column.
//!
//! Formats differ in the meaning of a row, the position of row 0, the direction of columns and the unit of coordinates.
//! Headers are unreliable: names are swapped, counts are wrong. The decision therefore uses the cells alone.
//!
//! 1. The first pass (`Survey`) keeps sums per row and per column.
//! 2. `Survey::decide` fits elevation to the row number and unwrapped azimuth to the column number by weighted least
//!    squares, also with rows and columns swapped. It requires correlations of 0.99 and returns a `Plan`.
//! 3. The second pass (`Assembly`) applies the plan to every cell.
//!
//! The result has row 0 at the top, columns by increasing azimuth (counter-clockwise seen from above), a right-handed
//! frame, and metres.
//!
//! Limits: a mirrored scan equals a real one whose head turns in the opposite direction. It is detected only when the
//! frame declares it ([`Expected::mirror`]) or the direction of rotation is known ([`Expected::turn`]). The mirror face
//! of a column is not stored in any lattice file.

mod apply;
mod decide;
mod fit;
mod intensity;
mod near_angle;
mod occupancy;
mod places;
mod restore;
mod spherical;
mod survey;

pub(crate) use apply::Assembly;
pub(crate) use decide::Plan;
use decide::Unit;
pub(crate) use spherical::{Converted, SphericalCells, ToSpherical};
pub(crate) use survey::Survey;

use platen_scan::{Direction, State};

/// A cell as stored in a file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RawCell {
    /// Row number in the file.
    pub(crate) row: u32,
    /// Column number in the file.
    pub(crate) column: u32,
    /// Position in the file's own unit and frame; any point on the beam when only its direction is known.
    pub(crate) position: Position,
    /// Intensity in the scale of the file.
    pub(crate) intensity: f64,
    /// State in the file. A valid cell at the origin or without finite numbers counts as missing.
    pub(crate) state: State,
}

/// Position of a cell as stored.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Position {
    /// x, y, z.
    Cartesian([f64; 3]),
    /// Range and direction.
    Spherical(f64, Direction),
}

/// Direction of columns by increasing index, seen from above.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Turn {
    /// Direction of rotation of most instruments.
    Clockwise,
    /// By increasing azimuth.
    CounterClockwise,
}

/// Correction of a left-handed frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mirror {
    /// The frame is right-handed.
    #[default]
    None,
    /// x is negated.
    X,
    /// y is negated.
    Y,
}

/// Declarations about a scan in addition to its cells.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Expected {
    /// Smallest and largest intensity that the file declares.
    pub intensity: Option<(f64, f64)>,
    /// Direction of columns in the files of this instrument, where it is known; the opposite one is a mirrored scan.
    pub turn: Option<Turn>,
    /// Set when the frame of the file is left-handed.
    pub mirror: Mirror,
    /// Azimuth (radians) at which a full circle is cut open; without it, the beginning of the file.
    pub cut_azimuth: Option<f64>,
}

/// Reason why stored cells are not the lattice of a scan.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of a variant names its fields")]
pub enum OrientError {
    /// A row or column number beyond any scanner.
    #[error(
        "cell (row {row}, column {column}) lies outside of any scanner's lattice ({max} rows or columns at most)"
    )]
    IndexOutOfRange {
        row: u32,
        column: u32,
        /// Largest number of either.
        max: u32,
    },
    /// Two cells at one place.
    #[error(
        "cell (row {row}, column {column}) comes twice: rows and columns were lost; export a structured scan"
    )]
    DuplicateCell { row: u32, column: u32 },
    /// Fewer cells than 2 % of the places between the first and the last row and column.
    #[error(
        "{cells} cells spread over {n_rows} x {n_columns} places ({percent:.2} %, at least {needed} % needed): the scan was thinned out; export every point"
    )]
    TooSparse {
        cells: u64,
        n_rows: u32,
        n_columns: u32,
        percent: f64,
        /// Share needed.
        needed: f64,
    },
    /// Fewer than 3 rows or columns with valid cells.
    #[error(
        "{valid} valid cells in {n_rows} rows and {n_columns} columns: too few to tell rows from columns (3 x 3 needed)"
    )]
    TooSmall { valid: u64, n_rows: u32, n_columns: u32 },
    /// Neither assignment of rows and columns follows the angles.
    #[error(
        "rows follow elevation by {rows_elevation:+.3} and columns azimuth by {columns_azimuth:+.3} (swapped: {columns_elevation:+.3}, {rows_azimuth:+.3}), 0.99 needed: the points are not seen from the origin of the file; export in the scanner's own frame, structured, without registration applied"
    )]
    NotALattice {
        /// Correlation of row with elevation.
        rows_elevation: f64,
        /// Correlation of column with azimuth.
        columns_azimuth: f64,
        /// Correlation of column with elevation.
        columns_elevation: f64,
        /// Correlation of row with azimuth.
        rows_azimuth: f64,
    },
    /// Ranges that are neither metres nor millimetres.
    #[error(
        "half of the {valid} ranges are {side} {limit}: neither metres nor millimetres; export in metres"
    )]
    Unit { valid: u64, side: &'static str, limit: f64 },
    /// Columns in the direction opposite to the known one.
    #[error(
        "columns run {found}, this scanner's run {expected}: the file is mirrored; export in a right-handed frame, or set mirror"
    )]
    Mirrored { found: &'static str, expected: &'static str },
    /// The second pass found other cells than the first.
    #[error(
        "the scan changed while it was read ({expected} cells in the first pass, {found} in the second); wait until it is complete"
    )]
    Changed {
        expected: u64,
        /// Number of cells in the second pass.
        found: u64,
    },
}

impl Turn {
    fn name(self) -> &'static str {
        match self {
            Self::Clockwise => "clockwise",
            Self::CounterClockwise => "counter-clockwise",
        }
    }
}

#[cfg(test)]
mod tests;
