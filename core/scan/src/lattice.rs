//! Lattice: a whole scan in memory.

use crate::{Column, ColumnError, Direction, Face, ScanHeader, State};

/// A scan as one lattice, stored column after column: cell index `column * n_rows + row`.
///
/// A cell takes 27 bytes; values are not rounded.
#[derive(Debug, Clone)]
pub struct Lattice {
    header: ScanHeader,
    n_columns: u32,
    present: Vec<Option<Face>>,
    range_m: Vec<f64>,
    azimuth: Vec<f64>,
    elevation: Vec<f64>,
    intensity: Vec<u16>,
    state: Vec<State>,
}

impl Lattice {
    /// Returns an empty lattice of the size in `header`.
    pub fn new(header: ScanHeader) -> Self {
        let n_columns = header.n_columns;
        let mut lattice = Self {
            header,
            n_columns: 0,
            present: Vec::new(),
            range_m: Vec::new(),
            azimuth: Vec::new(),
            elevation: Vec::new(),
            intensity: Vec::new(),
            state: Vec::new(),
        };
        lattice.grow(n_columns);
        lattice
    }

    fn grow(&mut self, n_columns: u32) {
        if n_columns > self.n_columns {
            self.n_columns = n_columns;
            let n = n_columns as usize * self.header.n_rows as usize;
            self.present.resize(n_columns as usize, None);
            self.range_m.resize(n, 0.0);
            self.azimuth.resize(n, 0.0);
            self.elevation.resize(n, 0.0);
            self.intensity.resize(n, 0);
            self.state.resize(n, State::NoReturn);
        }
    }

    /// Stores a column, in any order of arrival; a column that arrives again replaces the former one.
    ///
    /// # Errors
    /// As [`Column::check`].
    pub fn push(&mut self, column: &Column) -> Result<(), ColumnError> {
        column.check(self.header.n_rows)?;
        self.grow(column.index + 1);
        let start = column.index as usize * self.n_rows() + column.first_row as usize;
        for i in 0..column.len() {
            let cell = start + i;
            self.range_m[cell] = column.range_m[i];
            self.intensity[cell] = column.intensity[i];
            self.state[cell] = column.state[i];
            self.azimuth[cell] = column.azimuth[i];
            self.elevation[cell] = column.elevation[i];
        }
        self.present[column.index as usize] = Some(column.face);
        Ok(())
    }

    /// Returns the header of the scan.
    pub fn header(&self) -> &ScanHeader {
        &self.header
    }

    /// Returns the number of rows.
    pub fn n_rows(&self) -> usize {
        self.header.n_rows as usize
    }

    /// Returns the number of columns.
    pub fn n_columns(&self) -> usize {
        self.n_columns as usize
    }

    /// Returns the face of a column; `None` when the column has not arrived.
    pub fn face(&self, column: usize) -> Option<Face> {
        self.present[column]
    }

    /// Returns the index of a cell, for the methods below.
    pub fn cell(&self, column: usize, row: usize) -> usize {
        column * self.n_rows() + row
    }

    /// Returns the state of a cell.
    pub fn state(&self, cell: usize) -> State {
        self.state[cell]
    }

    /// Returns the range of a valid cell, metres.
    pub fn range(&self, cell: usize) -> Option<f64> {
        (self.state[cell] == State::Valid).then(|| self.range_m[cell])
    }

    /// Returns the raw intensity of a cell.
    pub fn intensity(&self, cell: usize) -> u16 {
        self.intensity[cell]
    }

    /// Returns the direction of a cell, where it is known.
    pub fn direction(&self, cell: usize) -> Option<Direction> {
        (self.state[cell] != State::NoReturn)
            .then(|| Direction { azimuth: self.azimuth[cell], elevation: self.elevation[cell] })
    }

    /// Returns the position of a valid cell, metres, scanner frame.
    pub fn point(&self, cell: usize) -> Option<[f64; 3]> {
        let range = self.range(cell)?;
        let unit = self.direction(cell)?.unit();
        Some(unit.map(|c| c * range))
    }

    /// Returns the number of valid cells.
    pub fn n_valid(&self) -> usize {
        self.state.iter().filter(|s| **s == State::Valid).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_come_back_in_any_arrival_order() {
        let header = ScanHeader {
            n_rows: 40,
            n_columns: 30,
            azimuth_start: 3.13,
            azimuth_step: 1e-3,
            elevation_start: -0.1,
            elevation_step: 2e-3,
            ..ScanHeader::default()
        };
        let column = |index: u32| Column {
            index,
            range_m: (0..40).map(|row| 5.0 + 0.01 * f64::from(row)).collect(),
            azimuth: (0..40).map(|row| 3.13 + 1e-3 * f64::from(index) + 1e-4 * f64::from(row % 3)).collect(),
            elevation: (0..40).map(|row| -0.1 - 2e-3 * f64::from(row) + 1e-5 * f64::from(index)).collect(),
            intensity: vec![7; 40],
            state: vec![State::Valid; 40],
            ..Column::default()
        };
        let mut lattice = Lattice::new(header);
        for index in (0..30).rev() {
            lattice.push(&column(index)).unwrap();
        }
        for index in 0..30 {
            let expected = column(index);
            for row in 0..40 {
                let point = lattice.point(lattice.cell(index as usize, row)).unwrap();
                let unit =
                    Direction { azimuth: expected.azimuth[row], elevation: expected.elevation[row] }.unit();
                for k in 0..3 {
                    assert!((point[k] - unit[k] * expected.range_m[row]).abs() < 1e-14);
                }
            }
        }
        assert_eq!(lattice.n_valid(), 1200);
    }
}
