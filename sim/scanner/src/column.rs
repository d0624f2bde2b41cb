//! Columns of a simulated scan: measured values and ground truth.

use crate::ray::Label;

/// Measured state of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum SimState {
    /// Range and direction were measured.
    Valid,
    /// The beam was emitted and no usable echo returned.
    NoEcho,
}

/// Ground truth of a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TruthCell {
    /// Object hit by the middle of the beam.
    pub label: Label,
    /// Mixed pixel: the footprint straddles an edge.
    pub mixed: bool,
    /// Range of the middle of the beam without any error, metres; 0 where nothing was hit.
    pub range: f64,
}

/// Column of a scan, rows from the top down; all vectors have one entry per row.
#[derive(Debug, Clone, PartialEq)]
pub struct SimColumn {
    /// Index by increasing azimuth.
    pub index: u32,
    /// Measured on the back face.
    pub back_face: bool,
    /// Range, metres; undefined unless valid.
    pub range_m: Vec<f32>,
    /// Angle reported by the instrument, radians.
    pub azimuth: Vec<f64>,
    /// Angle reported by the instrument, radians.
    pub elevation: Vec<f64>,
    /// Echo intensity, 0..=2047.
    pub intensity: Vec<u16>,
    /// Per cell.
    pub state: Vec<SimState>,
    /// Per cell.
    pub truth: Vec<TruthCell>,
}
