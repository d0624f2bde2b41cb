//! PTX and XYB: every cell is stored, column after column.
//!
//! All records have one size, so that a column goes to its place whenever it comes; what never came is filled in at
//! the end. The sizes in the head are padded and written again when the number of columns is known.

use std::fs::File;
use std::io::{BufWriter, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use platen_scan::{Column, ScanEnd, ScanHeader};

use super::{Encoder, ScanFileError, failed, point, rescaled};

/// What distinguishes the two.
pub(super) trait Layout {
    /// The head; its length does not depend on the sizes.
    fn head(&self, rows: u32, columns: u32) -> Vec<u8>;
    /// Appends a record of always the same size; `None` for a cell that was not measured.
    fn put(&self, out: &mut Vec<u8>, cell: Option<([f64; 3], u16)>, header: &ScanHeader);
}

/// Text: columns, cells of one, pose, then `x y z intensity` with the intensity in 0 to 1.
pub(super) struct Ptx;

/// The scanner's position and axes, then the 4x4: the points are in the scanner's own frame.
const POSE: &str = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";

impl Layout for Ptx {
    fn head(&self, rows: u32, columns: u32) -> Vec<u8> {
        format!("{columns:<10}\n{rows:<10}\n{POSE}").into_bytes()
    }

    fn put(&self, out: &mut Vec<u8>, cell: Option<([f64; 3], u16)>, header: &ScanHeader) {
        let ([x, y, z], intensity) =
            cell.map_or(([0.0; 3], 0.5), |(xyz, intensity)| (xyz, rescaled(intensity, header, [0.0, 1.0])));
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

    fn put(&self, out: &mut Vec<u8>, cell: Option<([f64; 3], u16)>, header: &ScanHeader) {
        let (xyz, reflectance) = cell
            .map_or(([0.0; 3], 0.0), |(xyz, intensity)| (xyz, rescaled(intensity, header, [0.0, 2047.0])));
        xyz.iter().for_each(|c| out.extend(c.to_le_bytes()));
        out.extend((reflectance.round() as u16).to_le_bytes());
    }
}

/// A file of records of one size.
pub(super) struct Grid<L> {
    layout: L,
    file: BufWriter<File>,
    path: PathBuf,
    header: ScanHeader,
    came: Vec<bool>,
    /// A record of a cell that was not measured.
    missing: Vec<u8>,
    /// Bytes of one column, used again.
    bytes: Vec<u8>,
}

impl<L: Layout> Grid<L> {
    pub(super) fn create(layout: L, part: &Path, path: &Path) -> Result<Self, ScanFileError> {
        let file = BufWriter::new(File::create(part).map_err(failed(path))?);
        let (mut missing, header) = (Vec::new(), ScanHeader::default());
        layout.put(&mut missing, None, &header);
        Ok(Self {
            layout,
            file,
            path: path.to_path_buf(),
            header,
            came: Vec::new(),
            missing,
            bytes: Vec::new(),
        })
    }

    /// Writes `self.bytes` at the place of a column.
    fn place(&mut self, index: usize) -> Result<(), ScanFileError> {
        let head = self.layout.head(0, 0).len();
        let at = head as u64 + index as u64 * self.bytes.len() as u64;
        let written = self.file.seek(SeekFrom::Start(at)).and_then(|_| self.file.write_all(&self.bytes));
        written.map_err(failed(&self.path))
    }

    fn gaps(&mut self, cells: usize) {
        (0..cells).for_each(|_| self.bytes.extend(&self.missing));
    }
}

impl<L: Layout> Encoder for Grid<L> {
    fn begin(&mut self, header: &ScanHeader) -> Result<(), ScanFileError> {
        self.header = header.clone();
        self.came = vec![false; header.n_columns as usize];
        Ok(())
    }

    fn column(&mut self, column: &Column) -> Result<(), ScanFileError> {
        let index = column.index as usize;
        if self.came.len() <= index {
            self.came.resize(index + 1, false);
        }
        self.came[index] = true;
        self.bytes.clear();
        self.gaps(column.first_row as usize);
        for i in 0..column.len() {
            let cell = point(column, i).map(|xyz| (xyz, column.intensity[i]));
            let before = self.bytes.len();
            self.layout.put(&mut self.bytes, cell, &self.header);
            if self.bytes.len() - before != self.missing.len() {
                let row = column.first_row + i as u32;
                let (path, metres) = (self.path.clone(), column.range_m[i]);
                return Err(ScanFileError::TooFar { path, column: column.index, row, metres });
            }
        }
        self.gaps(self.header.n_rows as usize - column.first_row as usize - column.len());
        self.place(index)
    }

    fn end(&mut self, _: &ScanEnd) -> Result<(), ScanFileError> {
        self.bytes.clear();
        self.gaps(self.header.n_rows as usize);
        for index in 0..self.came.len() {
            if !self.came[index] {
                self.place(index)?;
            }
        }
        let head = self.layout.head(self.header.n_rows, self.came.len() as u32);
        let written =
            self.file.rewind().and_then(|()| self.file.write_all(&head)).and_then(|()| self.file.flush());
        written.map_err(failed(&self.path))
    }
}
