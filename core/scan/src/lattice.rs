//! A whole scan in memory.

use crate::{Column, ColumnError, Direction, Face, ScanHeader, State};

/// A scan as one lattice, stored column after column: cell index `column * n_rows + row`.
///
/// Directions are kept as the difference from the ideal lattice of the header (f32: better than 1e-9 rad for
/// any real scanner), so that a cell costs 15 bytes.
#[derive(Debug, Clone)]
pub struct Lattice {
    header: ScanHeader,
    n_columns: u32,
    present: Vec<Option<Face>>,
    range_m: Vec<f32>,
    azimuth_off: Vec<f32>,
    elevation_off: Vec<f32>,
    intensity: Vec<u16>,
    state: Vec<State>,
}

impl Lattice {
    /// An empty lattice of the size that `header` announces.
    pub fn new(header: ScanHeader) -> Self {
        let n_columns = header.n_columns;
        let mut lattice = Self {
            header,
            n_columns: 0,
            present: Vec::new(),
            range_m: Vec::new(),
            azimuth_off: Vec::new(),
            elevation_off: Vec::new(),
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
            self.azimuth_off.resize(n, 0.0);
            self.elevation_off.resize(n, 0.0);
            self.intensity.resize(n, 0);
            self.state.resize(n, State::NoReturn);
        }
    }

    /// Puts a column into its place. Arrival order does not matter; a column that comes twice replaces itself.
    ///
    /// # Errors
    /// What [`Column::check`] finds.
    pub fn push(&mut self, column: &Column) -> Result<(), ColumnError> {
        column.check(self.header.n_rows)?;
        self.grow(column.index + 1);
        let start = column.index as usize * self.n_rows() + column.first_row as usize;
        for i in 0..column.len() {
            let cell = start + i;
            self.range_m[cell] = column.range_m[i];
            self.intensity[cell] = column.intensity[i];
            self.state[cell] = column.state[i];
            if column.state[i] != State::NoReturn {
                let here = Direction { azimuth: column.azimuth[i], elevation: column.elevation[i] };
                let row = column.first_row as usize + i;
                let ideal = self.ideal(column.index as usize, row);
                self.azimuth_off[cell] = crate::wrap_azimuth(here.azimuth - ideal.azimuth) as f32;
                self.elevation_off[cell] = (here.elevation - ideal.elevation) as f32;
            }
        }
        self.present[column.index as usize] = Some(column.face);
        Ok(())
    }

    fn ideal(&self, column: usize, row: usize) -> Direction {
        Direction {
            azimuth: self.header.azimuth_start + self.header.azimuth_step * column as f64,
            elevation: self.header.elevation_start - self.header.elevation_step * row as f64,
        }
    }

    /// What the driver said of the scan.
    pub fn header(&self) -> &ScanHeader {
        &self.header
    }

    /// Number of rows.
    pub fn n_rows(&self) -> usize {
        self.header.n_rows as usize
    }

    /// Number of columns.
    pub fn n_columns(&self) -> usize {
        self.n_columns as usize
    }

    /// Face of a column, `None` when it never came.
    pub fn face(&self, column: usize) -> Option<Face> {
        self.present[column]
    }

    /// Index of a cell into the flat arrays.
    pub fn cell(&self, column: usize, row: usize) -> usize {
        column * self.n_rows() + row
    }

    /// State of a cell.
    pub fn state(&self, cell: usize) -> State {
        self.state[cell]
    }

    /// Range of a valid cell, metres.
    pub fn range(&self, cell: usize) -> Option<f64> {
        (self.state[cell] == State::Valid).then(|| f64::from(self.range_m[cell]))
    }

    /// Raw intensity of a cell.
    pub fn intensity(&self, cell: usize) -> u16 {
        self.intensity[cell]
    }

    /// Direction of a cell whose direction is known.
    pub fn direction(&self, cell: usize) -> Option<Direction> {
        if self.state[cell] == State::NoReturn {
            return None;
        }
        let ideal = self.ideal(cell / self.n_rows(), cell % self.n_rows());
        Some(Direction {
            azimuth: ideal.azimuth + f64::from(self.azimuth_off[cell]),
            elevation: ideal.elevation + f64::from(self.elevation_off[cell]),
        })
    }

    /// Position of a valid cell, metres, scanner frame.
    pub fn point(&self, cell: usize) -> Option<[f64; 3]> {
        let range = self.range(cell)?;
        let unit = self.direction(cell)?.unit();
        Some(unit.map(|c| c * range))
    }

    /// Number of valid cells.
    pub fn n_valid(&self) -> usize {
        self.state.iter().filter(|s| **s == State::Valid).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_come_back_within_a_micrometre_in_any_arrival_order() {
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
            range_m: (0..40).map(|row| 5.0 + 0.01 * row as f32).collect(),
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
                    assert!((point[k] - unit[k] * f64::from(expected.range_m[row])).abs() < 1e-6);
                }
            }
        }
        assert_eq!(lattice.n_valid(), 1200);
    }
}
