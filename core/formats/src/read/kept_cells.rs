//! Cells of the first pass, kept for the second: 48 bytes each, and 32 more where the file stores ranges and directions.

use platen_scan::{Direction, State};

use crate::orient::RawCell;

/// Cells of a small file, in its order.
#[derive(Debug, Default)]
pub(super) struct KeptCells {
    cells: Vec<KeptCell>,
    /// By cell; empty where no cell has one.
    beams: Vec<Option<(f64, Direction)>>,
}

#[derive(Debug)]
struct KeptCell {
    row: u32,
    column: u32,
    xyz: [f64; 3],
    intensity: f64,
    state: State,
}

impl KeptCells {
    /// Makes room for `capacity` cells.
    pub(super) fn with_capacity(capacity: usize) -> Self {
        Self { cells: Vec::with_capacity(capacity), beams: Vec::new() }
    }

    pub(super) fn push(&mut self, cell: &RawCell) {
        let RawCell { row, column, xyz, beam, intensity, state } = *cell;
        if beam.is_some() && self.beams.is_empty() {
            self.beams.reserve(self.cells.capacity());
            self.beams.resize(self.cells.len(), None);
        }
        if beam.is_some() || !self.beams.is_empty() {
            self.beams.push(beam);
        }
        self.cells.push(KeptCell { row, column, xyz, intensity, state });
    }

    pub(super) fn len(&self) -> usize {
        self.cells.len()
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = RawCell> {
        self.cells.iter().enumerate().map(|(i, cell)| {
            let KeptCell { row, column, xyz, intensity, state } = *cell;
            RawCell { row, column, xyz, beam: self.beams.get(i).copied().flatten(), intensity, state }
        })
    }
}
