//! Scan files: structured E57 (ASTM E2807), PTX (Leica), XYZ with row and column, XYB (SCENE).
//!
//! Reading: [`ScanReader`] recognises the format from the content, checks that the file is complete, orients the
//! lattice from its geometry ([`orient`]) and delivers it column by column in the scanner's frame. Writing:
//! [`ScanFile`] accepts columns in any order; the file appears under its name when it is complete.
//!
//! Limits: one scan is read at a time; poses are reported and not applied; files without a lattice are refused with the
//! format to export instead. This crate has no plugin, press or network code.

mod header_text;
pub mod orient;
mod read;
mod write;

pub use orient::Columns;
pub use read::{Oriented, ReadError, ScanReader};
pub use write::{ScanFile, ScanWriter, WriteError, WriteFault, Written};

/// File format of a lattice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// ASTM E2807, structured.
    E57,
    /// Leica's text format, all cells.
    Ptx,
    /// Text with row and column.
    Xyz,
    /// SCENE's binary format, all cells.
    Xyb,
}

#[cfg(test)]
mod tests;
