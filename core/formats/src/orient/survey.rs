//! First pass: sums over the cells of a stored lattice.

use platen_scan::State;

use super::occupancy::{Inserted, Occupancy};
use super::places::{COLUMN, Run};
use super::spherical::{Converted, NO_NUMBER};
use super::{OrientError, fit::Line};

/// Largest row or column number: three times the rows of the finest terrestrial scanner on a full circle.
pub(super) const MAX_INDEX: u32 = (1 << 17) - 1;

/// Least share of places that contain a cell. Real scans of halls fill more than half, a scan of the open air a third;
/// a cloud thinned out on export fills less than a hundredth.
pub(super) const MIN_FILL: f64 = 0.02;

/// Range that no such scanner reaches in metres, and nearly every scan exceeds in millimetres.
pub(super) const FAR: f64 = 350.0;
/// Range below which no terrestrial scanner measures in metres.
pub(super) const NEAR: f64 = 0.2;

/// Sums over all cells of a stored lattice, from one pass. The memory depends on the numbers of rows and columns, plus
/// one bit per cell.
#[derive(Debug, Default)]
pub(crate) struct Survey {
    pub(super) rows: Vec<Line>,
    pub(super) columns: Vec<Line>,
    occupancy: Occupancy,
    pub(super) cells: u64,
    pub(super) valid: u64,
    pub(super) unflagged: u64,
    pub(super) not_finite: u64,
    pub(super) above_far: u64,
    pub(super) above_far_mm: u64,
    pub(super) below_near: u64,
    pub(super) intensity: super::intensity::Observed,
}

impl Survey {
    /// Adds cells.
    ///
    /// # Errors
    /// [`OrientError::IndexOutOfRange`], [`OrientError::DuplicateCell`] or [`OrientError::TooSparse`].
    pub(crate) fn add(&mut self, converted: &Converted) -> Result<(), OrientError> {
        let Converted { cells, parts } = converted;
        let mut cell = 0;
        for run in cells.places.runs().iter().flat_map(|run| run.by_line(COLUMN)) {
            self.add_places(run)?;
            let column = &mut self.columns[run.line(COLUMN) as usize];
            for [row, _] in run.places() {
                let (range, elevation) = (cells.range[cell], cells.elevation[cell]);
                if cells.true_state(cell) == State::Valid {
                    self.rows[row as usize].add(parts[cell], elevation);
                    column.add(parts[cell], elevation);
                    self.valid += 1;
                    self.above_far += u64::from(range > FAR);
                    self.above_far_mm += u64::from(range > FAR * 1000.0);
                    self.below_near += u64::from(range < NEAR);
                    self.intensity.add(cells.intensity[cell]);
                } else if cells.state[cell] == State::Valid {
                    let finite = range < NO_NUMBER;
                    self.not_finite += u64::from(!finite);
                    self.unflagged += u64::from(finite);
                }
                cell += 1;
            }
        }
        Ok(())
    }

    /// Adds the places of cells in one column.
    fn add_places(&mut self, run: Run) -> Result<(), OrientError> {
        let column = run.line(COLUMN);
        for [row, _] in run.places() {
            if row.max(column) > MAX_INDEX {
                return Err(OrientError::IndexOutOfRange { row, column, max: MAX_INDEX + 1 });
            }
            match self.occupancy.insert(row, column) {
                Inserted::New => {}
                Inserted::Twice => return Err(OrientError::DuplicateCell { row, column }),
                Inserted::TooFar => return Err(self.too_sparse()),
            }
            self.cells += 1;
            line(&mut self.rows, row).cells += 1;
        }
        line(&mut self.columns, column).cells += run.len() as u32;
        Ok(())
    }

    /// Returns the number of cells added.
    pub(crate) fn cells(&self) -> u64 {
        self.cells
    }

    pub(super) fn too_sparse(&self) -> OrientError {
        let n_rows = stored_range(&self.rows).len() as u32;
        let n_columns = stored_range(&self.columns).len() as u32;
        OrientError::TooSparse {
            cells: self.cells,
            n_rows,
            n_columns,
            percent: 100.0 * self.cells as f64 / (f64::from(n_rows) * f64::from(n_columns)),
            needed: 100.0 * MIN_FILL,
        }
    }
}

/// Returns the range from the first to the last line that contains a cell.
pub(super) fn stored_range(lines: &[Line]) -> std::ops::Range<usize> {
    let first = lines.iter().position(|line| line.cells > 0).unwrap_or(0);
    first..lines.len()
}

fn line(lines: &mut Vec<Line>, number: u32) -> &mut Line {
    let number = number as usize;
    if number >= lines.len() {
        lines.resize(number + 1, Line::default());
    }
    &mut lines[number]
}
