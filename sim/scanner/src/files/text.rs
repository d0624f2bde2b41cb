//! XYZ writer with row and column first; cells without echo are omitted.

use super::{FileOrder, SimScan};
use std::io::{Result, Write};

/// Writes lines `row column x y z reflectance`, metres, reflectance 0..=2047.
pub(super) fn write(scan: &SimScan, out: &mut impl Write, order: FileOrder) -> Result<()> {
    for cell in scan.cells(order) {
        if let Some([x, y, z]) = cell.point() {
            writeln!(out, "{} {} {x:.6} {y:.6} {z:.6} {}", cell.row, cell.column, cell.intensity)?;
        }
    }
    Ok(())
}
