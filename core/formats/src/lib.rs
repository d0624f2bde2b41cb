//! Scan files: structured E57 (ASTM E2807), PTX (Leica), XYZ with row and column, XYB (SCENE).
//!
//! Reading: [`ScanReader`] recognises the format from the content, checks that the file is complete, orients the
//! lattice from its geometry ([`orient`]) and delivers it column by column in the scanner's frame. Writing:
//! [`ScanFile`] accepts columns in any order; the file appears under its name when it is complete.
//!
//! Limits: one scan is read at a time; poses are reported and not applied; files without a lattice are refused with the
//! format to export instead. This crate has no plugin, press or network code.

mod format;
mod header_text;
pub mod orient;
mod read;
mod write;

pub use format::Format;
pub use read::{Columns, Oriented, ReadError, ScanReader};
pub use write::{ScanFile, ScanWriter, WriteError, WriteFault, Written};

#[cfg(test)]
mod tests;
