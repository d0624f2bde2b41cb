//! Buffer of a whole scan until its stroke has a verdict.

use platen_scan::{Column, ScanEnd, ScanHeader};

/// A whole scan in memory, for the retention of raw scans.
#[derive(Debug, Default)]
pub struct ScanBuffer {
    pub(super) header: Option<ScanHeader>,
    columns: Vec<Column>,
    cells: usize,
    pub(super) end: Option<ScanEnd>,
}

/// Largest scan held, cells of `Column::SAMPLE_BYTES` each: a full dome at the finest step in use for plates.
const MAX_CELLS: usize = 50_000_000;

impl ScanBuffer {
    pub(super) fn push(&mut self, column: Column) {
        self.cells += column.len();
        if self.cells > MAX_CELLS {
            self.columns = Vec::new();
        } else {
            self.columns.push(column);
        }
    }

    /// Returns the scan.
    ///
    /// # Errors
    /// The reason why it is incomplete.
    pub fn finish(self) -> Result<(ScanHeader, Vec<Column>, ScanEnd), String> {
        match (self.header, self.end) {
            _ if self.cells > MAX_CELLS => {
                Err(format!("{} cells are too many to hold; measure a window", self.cells))
            }
            (Some(header), Some(end)) => Ok((header, self.columns, end)),
            _ => Err("it has no end".to_owned()),
        }
    }
}
