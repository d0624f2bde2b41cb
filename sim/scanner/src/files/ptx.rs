//! PTX writer: ten header lines, then every cell; a cell without echo is `0 0 0 0.5`.

use super::{FileOrder, SimScan};
use crate::measure::INTENSITY_MAX;
use std::io::{Result, Write};

/// Writes a PTX file. Line 1 is the number of columns, line 2 that of rows, the fast index. Position and matrix are the
/// identity.
pub(super) fn write(scan: &SimScan, out: &mut impl Write, crlf: bool, order: FileOrder) -> Result<()> {
    let end = if crlf { "\r\n" } else { "\n" };
    let [rows, columns] = scan.size(order);
    write!(out, "{columns}{end}{rows}{end}")?;
    for line in ["0 0 0", "1 0 0", "0 1 0", "0 0 1", "1 0 0 0", "0 1 0 0", "0 0 1 0", "0 0 0 1"] {
        write!(out, "{line}{end}")?;
    }
    for cell in scan.cells(order) {
        match cell.point() {
            Some([x, y, z]) => {
                let intensity = f64::from(cell.intensity) / f64::from(INTENSITY_MAX);
                write!(out, "{x:.6} {y:.6} {z:.6} {intensity:.6}{end}")?;
            }
            None => write!(out, "0 0 0 0.500000{end}")?,
        }
    }
    Ok(())
}
