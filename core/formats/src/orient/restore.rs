//! Restoration of a scan's header from a file written by [`crate::ScanFile`], after the geometry has confirmed it.

use platen_scan::{ScanHeader, wrap_azimuth};

use super::survey::{MAX_INDEX, MIN_FILL};
use super::{Mirror, Plan, Unit};

/// Largest relative difference between a lattice's nominal step and the one fitted to its cells.
const SAME_STEP: f64 = 0.01;

impl Plan {
    /// Replaces the header by that of the scan written to the file, so that nominal angles, empty edges and notes are
    /// those of the scan. Returns `false`, and changes nothing, when the cells contradict it.
    pub(crate) fn restore(&mut self, written: &ScanHeader, warm_up_columns: u32) -> bool {
        if !self.agrees(written) {
            return false;
        }
        let mut cells = vec![0; self.first_column as usize];
        cells.append(&mut self.cells);
        cells.resize(written.n_columns as usize, 0);
        self.cells = cells;
        (self.first_row, self.first_column) = (0, 0);
        self.header = written.clone();
        self.warm_up_columns = warm_up_columns;
        true
    }

    fn agrees(&self, written: &ScanHeader) -> bool {
        let found = &self.header;
        let as_stored = !self.swapped && !self.rows_flipped && !self.columns_flipped && self.cut == 0;
        let holds = |first: u32, n: u32, all: u32| all <= MAX_INDEX + 1 && first + n <= all;
        let stored: f64 = self.cells.iter().map(|cells| f64::from(*cells)).sum();
        let same_step = |found: f64, written: f64| (found / written - 1.0).abs() < SAME_STEP;
        let azimuth = written.azimuth_start + written.azimuth_step * f64::from(self.first_column);
        let elevation = written.elevation_start - written.elevation_step * f64::from(self.first_row);
        as_stored
            && self.mirror == Mirror::None
            && self.unit == Unit::Metre
            && holds(self.first_row, found.n_rows, written.n_rows)
            && holds(self.first_column, found.n_columns, written.n_columns)
            && stored >= MIN_FILL * f64::from(written.n_rows) * f64::from(written.n_columns)
            && same_step(found.azimuth_step, written.azimuth_step)
            && same_step(found.elevation_step, written.elevation_step)
            && wrap_azimuth(found.azimuth_start - azimuth).abs() < written.azimuth_step
            && (found.elevation_start - elevation).abs() < written.elevation_step
    }
}
