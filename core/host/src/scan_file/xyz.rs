//! XYZ with row and column: one line a valid cell, `row column x y z intensity`.

use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

use platen_scan::{Column, ScanEnd, ScanHeader};

use super::{Encoder, ScanFileError, failed, point};

pub(super) struct Xyz {
    out: BufWriter<File>,
    path: PathBuf,
}

impl Xyz {
    pub(super) fn create(part: &Path, path: &Path) -> Result<Self, ScanFileError> {
        let file = File::create(part).map_err(failed(path))?;
        Ok(Self { out: BufWriter::new(file), path: path.to_path_buf() })
    }
}

impl Encoder for Xyz {
    fn begin(&mut self, _: &ScanHeader) -> Result<(), ScanFileError> {
        Ok(())
    }

    fn column(&mut self, column: &Column) -> Result<(), ScanFileError> {
        for i in 0..column.len() {
            let Some([x, y, z]) = point(column, i) else { continue };
            let row = column.first_row as usize + i;
            let intensity = column.intensity[i];
            writeln!(self.out, "{row} {} {x:.6} {y:.6} {z:.6} {intensity}", column.index)
                .map_err(failed(&self.path))?;
        }
        Ok(())
    }

    fn end(&mut self, _: &ScanEnd) -> Result<(), ScanFileError> {
        self.out.flush().map_err(failed(&self.path))
    }
}
