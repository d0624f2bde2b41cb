//! Settings of the advice, chosen by a shop: largest bend of a stroke, order of the lines.

/// Settings of the advice.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// Largest bend of one stroke, radians.
    pub largest: f64,
    /// Largest strain of the face under the bends.
    pub strain: f64,
    /// Order of the lines.
    pub order: Order,
    /// True when the guard against bending too far is on; false only for the study of its benefit.
    pub guard: bool,
    /// True when the depth law is learned from strokes; false only for the study of its benefit.
    pub learns: bool,
}

/// Order of the lines of a plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// From the last bend towards larger x, then from the first edge again.
    Onward,
    /// From both ends to the middle.
    EndsIn,
}
