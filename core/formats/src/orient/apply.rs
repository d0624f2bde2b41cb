//! Columns of the normalised lattice, assembled from the cells in the order of their file.
//!
//! A column whose cells are stored in one piece is built at once; the cells of any other column are kept until its last
//! cell was read.

use std::f64::consts::PI;
use std::ops::Range;

use platen_scan::{Column, Face, Outcome, ScanEnd, State, wrap_azimuth};

use super::places::{COLUMN, Cursor, Places, ROW, Run};
use super::{Mirror, OrientError, Plan, SphericalCells, Unit};

/// Columns in progress.
///
/// A file stored column by column needs memory for one column, a file stored row by row for all cells.
pub(crate) struct Assembly<'a> {
    plan: &'a Plan,
    /// First cell of the batch that was not taken.
    cursor: Cursor,
    /// Places of the cells taken last.
    places: Places,
    /// Cells kept for every column that is not complete.
    waiting: Vec<SphericalCells>,
    seen: u64,
    points: u64,
    /// First column of those not yet checked for having no stored cell.
    rest: usize,
}

impl<'a> Assembly<'a> {
    pub(crate) fn new(plan: &'a Plan) -> Self {
        Self {
            plan,
            cursor: Cursor::default(),
            places: Places::default(),
            waiting: vec![SphericalCells::default(); plan.cells.len()],
            seen: 0,
            points: 0,
            rest: 0,
        }
    }

    /// Returns the share of cells taken, 0 to 1.
    pub(crate) fn share(&self) -> f64 {
        self.seen as f64 / self.expected() as f64
    }

    /// Returns the trailer.
    pub(crate) fn end(&self) -> ScanEnd {
        ScanEnd {
            columns: self.plan.header.n_columns,
            points: self.points,
            warm_up_columns: self.plan.warm_up_columns,
            outcome: Outcome::Complete,
        }
    }

    /// Takes cells of a batch until they complete a column; `None` when all of them are taken. The next call is for the
    /// next batch then.
    ///
    /// # Errors
    /// [`OrientError::Changed`].
    pub(crate) fn next(&mut self, batch: &SphericalCells) -> Result<Option<Column>, OrientError> {
        loop {
            let some = self.cursor.take(&batch.places, self.plan.axes().1, &mut self.places);
            if some.is_empty() {
                self.cursor = Cursor::default();
                return Ok(None);
            }
            if let Some(column) = self.take(batch, some)? {
                return Ok(Some(column));
            }
        }
    }

    /// Returns a column without stored cells, each once; after the last batch.
    ///
    /// # Errors
    /// [`OrientError::Changed`].
    pub(crate) fn next_empty(&mut self) -> Result<Option<Column>, OrientError> {
        if self.seen != self.expected() || self.waiting.iter().any(|cells| cells.len() > 0) {
            return Err(self.changed());
        }
        let empty = self.plan.cells[self.rest..].iter().position(|cells| *cells == 0);
        Ok(empty.map(|ahead| {
            let index = self.rest + ahead;
            self.rest = index + 1;
            Column { index: index as u32, ..Column::default() }
        }))
    }

    /// Takes cells of one column; returns it when they complete it.
    fn take(&mut self, batch: &SphericalCells, some: Range<usize>) -> Result<Option<Column>, OrientError> {
        self.seen += some.len() as u64;
        let places = &self.places;
        let column = self.plan.column(places).ok_or_else(|| self.changed())?;
        let waiting = &mut self.waiting[column as usize];
        let expected = self.plan.cells[column as usize] as usize;
        if waiting.len() + some.len() > expected {
            return Err(self.changed());
        }
        let built = if some.len() == expected {
            self.plan.build(column, batch, some, places)
        } else {
            if waiting.len() == 0 {
                *waiting = SphericalCells::with_capacity(expected);
            }
            waiting.append(batch, some, places);
            if waiting.len() < expected {
                return Ok(None);
            }
            let cells = std::mem::take(waiting);
            self.plan.build(column, &cells, 0..expected, &cells.places)
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

impl Plan {
    /// Returns the axes of the file's places that are rows and columns of the lattice.
    fn axes(&self) -> (usize, usize) {
        if self.swapped { (COLUMN, ROW) } else { (ROW, COLUMN) }
    }

    /// Returns the normalised column of cells that lie in one; `None` outside of the lattice of the plan.
    fn column(&self, places: &Places) -> Option<u32> {
        let n_columns = self.header.n_columns;
        let stored = places.runs().first()?.line(self.axes().1);
        let column = stored.checked_sub(self.first_column).filter(|column| *column < n_columns)?;
        let column = if self.columns_flipped { n_columns - 1 - column } else { column };
        Some((column + n_columns - self.cut) % n_columns)
    }

    /// Returns the normalised rows of a run within one column; `None` outside of the lattice of the plan, or where one
    /// cell comes again.
    fn rows(&self, run: &Run) -> Option<Rows> {
        let (first, last, step) = run.lines(self.axes().0);
        if step == 0 && run.len() > 1 {
            return None;
        }
        let n_rows = i64::from(self.header.n_rows);
        let normalised = |stored: i64| {
            let row = stored - i64::from(self.first_row);
            let row = if self.rows_flipped { n_rows - 1 - row } else { row };
            (0..n_rows).contains(&row).then_some(row as usize)
        };
        let (first, last) = (normalised(first)?, normalised(last)?);
        Some(Rows {
            low: first.min(last),
            high: first.max(last),
            step: step.unsigned_abs().max(1) as usize,
            down: first <= last,
        })
    }

    /// Returns a column of the normalised lattice from the first to the last row of known direction: right-handed,
    /// metres. `None` when a cell lies outside of the lattice of the plan.
    fn build(
        &self,
        index: u32,
        cells: &SphericalCells,
        some: Range<usize>,
        places: &Places,
    ) -> Option<Column> {
        let runs: Option<Vec<Rows>> = places.runs().iter().map(|run| self.rows(run)).collect();
        let (runs, n_rows) = (runs?, self.header.n_rows as usize);
        let known = Known::new(gathered(&runs, &cells.true_states(some.clone()), n_rows, |state| state));
        let face = match self.header.seam_column {
            Some(seam) if index >= seam => Face::Back,
            _ => Face::Front,
        };
        let millimetres = self.unit == Unit::Millimetre;
        let metres = |range: f64| if millimetres { range / 1000.0 } else { range };
        let (ranges, azimuths) = (&cells.range[some.clone()], &cells.azimuth[some.clone()]);
        let azimuth = match self.mirror {
            Mirror::None => gathered(&runs, azimuths, n_rows, |azimuth| azimuth),
            Mirror::X => gathered(&runs, azimuths, n_rows, |azimuth| wrap_azimuth(PI - azimuth)),
            Mirror::Y => gathered(&runs, azimuths, n_rows, |azimuth| wrap_azimuth(-azimuth)),
        };
        Some(Column {
            index,
            face,
            first_row: known.rows.start as u32,
            range_m: known.of(gathered(&runs, ranges, n_rows, metres)),
            azimuth: known.of(azimuth),
            elevation: known
                .of(gathered(&runs, &cells.elevation[some.clone()], n_rows, |elevation| elevation)),
            intensity: known
                .of(gathered(&runs, &cells.intensity[some], n_rows, |value| self.intensity.apply(value))),
            state: known.state[known.rows.clone()].to_vec(),
        })
    }
}

/// Rows of successive cells in a normalised column.
#[derive(Debug, Clone, Copy)]
struct Rows {
    low: usize,
    high: usize,
    /// Step from cell to cell, down or up.
    step: usize,
    down: bool,
}

impl Rows {
    /// Puts the values of the cells in their rows.
    fn put<T: Copy, U>(&self, values: &[T], into: &mut [U], convert: impl Fn(T) -> U) {
        let rows = &mut into[self.low..=self.high];
        let put = |(row, value): (&mut U, &T)| *row = convert(*value);
        // Neighbours are copied together; for speed only: `tests::speed`.
        match (self.step, self.down) {
            (1, true) => rows.iter_mut().zip(values).for_each(put),
            (1, false) => rows.iter_mut().rev().zip(values).for_each(put),
            (step, true) => rows.iter_mut().step_by(step).zip(values).for_each(put),
            (step, false) => rows.iter_mut().rev().step_by(step).zip(values).for_each(put),
        }
    }

    fn len(&self) -> usize {
        (self.high - self.low) / self.step + 1
    }
}

/// Returns the values of the cells by row; the default where a row has none.
fn gathered<T: Copy, U: Clone + Default>(
    runs: &[Rows],
    mut values: &[T],
    n_rows: usize,
    convert: impl Fn(T) -> U + Copy,
) -> Vec<U> {
    let mut by_row = vec![U::default(); n_rows];
    for run in runs {
        let (some, rest) = values.split_at(run.len());
        run.put(some, &mut by_row, convert);
        values = rest;
    }
    by_row
}

/// States by row, with the rows from the first to the last of known direction.
struct Known {
    state: Vec<State>,
    rows: Range<usize>,
    /// Set when the direction of every row between them is known.
    all: bool,
}

impl Known {
    fn new(state: Vec<State>) -> Self {
        let is_known = |state: &State| *state != State::NoReturn;
        let start = state.iter().position(is_known).unwrap_or(0);
        let end = state.iter().rposition(is_known).map_or(start, |last| last + 1);
        let all = state[start..end].iter().all(is_known);
        Self { state, rows: start..end, all }
    }

    /// Returns the values of these rows; the default where the direction is not known.
    fn of<U: Clone + Default>(&self, mut values: Vec<U>) -> Vec<U> {
        values.truncate(self.rows.end);
        values.drain(..self.rows.start);
        if !self.all {
            let states = values.iter_mut().zip(&self.state[self.rows.clone()]);
            states
                .filter(|(_, state)| **state == State::NoReturn)
                .for_each(|(value, _)| *value = U::default());
        }
        values
    }
}
