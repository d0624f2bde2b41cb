//! What a simulated scan consists of.

use crate::ray::Label;

/// What the instrument knows of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum SimState {
    /// Range and direction.
    Valid,
    /// The beam went out there and no usable echo came back.
    NoEcho,
}

/// What the simulator knows of a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TruthCell {
    /// What the middle of the beam hit.
    pub label: Label,
    /// The footprint straddles an edge, and the range is a mixture.
    pub mixed: bool,
    /// Range of the middle of the beam without any error, metres; 0 where nothing was hit.
    pub range: f64,
}

/// One column, rows from the top down; all vectors have one entry per row.
#[derive(Debug, Clone, PartialEq)]
pub struct SimColumn {
    /// Place by growing azimuth.
    pub index: u32,
    /// Measured on the back side of the mirror turn.
    pub back_face: bool,
    /// Metres; meaningless unless valid.
    pub range_m: Vec<f32>,
    /// Radians, as the instrument reports it.
    pub azimuth: Vec<f64>,
    /// Radians, as the instrument reports it.
    pub elevation: Vec<f64>,
    /// 0..=2047.
    pub intensity: Vec<u16>,
    /// Per cell.
    pub state: Vec<SimState>,
    /// Per cell.
    pub truth: Vec<TruthCell>,
}
