//! Scan files in the formats and orders in which the software of scanners exports them: E57, PTX, XYZ, XYB.

mod e57;
mod error;
mod ptx;
mod text;
mod xyb;

use crate::column::{SimColumn, SimState};
use crate::lattice::{SimLattice, unit};
use std::io::{BufWriter, Write};
use std::path::Path;

pub use e57::E57Encoding;
pub use error::FileError;

/// Complete scan.
#[derive(Debug, Clone)]
pub struct SimScan {
    /// Lattice of directions.
    pub lattice: SimLattice,
    /// All columns, in order.
    pub columns: Vec<SimColumn>,
}

/// Order of rows and columns in a file. The default is that of the vendor's software: row 0 at the top,
/// columns clockwise seen from above.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FileOrder {
    /// Row 0 is the lowest.
    pub bottom_up: bool,
    /// Columns by increasing azimuth.
    pub counter_clockwise: bool,
    /// Rows and columns are swapped.
    pub transposed: bool,
}

/// File format with its variants.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileFormat {
    /// E57 (ASTM E2807), structured.
    E57(E57Encoding),
    /// PTX: text, all cells, metres.
    Ptx {
        /// Lines end in CR LF.
        crlf: bool,
    },
    /// XYZ: text with row and column, without the cells that have no echo.
    Xyz,
    /// XYB: binary, all cells.
    Xyb,
}

impl FileFormat {
    /// Returns the usual format of a file name's extension; `None` for an unknown extension.
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()? {
            "e57" => Some(Self::E57(E57Encoding::default())),
            "ptx" => Some(Self::Ptx { crlf: false }),
            "xyz" => Some(Self::Xyz),
            "xyb" => Some(Self::Xyb),
            _ => None,
        }
    }
}

/// Cell as written to a file.
#[derive(Debug, Clone, Copy)]
struct Cell {
    row: u32,
    column: u32,
    azimuth: f64,
    elevation: f64,
    /// Range, metres; `None` without echo.
    range: Option<f64>,
    intensity: u16,
}

impl Cell {
    /// Returns the point in the scanner frame, metres; `None` without echo.
    fn point(&self) -> Option<[f64; 3]> {
        self.range.map(|range| (unit(self.azimuth, self.elevation) * range).into())
    }
}

impl SimScan {
    /// Writes the scan to a temporary file and renames it, so that `path` appears only when it is complete.
    ///
    /// # Errors
    /// [`FileError`] with the path when the file cannot be written.
    pub fn write(&self, path: &Path, format: FileFormat, order: FileOrder) -> Result<(), FileError> {
        let part = path.with_extension("part");
        let failed = |source| FileError::Io { path: path.into(), source };
        if let FileFormat::E57(encoding) = format {
            e57::write(self, &part, encoding, order)
                .map_err(|source| FileError::E57 { path: path.into(), source })?;
        } else {
            let mut out = BufWriter::new(std::fs::File::create(&part).map_err(failed)?);
            match format {
                FileFormat::Ptx { crlf } => ptx::write(self, &mut out, crlf, order),
                FileFormat::Xyz => text::write(self, &mut out, order),
                _ => xyb::write(self, &mut out, order),
            }
            .and_then(|()| out.flush())
            .map_err(failed)?;
        }
        std::fs::rename(&part, path).map_err(failed)
    }

    /// Returns the numbers of rows and columns of a file in this order.
    fn size(&self, order: FileOrder) -> [u32; 2] {
        let [rows, columns] = [self.lattice.n_rows, self.lattice.n_columns];
        if order.transposed { [columns, rows] } else { [rows, columns] }
    }

    /// Iterates over all cells, column by column, each from its row 0.
    fn cells(&self, order: FileOrder) -> impl Iterator<Item = Cell> + '_ {
        let [n_rows, n_columns] = self.size(order);
        (0..n_columns).flat_map(move |column| (0..n_rows).map(move |row| self.cell(order, row, column)))
    }

    fn cell(&self, order: FileOrder, row: u32, column: u32) -> Cell {
        let (line, place) = if order.transposed { (row, column) } else { (column, row) };
        let place = if order.bottom_up { self.lattice.n_rows - 1 - place } else { place } as usize;
        let line = if order.counter_clockwise { line } else { self.lattice.n_columns - 1 - line } as usize;
        let source = &self.columns[line];
        let valid = source.state[place] == SimState::Valid;
        Cell {
            row,
            column,
            azimuth: source.azimuth[place],
            elevation: source.elevation[place],
            range: valid.then(|| f64::from(source.range_m[place])),
            intensity: source.intensity[place],
        }
    }
}
