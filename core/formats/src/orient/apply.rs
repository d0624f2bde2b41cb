//! Second pass: columns of the normalised lattice, from the cells in the order of their file.
//!
//! A column whose cells are stored in one piece is built at once; the cells of any other column are kept until its last
//! cell was read.

use std::borrow::Cow;
use std::f64::consts::PI;
use std::ops::Range;

use platen_scan::{Column, Face, Outcome, ScanEnd, State, wrap_azimuth};

use super::{Mirror, OrientError, Plan, SphericalCells, Unit};
use crate::read::{Batches, ReadError};

/// Columns of an oriented lattice, each once, as soon as the file has completed it. No column follows an error.
///
/// A file stored column by column needs memory for one column, a file stored row by row for all cells.
pub struct Columns<'a> {
    plan: &'a Plan,
    batches: Batches<'a>,
    batch: Cow<'a, SphericalCells>,
    /// Number of cells of the batch that were taken.
    taken: usize,
    /// Cells kept for every column that is not complete.
    waiting: Vec<SphericalCells>,
    seen: u64,
    points: u64,
    /// First column of those not yet checked for having no stored cell.
    rest: usize,
}

impl<'a> Columns<'a> {
    /// Starts the second pass over the cells.
    pub(crate) fn new(plan: &'a Plan, batches: Batches<'a>) -> Self {
        Self {
            plan,
            batches,
            batch: Cow::default(),
            taken: 0,
            waiting: vec![SphericalCells::default(); plan.cells.len()],
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
        loop {
            while self.taken < self.batch.len() {
                if let Some(column) = self.take()? {
                    return Ok(Some(column));
                }
            }
            let Some(batch) = self.batches.next() else { break };
            (self.batch, self.taken) = (batch?, 0);
        }
        if self.seen != self.expected() || self.waiting.iter().any(|cells| cells.len() > 0) {
            return Err(self.changed().into());
        }
        let empty = self.plan.cells[self.rest..].iter().position(|cells| *cells == 0);
        Ok(empty.map(|ahead| {
            let index = self.rest + ahead;
            self.rest = index + 1;
            Column { index: index as u32, ..Column::default() }
        }))
    }

    /// Takes the next cells of one column; returns it when they complete it.
    fn take(&mut self) -> Result<Option<Column>, OrientError> {
        let some = self.plan.same_column(&self.batch, self.taken);
        self.seen += some.len() as u64;
        self.taken = some.end;
        let column = self.plan.column(&self.batch, some.start).ok_or_else(|| self.changed())?;
        let waiting = &mut self.waiting[column as usize];
        let expected = self.plan.cells[column as usize] as usize;
        if waiting.len() + some.len() > expected {
            return Err(self.changed());
        }
        let built = if some.len() == expected {
            self.plan.build(column, &self.batch, some)
        } else {
            if waiting.len() == 0 {
                *waiting = SphericalCells::with_capacity(expected);
            }
            waiting.append(&self.batch, some);
            if waiting.len() < expected {
                return Ok(None);
            }
            let cells = std::mem::take(waiting);
            self.plan.build(column, &cells, 0..expected)
        };
        let built = built.ok_or_else(|| self.changed())?;
        self.points += built.state.iter().filter(|state| **state == State::Valid).count() as u64;
        Ok(Some(built))
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
    /// Returns rows and columns of cells in the sense of the lattice, before they are flipped.
    fn lines<'c>(&self, cells: &'c SphericalCells) -> (&'c [u32], &'c [u32]) {
        if self.swapped { (&cells.column, &cells.row) } else { (&cells.row, &cells.column) }
    }

    /// Returns the cells of a batch from `from` on that lie in the same column.
    fn same_column(&self, cells: &SphericalCells, from: usize) -> Range<usize> {
        let (_, columns) = self.lines(cells);
        let column = columns[from];
        let n = columns[from..].iter().take_while(|other| **other == column).count();
        from..from + n
    }

    /// Returns the normalised column of a cell; `None` outside of the lattice of the plan.
    fn column(&self, cells: &SphericalCells, cell: usize) -> Option<u32> {
        let (_, columns) = self.lines(cells);
        let n_columns = self.header.n_columns;
        let column = columns[cell].checked_sub(self.first_column).filter(|column| *column < n_columns)?;
        let column = if self.columns_flipped { n_columns - 1 - column } else { column };
        Some((column + n_columns - self.cut) % n_columns)
    }

    /// Returns a column of the normalised lattice from the first to the last row of known direction: right-handed,
    /// metres. `None` when a cell lies outside of the lattice of the plan.
    fn build(&self, index: u32, cells: &SphericalCells, some: Range<usize>) -> Option<Column> {
        let (rows, _) = self.lines(cells);
        let stored = &rows[some.clone()];
        let last = self.first_row + self.header.n_rows - 1;
        if stored.iter().min()? < &self.first_row || stored.iter().max()? > &last {
            return None;
        }
        // Cell of known direction of each row, counted from the first cell.
        let mut cell_of_row = vec![None; self.header.n_rows as usize];
        for (stored, cell) in stored.iter().zip(0..) {
            let row = if self.rows_flipped { last - stored } else { stored - self.first_row };
            if cells.true_state(some.start + cell as usize) != State::NoReturn {
                cell_of_row[row as usize] = Some(cell);
            }
        }
        let first_row = cell_of_row.iter().position(Option::is_some).unwrap_or(0);
        let end = cell_of_row.iter().rposition(Option::is_some).map_or(first_row, |last| last + 1);
        let cell_of_row = &cell_of_row[first_row..end];
        let face = match self.header.seam_column {
            Some(seam) if index >= seam => Face::Back,
            _ => Face::Front,
        };
        let millimetres = self.unit == Unit::Millimetre;
        let metres = |range: f64| if millimetres { range / 1000.0 } else { range };
        let (ranges, azimuths) = (&cells.range[some.clone()], &cells.azimuth[some.clone()]);
        let azimuth = match self.mirror {
            Mirror::None => gathered(cell_of_row, azimuths, |azimuth| azimuth),
            Mirror::X => gathered(cell_of_row, azimuths, |azimuth| wrap_azimuth(PI - azimuth)),
            Mirror::Y => gathered(cell_of_row, azimuths, |azimuth| wrap_azimuth(-azimuth)),
        };
        Some(Column {
            index,
            face,
            first_row: first_row as u32,
            range_m: gathered(cell_of_row, ranges, metres),
            azimuth,
            elevation: gathered(cell_of_row, &cells.elevation[some.clone()], |elevation| elevation),
            intensity: gathered(cell_of_row, &cells.intensity[some.clone()], |value| {
                self.intensity.apply(value)
            }),
            state: gathered(cell_of_row, &cells.state[some], |state| state),
        })
    }
}

/// Returns the values of the rows' cells; the default where a row has none.
fn gathered<T: Copy, U: Default>(
    cell_of_row: &[Option<u32>],
    values: &[T],
    convert: impl Fn(T) -> U,
) -> Vec<U> {
    let value = |cell: &Option<u32>| cell.map_or_else(U::default, |cell| convert(values[cell as usize]));
    cell_of_row.iter().map(value).collect()
}
