//! Second pass: columns of the normalised lattice.

use std::f64::consts::PI;

use platen_scan::{Column, Direction, Face, Outcome, ScanEnd, State, wrap_azimuth};

use super::{Mirror, OrientError, Plan, SphericalCell, Unit};
use crate::read::{ReadError, SphericalCells};

/// A normalised cell that waits for the rest of its column.
#[derive(Debug, Clone, Copy)]
struct Sample {
    row: u32,
    range_m: f64,
    direction: Direction,
    intensity: u16,
    state: State,
}

/// Columns of an oriented lattice, each once, as soon as the file has completed it. Nothing follows an error.
///
/// A file stored column by column needs memory for one column, a file stored row by row for all cells.
pub struct Columns<'a> {
    plan: &'a Plan,
    cells: SphericalCells<'a>,
    waiting: Vec<Vec<Sample>>,
    /// Room of the last column delivered, for the next that begins.
    spare: Vec<Sample>,
    seen: u64,
    points: u64,
    /// First column not yet examined for having no stored cell.
    rest: usize,
}

impl<'a> Columns<'a> {
    /// Starts the second pass over the cells.
    pub(crate) fn new(plan: &'a Plan, cells: SphericalCells<'a>) -> Self {
        Self {
            plan,
            cells,
            waiting: vec![Vec::new(); plan.cells.len()],
            spare: Vec::new(),
            seen: 0,
            points: 0,
            rest: 0,
        }
    }

    /// Returns the share of cells read, 0 to 1.
    pub fn share(&self) -> f64 {
        self.seen as f64 / self.expected() as f64
    }

    /// Returns the trailer; columns not taken are read and dropped.
    ///
    /// # Errors
    /// As the columns.
    pub fn finish(&mut self) -> Result<ScanEnd, ReadError> {
        self.try_for_each(|column| column.map(drop))?;
        Ok(ScanEnd {
            columns: self.plan.header.n_columns,
            points: self.points,
            warm_up_columns: self.plan.warm_up_columns,
            outcome: Outcome::Complete,
        })
    }

    fn next_column(&mut self) -> Result<Option<Column>, ReadError> {
        while let Some(cell) = self.cells.next() {
            if let Some(column) = self.add(&cell?)? {
                return Ok(Some(column));
            }
        }
        if self.seen != self.expected() || self.waiting.iter().any(|samples| !samples.is_empty()) {
            return Err(self.changed().into());
        }
        let empty = self.plan.cells[self.rest..].iter().position(|cells| *cells == 0);
        Ok(empty.map(|ahead| {
            let index = self.rest + ahead;
            self.rest = index + 1;
            Column { index: index as u32, ..Column::default() }
        }))
    }

    /// Adds a cell; returns the column that it completes.
    fn add(&mut self, cell: &SphericalCell) -> Result<Option<Column>, OrientError> {
        self.seen += 1;
        let (column, row) = self.plan.place(cell).ok_or_else(|| self.changed())?;
        let samples = &mut self.waiting[column as usize];
        let expected = self.plan.cells[column as usize] as usize;
        if samples.capacity() == 0 {
            *samples = std::mem::take(&mut self.spare);
            samples.reserve_exact(expected);
        }
        if samples.len() == expected {
            return Err(self.changed());
        }
        samples.push(self.plan.sample(cell, row));
        if samples.len() < expected {
            return Ok(None);
        }
        let face = match self.plan.header.seam_column {
            Some(seam) if column >= seam => Face::Back,
            _ => Face::Front,
        };
        let column = Column { face, ..to_column(column, samples) };
        self.spare = std::mem::take(samples);
        self.spare.clear();
        self.points += column.state.iter().filter(|state| **state == State::Valid).count() as u64;
        Ok(Some(column))
    }

    fn expected(&self) -> u64 {
        self.plan.cells.iter().map(|cells| u64::from(*cells)).sum()
    }

    fn changed(&self) -> OrientError {
        OrientError::Changed { expected: self.expected(), found: self.seen }
    }
}

impl Iterator for Columns<'_> {
    type Item = Result<Column, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.next_column().transpose()
    }
}

impl Plan {
    /// Returns normalised column and row of a stored cell, `None` outside of the lattice decided.
    pub(crate) fn place(&self, cell: &SphericalCell) -> Option<(u32, u32)> {
        let (row, column) = if self.swapped { (cell.column, cell.row) } else { (cell.row, cell.column) };
        let (n_rows, n_columns) = (self.header.n_rows, self.header.n_columns);
        let row = row.checked_sub(self.first_row).filter(|row| *row < n_rows)?;
        let column = column.checked_sub(self.first_column).filter(|column| *column < n_columns)?;
        let row = if self.rows_flipped { n_rows - 1 - row } else { row };
        let column = if self.columns_flipped { n_columns - 1 - column } else { column };
        Some(((column + n_columns - self.cut) % n_columns, row))
    }

    /// Returns a cell of the normalised lattice: right-handed, metres.
    #[inline]
    fn sample(&self, cell: &SphericalCell, row: u32) -> Sample {
        let Direction { azimuth, elevation } = cell.direction;
        let azimuth = match self.mirror {
            Mirror::None => azimuth,
            Mirror::X => wrap_azimuth(PI - azimuth),
            Mirror::Y => wrap_azimuth(-azimuth),
        };
        Sample {
            row,
            range_m: if self.unit == Unit::Millimetre { cell.range / 1000.0 } else { cell.range },
            direction: Direction { azimuth, elevation },
            intensity: self.intensity.apply(cell.intensity),
            state: cell.true_state(),
        }
    }
}

/// Returns the column from the first to the last row of known direction.
fn to_column(index: u32, samples: &[Sample]) -> Column {
    let known = || samples.iter().filter(|sample| sample.state != State::NoReturn);
    let first_row = known().map(|sample| sample.row).min().unwrap_or(0);
    let n = known().map(|sample| sample.row + 1 - first_row).max().unwrap_or(0) as usize;
    let mut column = Column {
        index,
        first_row,
        range_m: vec![0.0; n],
        azimuth: vec![0.0; n],
        elevation: vec![0.0; n],
        intensity: vec![0; n],
        state: vec![State::NoReturn; n],
        ..Column::default()
    };
    for sample in known() {
        let i = (sample.row - first_row) as usize;
        column.range_m[i] = sample.range_m;
        column.azimuth[i] = sample.direction.azimuth;
        column.elevation[i] = sample.direction.elevation;
        column.intensity[i] = sample.intensity;
        column.state[i] = sample.state;
    }
    column
}
