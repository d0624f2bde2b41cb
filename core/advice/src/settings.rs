//! Settings of the advice, as a shop chooses them: largest bend of a stroke, order of the lines.

/// Settings of the advice.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// Largest bend of one stroke, radians.
    pub largest: f64,
    /// Largest strain of the face under the bends.
    pub strain: f64,
    /// Order of the lines.
    pub order: Order,
    /// The guard against bending too far is on; off for the study of what it is worth.
    pub guard: bool,
    /// Strokes teach the depth law; off for the study of what that is worth.
    pub learns: bool,
}

/// Order of the lines of a plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// From the last bend onward, then from the first edge again.
    Onward,
    /// From both ends to the middle.
    EndsIn,
}
