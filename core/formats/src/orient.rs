//! Orientation, handedness and units of a stored lattice, decided from its geometry.
//!
//! File formats disagree on what a row is, where row 0 lies, which way columns run and in which unit they are
//! written, and their headers are no help: names are swapped, counts lie. So nothing here trusts a name. A
//! [`Survey`] sees every stored cell once and keeps sums per row and per column; [`Survey::decide`] correlates
//! rows and columns with elevation and unwrapped azimuth and gives a [`Plan`]; an [`Assembler`] sees the cells
//! again and applies it, so that a scan larger than memory can be read twice but is never held. The result is
//! the order of this crate: row 0 at the top, columns by increasing azimuth counter-clockwise seen from above,
//! right-handed, metres.
//!
//! What geometry cannot tell: a mirrored scan looks like a real one whose head turned the other way. It is
//! found only when the frame says so ([`Expected::mirror`]) or the direction of turning is known
//! ([`Expected::turn`]). Which face of the mirror measured a column is not stored in any lattice file.

mod apply;
mod decide;
mod fit;
mod intensity;
mod occupancy;
mod own;
mod survey;

pub use apply::Assembler;
pub use decide::{Plan, Unit};
pub use survey::Survey;

use platen_scan::{Direction, State};

/// One cell as a file stores it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RawCell {
    /// What the file calls row.
    pub row: u32,
    /// What the file calls column.
    pub column: u32,
    /// Position in the file's own unit and frame; any point on the beam when only its direction is known.
    pub xyz: [f64; 3],
    /// The same place as range and direction, where the file stores these: they are kept to the last bit.
    pub beam: Option<(f64, Direction)>,
    /// In the file's own scale.
    pub intensity: f64,
    /// What the file says of the cell. A valid cell at the origin or without finite numbers counts as missing.
    pub state: State,
}

/// Which way columns run by growing index, seen from above.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Turn {
    /// As the head of most instruments turns.
    Clockwise,
    /// By growing azimuth.
    CounterClockwise,
}

/// How to make a left-handed frame right-handed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mirror {
    /// The frame is right-handed.
    #[default]
    None,
    /// x changes its sign.
    X,
    /// y changes its sign.
    Y,
}

/// What is known of a scan besides its cells.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Expected {
    /// Smallest and largest intensity that the file declares.
    pub intensity: Option<(f64, f64)>,
    /// Which way columns run in the files of this instrument, where that is known; the other way is a mirrored
    /// scan.
    pub turn: Option<Turn>,
    /// Set when the frame of the file is left-handed.
    pub mirror: Mirror,
    /// Azimuth (radians) at which a full circle is cut open; where the file begins when not given.
    pub cut_azimuth: Option<f64>,
}

/// Why stored cells are not a lattice of a scan.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum OrientError {
    /// No scanner has so many rows or columns.
    #[error(
        "cell (row {row}, column {column}) lies outside of any scanner's lattice ({max} rows or columns at most)"
    )]
    IndexOutOfRange {
        /// Stored row.
        row: u32,
        /// Stored column.
        column: u32,
        /// Largest number of either.
        max: u32,
    },
    /// A cell comes twice.
    #[error(
        "cell (row {row}, column {column}) comes twice: rows and columns were lost; export a structured scan"
    )]
    DuplicateCell {
        /// Stored row.
        row: u32,
        /// Stored column.
        column: u32,
    },
    /// The indices spread over far more cells than there are.
    #[error(
        "{cells} cells spread over {n_rows} x {n_columns} places ({percent:.2} %, at least {needed} % needed): the scan was thinned out; export every point"
    )]
    TooSparse {
        /// Cells stored.
        cells: u64,
        /// Rows between the first and the last.
        n_rows: u32,
        /// Columns between the first and the last.
        n_columns: u32,
        /// Share of places filled.
        percent: f64,
        /// Share needed.
        needed: f64,
    },
    /// Nothing or next to nothing was measured.
    #[error(
        "{valid} valid cells in {n_rows} rows and {n_columns} columns: too few to tell rows from columns (3 x 3 needed)"
    )]
    TooSmall {
        /// Valid cells.
        valid: u64,
        /// Rows with valid cells.
        n_rows: u32,
        /// Columns with valid cells.
        n_columns: u32,
    },
    /// Neither way of reading rows and columns follows the angles.
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
    /// Neither metres nor millimetres.
    #[error(
        "half of the {valid} ranges are {side} {limit}: neither metres nor millimetres; export in metres"
    )]
    Unit {
        /// Valid cells.
        valid: u64,
        /// "above" or "below".
        side: &'static str,
        /// The limit.
        limit: f64,
    },
    /// Columns run against the known direction.
    #[error(
        "columns run {found}, this scanner's run {expected}: the file is mirrored; export in a right-handed frame, or set mirror"
    )]
    Mirrored {
        /// Direction found.
        found: &'static str,
        /// Direction expected.
        expected: &'static str,
    },
    /// The second pass met other cells than the first.
    #[error(
        "the scan changed while it was read ({expected} cells in the first pass, {found} in the second); wait until it is complete"
    )]
    Changed {
        /// Cells in the first pass.
        expected: u64,
        /// Cells in the second.
        found: u64,
    },
}

impl Turn {
    fn says(self) -> &'static str {
        match self {
            Self::Clockwise => "clockwise",
            Self::CounterClockwise => "counter-clockwise",
        }
    }
}

/// Range below which a cell flagged valid holds no measurement, in the file's unit: writers that have no flag
/// store missing cells at the origin, some of them through a transform that leaves rounding noise.
const NO_RANGE: f64 = 1e-6;

/// Range above which a number is no measurement in any unit.
const NO_NUMBER: f64 = 1e12;

/// State of a cell after a look at its numbers.
fn true_state(cell: &RawCell) -> State {
    let [x, y, z] = cell.xyz;
    let range2 = x * x + y * y + z * z;
    let measured = (NO_RANGE * NO_RANGE..NO_NUMBER * NO_NUMBER).contains(&range2);
    if measured { cell.state } else { State::NoReturn }
}

#[cfg(test)]
mod tests;
