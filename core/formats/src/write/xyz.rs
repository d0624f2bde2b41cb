//! Writer of XYZ with row and column: one line per valid cell, `row column x y z intensity`.

use std::fs::File;
use std::io::{BufWriter, Write as _};

use platen_scan::{Column, ScanEnd};

use super::error::Result;
use super::{Encoder, point};

pub(super) struct Xyz(BufWriter<File>);

impl Xyz {
    pub(super) fn new(file: File) -> Self {
        Self(BufWriter::new(file))
    }
}

impl Encoder for Xyz {
    fn column(&mut self, column: &Column) -> Result<()> {
        for i in 0..column.len() {
            let Some([x, y, z]) = point(column, i) else { continue };
            let row = column.first_row as usize + i;
            let intensity = column.intensity[i];
            writeln!(self.0, "{row} {} {x:.6} {y:.6} {z:.6} {intensity}", column.index)?;
        }
        Ok(())
    }

    fn end(&mut self, _: &ScanEnd, _: &[bool]) -> Result<()> {
        Ok(self.0.flush()?)
    }
}
