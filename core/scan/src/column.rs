//! Column of the lattice: one vertical sweep of the mirror.

/// Side of the mirror's rotation that measured a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Face {
    /// The beam goes out on the side of the head's azimuth.
    #[default]
    Front,
    /// The beam goes over the zenith and comes down on the other side.
    Back,
}

/// State of one cell. A gap is a state, never a range of 0 or NaN.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum State {
    /// Range and direction were measured.
    Valid = 0,
    /// Only the direction is known.
    DirectionOnly = 1,
    /// No echo was received.
    #[default]
    NoReturn = 2,
}

/// One vertical sweep of the mirror at one azimuth, rows from top to bottom.
///
/// All vectors have one entry per row from `first_row` on. `azimuth` and `elevation` are the true directions of the
/// beams (radians), which may differ from those of an ideal lattice. `range_m` is undefined unless the state is
/// [`State::Valid`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Column {
    /// Place in the lattice, by increasing azimuth.
    pub index: u32,
    /// Side of the mirror's rotation.
    pub face: Face,
    /// Row of the first entry.
    pub first_row: u32,
    /// Distance along the beam, metres.
    pub range_m: Vec<f64>,
    /// True azimuth of each beam, radians.
    pub azimuth: Vec<f64>,
    /// True elevation of each beam, radians.
    pub elevation: Vec<f64>,
    /// Raw reflectance in the range that the header declares.
    pub intensity: Vec<u16>,
    /// State of each cell.
    pub state: Vec<State>,
}

/// Reason why a column cannot be part of a lattice.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of a variant names its fields")]
pub enum ColumnError {
    /// The vectors of the column differ in length.
    #[error("column {index}: {field} has {found} entries, range_m has {expected}")]
    Length { index: u32, field: &'static str, found: usize, expected: usize },
    /// The column does not fit into the rows of the lattice.
    #[error("column {index} covers rows {first_row}..{end}, the lattice has {n_rows}")]
    Rows {
        index: u32,
        first_row: u32,
        /// One past the last row.
        end: u64,
        n_rows: u32,
    },
    /// A range or an angle that no scanner measures, in a valid cell.
    #[error(
        "column {index} row {row}: range {range_m} m, azimuth {azimuth}, elevation {elevation} is not a measurement"
    )]
    NotFinite {
        index: u32,
        row: u32,
        range_m: f64,
        /// Radians.
        azimuth: f64,
        /// Radians.
        elevation: f64,
    },
}

impl Column {
    /// Number of bytes of one sample: range, two angles, intensity, state.
    pub const SAMPLE_BYTES: usize = 3 * size_of::<f64>() + size_of::<u16>() + size_of::<State>();

    /// Returns the number of rows.
    pub fn len(&self) -> usize {
        self.range_m.len()
    }

    /// Returns whether the column has no rows.
    pub fn is_empty(&self) -> bool {
        self.range_m.is_empty()
    }

    /// Checks lengths, rows and numbers: a checked column has no NaN in a measured cell.
    ///
    /// # Errors
    /// The first fault, with its place.
    pub fn check(&self, n_rows: u32) -> Result<(), ColumnError> {
        let expected = self.len();
        for (field, found) in [
            ("azimuth", self.azimuth.len()),
            ("elevation", self.elevation.len()),
            ("intensity", self.intensity.len()),
            ("state", self.state.len()),
        ] {
            if found != expected {
                return Err(ColumnError::Length { index: self.index, field, found, expected });
            }
        }
        let end = u64::from(self.first_row) + expected as u64;
        if end > u64::from(n_rows) {
            return Err(ColumnError::Rows { index: self.index, first_row: self.first_row, end, n_rows });
        }
        let angles = self.azimuth.iter().zip(&self.elevation);
        let unsound = |((state, r), (az, el)): ((&State, &f64), (&f64, &f64))| match state {
            State::Valid => !(r.is_finite() && *r > 0.0 && az.is_finite() && el.is_finite()),
            State::DirectionOnly => !(az.is_finite() && el.is_finite()),
            State::NoReturn => false,
        };
        if let Some(i) = self.state.iter().zip(&self.range_m).zip(angles).position(unsound) {
            return Err(ColumnError::NotFinite {
                index: self.index,
                row: self.first_row + i as u32,
                range_m: self.range_m[i],
                azimuth: self.azimuth[i],
                elevation: self.elevation[i],
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column() -> Column {
        Column {
            index: 3,
            first_row: 1,
            range_m: vec![1.0, 2.0],
            azimuth: vec![0.1; 2],
            elevation: vec![0.2, 0.1],
            intensity: vec![9; 2],
            state: vec![State::Valid; 2],
            ..Column::default()
        }
    }

    #[test]
    fn a_sound_column_passes() {
        assert_eq!(column().check(3), Ok(()));
    }

    #[test]
    fn what_no_scanner_measures_is_refused_with_its_place() {
        assert!(matches!(column().check(2), Err(ColumnError::Rows { end: 3, n_rows: 2, .. })));
        let mut bad = column();
        bad.range_m[1] = f64::NAN;
        assert!(matches!(bad.check(3), Err(ColumnError::NotFinite { row: 2, .. })));
        bad.state[1] = State::NoReturn;
        assert_eq!(bad.check(3), Ok(()));
        bad.azimuth.pop();
        assert!(matches!(bad.check(3), Err(ColumnError::Length { field: "azimuth", .. })));
    }
}
