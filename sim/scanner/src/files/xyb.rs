//! XYB writer: a short text header, then 26 bytes per cell, little endian; a cell without echo is zero.

use super::{FileOrder, SimScan};
use std::io::{Result, Write};

pub(super) fn write(scan: &SimScan, out: &mut impl Write, order: FileOrder) -> Result<()> {
    let [rows, columns] = scan.size(order);
    write!(out, "# SCENE XYZ binary format v1.0\nScanPosition 0 0 0\nRows {rows}\nCols {columns}\n")?;
    out.write_all(&[0; 4])?;
    for cell in scan.cells(order) {
        for coordinate in cell.point().unwrap_or([0.0; 3]) {
            out.write_all(&coordinate.to_le_bytes())?;
        }
        let intensity = if cell.range.is_some() { cell.intensity } else { 0 };
        out.write_all(&intensity.to_le_bytes())?;
    }
    Ok(())
}
