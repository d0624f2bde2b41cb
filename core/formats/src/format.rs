//! File formats.

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
