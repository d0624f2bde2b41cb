//! Store of the columns that have arrived, in bounded memory.
//!
//! Cells that cannot belong to the plate are dropped: those not near a component small enough to be the plate. In:
//! columns in any order. Out: their cells and runs (consecutive cells of one surface).

use std::ops::Range;

use platen_scan::{Column, ScanHeader, State, wrap_azimuth};

use super::connected_components::{Components, Run};

/// Number of cells kept around a component: a mixed pixel beside the face, and behind it a cell with two neighbours on
/// either side, which distinguish it from a mixed pixel. The face may reach one cell beyond its component.
pub(super) const MARGIN: u32 = 6;

/// One stored cell: 16 bytes.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Cell {
    pub(super) range_m: f32,
    /// True direction minus the nominal one of the lattice, radians.
    pub(super) azimuth_off: f32,
    pub(super) elevation_off: f32,
    pub(super) intensity: u16,
    pub(super) valid: bool,
    /// Inside the region of interest.
    pub(super) inside: bool,
}

/// Consecutive cells of a column.
#[derive(Debug, Clone)]
pub(super) struct Segment {
    pub(super) first_row: u32,
    pub(super) cells: Vec<Cell>,
}

impl Segment {
    fn end_row(&self) -> u32 {
        self.first_row + self.cells.len() as u32
    }
}

#[derive(Debug, Clone)]
pub(super) struct StoredColumn {
    /// Numbers of its runs, by row.
    pub(super) runs: Range<u32>,
    /// Stored cells, by row; segments do not touch.
    pub(super) segments: Vec<Segment>,
}

impl StoredColumn {
    /// Returns the range of a cell that is part of a run of this column and has not been dropped.
    pub(super) fn range(&self, row: u32) -> f32 {
        let holding = self.segments.iter().rev().find(|s| s.first_row <= row);
        holding.and_then(|s| s.cells.get((row - s.first_row) as usize)).map_or(0.0, |cell| cell.range_m)
    }

    fn n_cells(&self) -> usize {
        self.segments.iter().map(|s| s.cells.len()).sum()
    }

    /// Drops the cells outside of `rows`, which are sorted and do not touch.
    fn retain(&mut self, rows: &[Range<u32>]) {
        let mut kept = Vec::new();
        for segment in &self.segments {
            for wanted in rows {
                let start = wanted.start.max(segment.first_row);
                let end = wanted.end.min(segment.end_row());
                if start < end {
                    let cells = &segment.cells
                        [(start - segment.first_row) as usize..(end - segment.first_row) as usize];
                    kept.push(Segment { first_row: start, cells: cells.to_vec() });
                }
            }
        }
        self.segments = kept;
    }
}

/// Copies a column into cells. `inside` returns whether a sample, by row and range, is in the region of interest.
pub(super) fn cells_of(column: &Column, header: &ScanHeader, inside: impl Fn(u32, f32) -> bool) -> Vec<Cell> {
    let azimuth = header.azimuth_start + header.azimuth_step * f64::from(column.index);
    let angles = column.azimuth.iter().zip(&column.elevation);
    let samples = column.state.iter().zip(&column.range_m).zip(angles).zip(&column.intensity);
    let cells = (column.first_row..).zip(samples);
    let cells = cells.map(|(row, (((state, range_m), (true_azimuth, true_elevation)), intensity))| {
        if *state != State::Valid {
            return Cell::default();
        }
        let elevation = header.elevation_start - header.elevation_step * f64::from(row);
        let range_m = *range_m as f32;
        let azimuth_off = true_azimuth - azimuth;
        let azimuth_off = if azimuth_off.abs() < 3.0 { azimuth_off } else { wrap_azimuth(azimuth_off) };
        Cell {
            range_m,
            azimuth_off: azimuth_off as f32,
            elevation_off: (true_elevation - elevation) as f32,
            intensity: *intensity,
            valid: true,
            inside: inside(row, range_m),
        }
    });
    cells.collect()
}

/// All columns, and the number of cells at which the next sweep takes place.
#[derive(Debug, Clone, Default)]
pub(super) struct ColumnStore {
    kept: Vec<Option<StoredColumn>>,
    n_cells: usize,
    sweep_at: usize,
}

/// Number of cells (16 MB) below which nothing is dropped: the saving would be negligible.
const SWEEP_FROM: usize = 1 << 20;

impl ColumnStore {
    pub(super) fn len(&self) -> u32 {
        self.kept.len() as u32
    }

    pub(super) fn n_cells(&self) -> usize {
        self.n_cells
    }

    pub(super) fn get(&self, index: u32) -> Option<&StoredColumn> {
        self.kept.get(index as usize)?.as_ref()
    }

    pub(super) fn insert(&mut self, index: u32, column: StoredColumn) {
        if self.kept.len() <= index as usize {
            self.kept.resize(index as usize + 1, None);
        }
        self.n_cells += column.n_cells();
        self.kept[index as usize] = Some(column);
    }

    /// Drops the cells that are not near a component of at most `limit_mm2`, each time the store has doubled.
    ///
    /// The work is thereby linear in the number of cells that arrive. Components only grow: a cell dropped now would
    /// also be dropped at the end, whatever the order of arrival.
    pub(super) fn sweep(&mut self, regions: &mut Components, n_columns: u32, limit_mm2: u64) {
        if self.n_cells < self.sweep_at.max(SWEEP_FROM) {
            return;
        }
        let alive: Vec<Option<Vec<Range<u32>>>> =
            self.kept.iter().map(|c| c.as_ref().map(|c| alive_rows(c, regions, limit_mm2))).collect();
        let n = self.kept.len();
        for index in 0..n {
            let first = index.saturating_sub(MARGIN as usize);
            let last = (index + MARGIN as usize).min((n_columns as usize).max(n) - 1);
            let Some(around) = alive.get(first..=last).filter(|a| a.iter().all(Option::is_some)) else {
                continue;
            };
            let wanted = union(around.iter().flatten().flatten().cloned());
            if let Some(column) = &mut self.kept[index] {
                column.retain(&wanted);
            }
        }
        self.n_cells = self.kept.iter().flatten().map(StoredColumn::n_cells).sum();
        self.sweep_at = 2 * self.n_cells;
    }
}

fn alive_rows(column: &StoredColumn, regions: &mut Components, limit_mm2: u64) -> Vec<Range<u32>> {
    let alive = |number: &u32| {
        let root = regions.root(*number);
        regions.extent(root).area_mm2 <= limit_mm2
    };
    let alive: Vec<u32> = column.runs.clone().filter(alive).collect();
    with_margin(alive.into_iter().map(|number| regions.run(number)))
}

/// Returns the rows of the runs of a column and those within [`MARGIN`] of them: rarely more than one range, since
/// dropouts are bridged.
pub(super) fn with_margin(runs: impl Iterator<Item = Run>) -> Vec<Range<u32>> {
    union(runs.map(|run| run.first_row.saturating_sub(MARGIN)..run.end_row + MARGIN))
}

/// Returns the sorted, non-overlapping union of ranges.
pub(super) fn union(ranges: impl Iterator<Item = Range<u32>>) -> Vec<Range<u32>> {
    let mut sorted: Vec<_> = ranges.collect();
    sorted.sort_unstable_by_key(|r| (r.start, r.end));
    let mut joined: Vec<Range<u32>> = Vec::new();
    for range in sorted {
        match joined.last_mut() {
            Some(last) if range.start <= last.end => last.end = last.end.max(range.end),
            _ => joined.push(range),
        }
    }
    joined
}
