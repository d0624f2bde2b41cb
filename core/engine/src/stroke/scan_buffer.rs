//! A whole scan, held until its stroke is judged.

use platen_scan::{Column, ScanEnd, ScanHeader};

/// A whole scan as it came, for the archive.
#[derive(Debug, Default)]
pub struct ScanBuffer {
    header: Option<ScanHeader>,
    columns: Vec<Column>,
    cells: usize,
    end: Option<ScanEnd>,
}

/// Most cells that are held (`Column::SAMPLE_BYTES` each): a full dome of the finest step that anyone measures plates with.
const TAPE_CELLS: usize = 50_000_000;

impl ScanBuffer {
    pub(super) fn begin(&mut self, header: ScanHeader) {
        self.header = Some(header);
    }

    pub(super) fn push(&mut self, column: Column) {
        self.cells += column.len();
        if self.cells > TAPE_CELLS {
            self.columns = Vec::new();
        } else {
            self.columns.push(column);
        }
    }

    pub(super) fn end(&mut self, end: ScanEnd) {
        self.end = Some(end);
    }

    /// The scan.
    ///
    /// # Errors
    /// Why it is not whole.
    pub fn finish(self) -> Result<(ScanHeader, Vec<Column>, ScanEnd), String> {
        match (self.header, self.end) {
            _ if self.cells > TAPE_CELLS => {
                Err(format!("{} cells are too many to hold; measure a window", self.cells))
            }
            (Some(header), Some(end)) => Ok((header, self.columns, end)),
            _ => Err("it has no end".to_owned()),
        }
    }
}
