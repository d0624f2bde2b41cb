//! A file that this program wrote: the lattice that it was written from, once the geometry agrees.

use super::survey::{MAX_INDEX, MIN_FILL};
use super::{Mirror, Plan, Unit};
use platen_scan::{ScanHeader, wrap_azimuth};

/// Largest relative difference between a lattice's nominal step and the one fitted to its cells.
const SAME_STEP: f64 = 0.01;

impl Plan {
    /// Takes over the header of the scan that the file was written from, so that nominal angles, empty edges and notes
    /// are again what they were; `false`, and nothing changed, when the cells say otherwise.
    pub fn restore(&mut self, own: &ScanHeader, warm_up_columns: u32) -> bool {
        if !self.agrees(own) {
            return false;
        }
        let mut cells = vec![0; self.first_column as usize];
        cells.append(&mut self.cells);
        cells.resize(own.n_columns as usize, 0);
        self.cells = cells;
        (self.first_row, self.first_column) = (0, 0);
        self.header = own.clone();
        self.warm_up_columns = warm_up_columns;
        true
    }

    fn agrees(&self, own: &ScanHeader) -> bool {
        let found = &self.header;
        let as_stored = !self.swapped && !self.rows_flipped && !self.columns_flipped && self.cut == 0;
        let holds = |first: u32, n: u32, all: u32| all <= MAX_INDEX + 1 && first + n <= all;
        let stored: f64 = self.cells.iter().map(|cells| f64::from(*cells)).sum();
        let same_step = |found: f64, own: f64| (found / own - 1.0).abs() < SAME_STEP;
        let azimuth = own.azimuth_start + own.azimuth_step * f64::from(self.first_column);
        let elevation = own.elevation_start - own.elevation_step * f64::from(self.first_row);
        as_stored
            && self.mirror == Mirror::None
            && self.unit == Unit::Metre
            && holds(self.first_row, found.n_rows, own.n_rows)
            && holds(self.first_column, found.n_columns, own.n_columns)
            && stored >= MIN_FILL * f64::from(own.n_rows) * f64::from(own.n_columns)
            && same_step(found.azimuth_step, own.azimuth_step)
            && same_step(found.elevation_step, own.elevation_step)
            && wrap_azimuth(found.azimuth_start - azimuth).abs() < own.azimuth_step
            && (found.elevation_start - elevation).abs() < own.elevation_step
    }
}
