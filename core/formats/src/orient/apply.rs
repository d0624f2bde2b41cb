//! Second look at the cells: columns of the normalised lattice.

use std::f64::consts::FRAC_PI_2;

use super::{Mirror, OrientError, Plan, RawCell, Unit, true_state};
use platen_scan::{Column, Direction, Face, Outcome, ScanEnd, State, wrap_azimuth};

/// One normalised cell that waits for the rest of its column.
#[derive(Debug, Clone, Copy)]
struct Sample {
    row: u32,
    range_m: f64,
    direction: Direction,
    intensity: u16,
    state: State,
}

/// Collects cells into columns by a [`Plan`] and gives each column out when its last cell came.
///
/// A file stored column by column needs memory for one column, a file stored row by row for all cells. Columns
/// come in the order in which the file completes them.
#[derive(Debug)]
pub struct Assembler<'a> {
    plan: &'a Plan,
    waiting: Vec<Vec<Sample>>,
    seen: u64,
    points: u64,
}

impl<'a> Assembler<'a> {
    /// Nothing collected yet.
    pub fn new(plan: &'a Plan) -> Self {
        Self { plan, waiting: vec![Vec::new(); plan.cells.len()], seen: 0, points: 0 }
    }

    /// Takes a cell; gives the column that it completes.
    ///
    /// # Errors
    /// [`OrientError::Changed`] when the cell was not there in the first pass.
    pub fn push(&mut self, cell: &RawCell) -> Result<Option<Column>, OrientError> {
        self.seen += 1;
        let (column, row) = self.plan.place(cell).ok_or_else(|| self.changed())?;
        let samples = &mut self.waiting[column as usize];
        let expected = self.plan.cells[column as usize] as usize;
        if samples.capacity() == 0 {
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
        *samples = Vec::new();
        self.points += column.state.iter().filter(|state| **state == State::Valid).count() as u64;
        Ok(Some(column))
    }

    /// Ends the scan: the columns of which the file stores no cell, and the trailer.
    ///
    /// # Errors
    /// [`OrientError::Changed`] when cells of the first pass did not come.
    pub fn finish(&self) -> Result<(Vec<Column>, ScanEnd), OrientError> {
        if self.seen != self.expected() || self.waiting.iter().any(|samples| !samples.is_empty()) {
            return Err(self.changed());
        }
        let empty = self.plan.cells.iter().enumerate().filter(|(_, cells)| **cells == 0);
        let empty = empty.map(|(index, _)| Column { index: index as u32, ..Column::default() }).collect();
        let end = ScanEnd {
            columns: self.plan.header.n_columns,
            points: self.points,
            warm_up_columns: self.plan.warm_up_columns,
            outcome: Outcome::Complete,
        };
        Ok((empty, end))
    }

    fn expected(&self) -> u64 {
        self.plan.cells.iter().map(|cells| u64::from(*cells)).sum()
    }

    fn changed(&self) -> OrientError {
        OrientError::Changed { expected: self.expected(), found: self.seen }
    }
}

impl Plan {
    /// Normalised column and row of a stored cell, `None` when it lies outside of the lattice decided.
    pub fn place(&self, cell: &RawCell) -> Option<(u32, u32)> {
        let (row, column) = if self.swapped { (cell.column, cell.row) } else { (cell.row, cell.column) };
        let (n_rows, n_columns) = (self.header.n_rows, self.header.n_columns);
        let row = row.checked_sub(self.first_row).filter(|row| *row < n_rows)?;
        let column = column.checked_sub(self.first_column).filter(|column| *column < n_columns)?;
        let row = if self.rows_flipped { n_rows - 1 - row } else { row };
        let column = if self.columns_flipped { n_columns - 1 - column } else { column };
        Some(((column + n_columns - self.cut) % n_columns, row))
    }

    /// Position of a stored cell: right-handed, metres.
    pub fn position(&self, cell: &RawCell) -> [f64; 3] {
        let metres = match self.unit {
            Unit::Metre => cell.xyz,
            Unit::Millimetre => cell.xyz.map(|c| c / 1000.0),
        };
        let [x, y, z] = metres;
        match self.mirror {
            Mirror::None => metres,
            Mirror::X => [-x, y, z],
            Mirror::Y => [x, -y, z],
        }
    }

    /// Range in metres and direction of a cell that is stored so; not beyond the zenith, where azimuth means another.
    fn beam(&self, cell: &RawCell) -> Option<(f64, Direction)> {
        let plain = self.mirror == Mirror::None && self.unit == Unit::Metre;
        let (range, direction) = cell.beam.filter(|_| plain)?;
        let up_to_zenith = (-FRAC_PI_2..=FRAC_PI_2).contains(&direction.elevation);
        up_to_zenith.then(|| (range, Direction { azimuth: wrap_azimuth(direction.azimuth), ..direction }))
    }

    fn sample(&self, cell: &RawCell, row: u32) -> Sample {
        let (range_m, direction) = self.beam(cell).unwrap_or_else(|| {
            let position = self.position(cell);
            (position.iter().map(|c| c * c).sum::<f64>().sqrt(), Direction::of(position))
        });
        Sample {
            row,
            range_m,
            direction,
            intensity: self.intensity.apply(cell.intensity),
            state: true_state(cell),
        }
    }
}

/// Spreads samples over the rows between the first and the last of which something is known.
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
