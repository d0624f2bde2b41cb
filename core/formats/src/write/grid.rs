//! Writers of PTX and XYB files: every cell is stored, column after column.
//!
//! All records have one size, so that a column is written at its offset in any order of arrival; missing columns are
//! filled in at the end. The sizes in the header are padded and written again when the number of columns is known.

use std::fs::File;
use std::io::{BufWriter, Seek as _, SeekFrom, Write as _};

use platen_scan::{Column, ScanEnd, ScanHeader};

use super::error::{Result, WriteFault};
use super::{Encoder, point, rescaled};
use crate::read::xyb::REFLECTANCE;

/// Header and record of a format.
pub(super) trait Layout {
    /// Returns the header; its length does not depend on the sizes.
    fn head(&self, rows: u32, columns: u32) -> Vec<u8>;
    /// Appends a record of constant size; `None` for a cell that was not measured.
    fn put(&self, out: &mut Vec<u8>, cell: Option<([f64; 3], u16)>, intensity_range: (u16, u16));
}

/// Text: number of columns, cells per column, pose, then `x y z intensity` with the intensity in 0 to 1.
pub(super) struct Ptx;

/// The scanner's position and axes, then the 4x4 matrix: the points are in the scanner's own frame.
const POSE: &str = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";

impl Layout for Ptx {
    fn head(&self, rows: u32, columns: u32) -> Vec<u8> {
        format!("{columns:<10}\n{rows:<10}\n{POSE}").into_bytes()
    }

    fn put(&self, out: &mut Vec<u8>, cell: Option<([f64; 3], u16)>, range: (u16, u16)) {
        let ([x, y, z], intensity) =
            cell.map_or(([0.0; 3], 0.5), |(xyz, intensity)| (xyz, rescaled(intensity, range, [0.0, 1.0])));
        // Writing to memory cannot fail.
        let _ = writeln!(out, "{x:11.6} {y:11.6} {z:11.6} {intensity:.6}");
    }
}

/// Binary: x, y, z as f64 and the reflectance, 0 to 2047, as u16.
pub(super) struct Xyb;

impl Layout for Xyb {
    fn head(&self, rows: u32, columns: u32) -> Vec<u8> {
        let text = format!(
            "# SCENE XYZ binary format v1.0\nScanPosition 0 0 0\nRows {rows:<10}\nCols {columns:<10}\n\0\0\0\0"
        );
        text.into_bytes()
    }

    fn put(&self, out: &mut Vec<u8>, cell: Option<([f64; 3], u16)>, range: (u16, u16)) {
        let (xyz, reflectance) = cell.map_or(([0.0; 3], 0.0), |(xyz, intensity)| {
            (xyz, rescaled(intensity, range, REFLECTANCE.into()))
        });
        xyz.iter().for_each(|c| out.extend(c.to_le_bytes()));
        out.extend((reflectance.round() as u16).to_le_bytes());
    }
}

/// A file of records of one size.
pub(super) struct Grid<L> {
    layout: L,
    file: BufWriter<File>,
    n_rows: usize,
    intensity_range: (u16, u16),
    /// Record of a cell that was not measured.
    missing: Vec<u8>,
    /// Buffer of the bytes of one column.
    bytes: Vec<u8>,
}

impl<L: Layout> Grid<L> {
    pub(super) fn new(layout: L, file: File, header: &ScanHeader) -> Self {
        let (mut missing, intensity_range) = (Vec::new(), header.intensity_range);
        layout.put(&mut missing, None, intensity_range);
        let (file, n_rows) = (BufWriter::new(file), header.n_rows as usize);
        Self { layout, file, n_rows, intensity_range, missing, bytes: Vec::new() }
    }

    /// Writes `self.bytes` at the offset of a column.
    fn place(&mut self, index: usize) -> Result<()> {
        let head = self.layout.head(0, 0).len();
        let at = head as u64 + index as u64 * self.bytes.len() as u64;
        self.file.seek(SeekFrom::Start(at))?;
        Ok(self.file.write_all(&self.bytes)?)
    }

    fn gaps(&mut self, cells: usize) {
        (0..cells).for_each(|_| self.bytes.extend(&self.missing));
    }
}

impl<L: Layout> Encoder for Grid<L> {
    fn column(&mut self, column: &Column) -> Result<()> {
        self.bytes.clear();
        self.gaps(column.first_row as usize);
        for i in 0..column.len() {
            let cell = point(column, i).map(|xyz| (xyz, column.intensity[i]));
            let before = self.bytes.len();
            self.layout.put(&mut self.bytes, cell, self.intensity_range);
            if self.bytes.len() - before != self.missing.len() {
                let row = column.first_row + i as u32;
                return Err(WriteFault::TooFar { column: column.index, row, metres: column.range_m[i] });
            }
        }
        self.gaps(self.n_rows - column.first_row as usize - column.len());
        self.place(column.index as usize)
    }

    fn end(&mut self, _: &ScanEnd, came: &[bool]) -> Result<()> {
        self.bytes.clear();
        self.gaps(self.n_rows);
        for (index, _) in came.iter().enumerate().filter(|(_, came)| !**came) {
            self.place(index)?;
        }
        let head = self.layout.head(self.n_rows as u32, came.len() as u32);
        self.file.rewind()?;
        self.file.write_all(&head)?;
        Ok(self.file.flush()?)
    }
}
