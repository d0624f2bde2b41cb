//! Scans as files, in the formats and the orders in which scanners' software exports them.

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

/// A finished scan.
#[derive(Debug, Clone)]
pub struct SimScan {
    /// Directions.
    pub lattice: SimLattice,
    /// All columns, in order.
    pub columns: Vec<SimColumn>,
}

/// In which order a file holds the lattice. The default is the one that vendor software is known for: row 0 at the top,
/// columns clockwise seen from above.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FileOrder {
    /// Row 0 is the lowest.
    pub bottom_up: bool,
    /// Columns by growing azimuth.
    pub counter_clockwise: bool,
    /// Rows and columns are swapped.
    pub transposed: bool,
}

/// A format, with what can differ between files of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileFormat {
    /// ASTM E2807, structured.
    E57(E57Encoding),
    /// Text, all cells, metres.
    Ptx {
        /// Lines end in CR LF.
        crlf: bool,
    },
    /// Text with row and column, cells without echo left out.
    Xyz,
    /// Binary, all cells.
    Xyb,
}

impl FileFormat {
    /// The usual format of a file name's ending; `None` for an ending that is not known here.
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

/// One cell of a file.
#[derive(Debug, Clone, Copy)]
struct Cell {
    row: u32,
    column: u32,
    azimuth: f64,
    elevation: f64,
    /// Metres; `None` without echo.
    range: Option<f64>,
    intensity: u16,
}

impl Cell {
    /// Metres, scanner frame; `None` without echo.
    fn point(&self) -> Option<[f64; 3]> {
        self.range.map(|range| (unit(self.azimuth, self.elevation) * range).into())
    }
}

impl SimScan {
    /// Writes the scan. The file appears under its name when it is complete.
    ///
    /// # Errors
    /// [`FileError`] when the file cannot be written.
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

    /// Rows and columns of a file in this order.
    fn size(&self, order: FileOrder) -> [u32; 2] {
        let [rows, columns] = [self.lattice.n_rows, self.lattice.n_columns];
        if order.transposed { [columns, rows] } else { [rows, columns] }
    }

    /// All cells, column after column, each from its row 0 on.
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
