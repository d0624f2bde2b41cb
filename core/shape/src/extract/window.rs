//! Window: one or more components of the lattice and their margin as a dense grid.
//!
//! In: the roots of the components and the stored columns. Out: ranges, inverse ranges and positions by cell.

use std::ops::Range;

use platen_scan::ScanHeader;

use super::beam_directions::{AngleSinCos, BeamDirection};
use super::column_store::{Cell, ColumnStore, MARGIN, union, with_margin};
use super::connected_components::{Components, Run};

/// Cells of one or more components with a margin, column after column: index `column * n_rows + row`, both counted from
/// the window's own corner. Only cells within [`MARGIN`] of the component are filled.
#[derive(Debug, Clone)]
pub(super) struct Window {
    pub(super) first_column: u32,
    pub(super) first_row: u32,
    pub(super) n_columns: usize,
    pub(super) n_rows: usize,
    pub(super) cells: Vec<Cell>,
    /// Inverse range, 1/m; 0 where a cell is not valid. Along rows and columns of the lattice the inverse range of a
    /// plane is a sine of the angle, hence straight to within the square of the step at any incidence.
    pub(super) inverse: Vec<f32>,
    /// Positions of the valid cells, metres.
    pub(super) points: Vec<[f64; 3]>,
    /// Cells of the component.
    pub(super) own: Vec<bool>,
    /// Rows between which cells are filled, per column; a plate that lies askew leaves half of the window empty.
    pub(super) spans: Vec<Range<usize>>,
    pub(super) header: ScanHeader,
    /// Nominal azimuth of each column and elevation of each row.
    azimuths: Vec<AngleSinCos>,
    elevations: Vec<AngleSinCos>,
    /// One over the steps of azimuth and elevation.
    per_step: (f64, f64),
}

impl Window {
    /// Builds the window around components, given by their roots.
    pub(super) fn of(
        roots: &[u32],
        regions: &mut Components,
        columns: &ColumnStore,
        header: &ScanHeader,
    ) -> Self {
        let extent = regions.extent_of_all(roots);
        let first_column = extent.columns.0.saturating_sub(MARGIN);
        let first_row = extent.rows.0.saturating_sub(MARGIN);
        let end_column = extent.columns.1 + MARGIN + 1;
        let end_row = (extent.rows.1 + MARGIN + 1).min(header.n_rows);
        let (n_columns, n_rows) = ((end_column - first_column) as usize, (end_row - first_row) as usize);
        let n = n_columns * n_rows;
        let mut window = Self {
            first_column,
            first_row,
            n_columns,
            n_rows,
            cells: vec![Cell::default(); n],
            inverse: vec![0.0; n],
            points: vec![[0.0; 3]; n],
            own: vec![false; n],
            spans: Vec::with_capacity(n_columns),
            header: header.clone(),
            per_step: (1.0 / header.azimuth_step, 1.0 / header.elevation_step),
            azimuths: (first_column..end_column)
                .map(|i| AngleSinCos::of(header.azimuth_start + header.azimuth_step * f64::from(i)))
                .collect(),
            elevations: (first_row..end_row)
                .map(|i| AngleSinCos::of(header.elevation_start - header.elevation_step * f64::from(i)))
                .collect(),
        };
        let own: Vec<Vec<Run>> = (first_column..end_column)
            .map(|index| regions.runs_of(roots, columns.get(index).map_or(0..0, |c| c.runs.clone())))
            .collect();
        let near: Vec<Vec<Range<u32>>> = own.iter().map(|runs| with_margin(runs.iter().copied())).collect();
        for i in 0..n_columns {
            let around = &near[i.saturating_sub(MARGIN as usize)..(i + MARGIN as usize + 1).min(n_columns)];
            let wanted = union(around.iter().flatten().map(|rows| rows.start..rows.end.min(end_row)));
            let at = |row: Option<u32>| row.map_or(0, |row| (row - first_row) as usize);
            window.spans.push(at(wanted.first().map(|r| r.start))..at(wanted.last().map(|r| r.end)));
            window.fill(i, &wanted, columns);
            for run in &own[i] {
                let at = |row: u32| i * n_rows + (row - first_row) as usize;
                window.own[at(run.first_row)..at(run.end_row - 1) + 1].fill(true);
            }
        }
        window
    }

    /// Builds a window from a function of column and row: the range, 0 where there is none, and whether the cell is
    /// part of the component.
    #[cfg(test)]
    pub(super) fn of_ranges(header: ScanHeader, range: impl Fn(usize, usize) -> (f32, bool)) -> Self {
        let (n_columns, n_rows) = (header.n_columns as usize, header.n_rows as usize);
        let ranges: Vec<(f32, bool)> =
            (0..n_columns * n_rows).map(|index| range(index / n_rows, index % n_rows)).collect();
        let angle = |start: f64, step: f64, n| -> Vec<AngleSinCos> {
            (0..n).map(|i| AngleSinCos::of(start + step * i as f64)).collect()
        };
        let mut window = Self {
            first_column: 0,
            first_row: 0,
            n_columns,
            n_rows,
            cells: ranges
                .iter()
                .map(|(range_m, _)| Cell { range_m: *range_m, valid: *range_m > 0.0, ..Cell::default() })
                .collect(),
            inverse: ranges
                .iter()
                .map(|(range_m, _)| if *range_m > 0.0 { 1.0 / range_m } else { 0.0 })
                .collect(),
            points: Vec::new(),
            own: ranges.iter().map(|(_, own)| *own).collect(),
            spans: vec![0..n_rows; n_columns],
            azimuths: angle(header.azimuth_start, header.azimuth_step, n_columns),
            elevations: angle(header.elevation_start, -header.elevation_step, n_rows),
            per_step: (1.0 / header.azimuth_step, 1.0 / header.elevation_step),
            header,
        };
        let at = |index: usize| window.nominal(index / n_rows, index % n_rows).unit();
        window.points =
            ranges.iter().enumerate().map(|(i, (range, _))| (at(i) * f64::from(*range)).into()).collect();
        window
    }

    /// Invalidates the first columns of each face of the scan.
    pub(super) fn leave_out(&mut self, columns: u32) {
        for start in [Some(0), self.header.seam_column].into_iter().flatten() {
            let from = start.saturating_sub(self.first_column) as usize;
            let to = ((start + columns).saturating_sub(self.first_column) as usize).min(self.n_columns);
            if from < to {
                let cells = from * self.n_rows..to * self.n_rows;
                self.cells[cells.clone()].fill(Cell::default());
                self.inverse[cells.clone()].fill(0.0);
                self.own[cells].fill(false);
            }
        }
    }

    fn fill(&mut self, i: usize, wanted: &[Range<u32>], columns: &ColumnStore) {
        let Some(column) = columns.get(self.first_column + i as u32) else { return };
        let azimuth = self.azimuths[i];
        for segment in &column.segments {
            for rows in wanted {
                let start = rows.start.max(segment.first_row);
                let end = rows.end.min(segment.first_row + segment.cells.len() as u32);
                if start >= end {
                    continue;
                }
                let cells =
                    &segment.cells[(start - segment.first_row) as usize..(end - segment.first_row) as usize];
                let row = (start - self.first_row) as usize;
                let at = i * self.n_rows + row..i * self.n_rows + row + cells.len();
                self.cells[at.clone()].copy_from_slice(cells);
                let places = self.inverse[at.clone()].iter_mut().zip(&mut self.points[at]);
                let cells = cells.iter().zip(&self.elevations[row..]).zip(places);
                for ((cell, elevation), (inverse, point)) in cells.filter(|((cell, _), _)| cell.valid) {
                    let beam = BeamDirection {
                        azimuth: azimuth.by(f64::from(cell.azimuth_off)),
                        elevation: elevation.by(f64::from(cell.elevation_off)),
                    };
                    *inverse = 1.0 / cell.range_m;
                    *point = (beam.unit() * f64::from(cell.range_m)).into();
                }
            }
        }
    }

    /// Returns the columns and, for each, the rows where cells are filled, without the `margin` outermost ones of the
    /// window.
    pub(super) fn inner_spans(&self, margin: usize) -> impl Iterator<Item = (usize, Range<usize>)> {
        let columns = margin..self.n_columns.saturating_sub(margin).max(margin);
        let last = self.n_rows.saturating_sub(margin);
        let rows = move |span: &Range<usize>| span.start.max(margin)..span.end.min(last).max(margin);
        columns.map(move |column| (column, rows(&self.spans[column])))
    }

    /// Returns the nominal direction of a cell.
    #[inline]
    pub(super) fn nominal(&self, column: usize, row: usize) -> BeamDirection {
        BeamDirection { azimuth: self.azimuths[column], elevation: self.elevations[row] }
    }

    /// Returns the direction of a place in or near the window, given in cells and parts of cells on the nominal
    /// lattice.
    pub(super) fn beam_at(&self, column: f64, row: f64) -> BeamDirection {
        let nearest = |x: f64, n: usize| ((x + 0.5).max(0.0) as usize).min(n - 1);
        let (i, k) = (nearest(column, self.n_columns), nearest(row, self.n_rows));
        BeamDirection {
            azimuth: self.azimuths[i].by((column - i as f64) * self.header.azimuth_step),
            elevation: self.elevations[k].by((k as f64 - row) * self.header.elevation_step),
        }
    }

    /// Returns the true direction of a cell as (column, row), in cells and parts of cells of the nominal lattice.
    #[inline]
    pub(super) fn place(&self, column: usize, row: usize) -> (f64, f64) {
        let cell = &self.cells[column * self.n_rows + row];
        (
            column as f64 + f64::from(cell.azimuth_off) * self.per_step.0,
            row as f64 - f64::from(cell.elevation_off) * self.per_step.1,
        )
    }

    /// Returns the same for a cell given by its index.
    pub(super) fn place_of(&self, index: usize) -> (f64, f64) {
        self.place(index / self.n_rows, index % self.n_rows)
    }
}
