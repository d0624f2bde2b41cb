//! Lower bound of the diameter of a point set: its widths along 13 fixed directions, metres.

/// Directions to the faces, edges and corners of a cube: no direction is farther than 28 degrees from one of them.
const DIRECTIONS: [[f64; 3]; 13] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 1.0, 0.0],
    [1.0, -1.0, 0.0],
    [1.0, 0.0, 1.0],
    [1.0, 0.0, -1.0],
    [0.0, 1.0, 1.0],
    [0.0, 1.0, -1.0],
    [1.0, 1.0, 1.0],
    [1.0, 1.0, -1.0],
    [1.0, -1.0, 1.0],
    [1.0, -1.0, -1.0],
];

/// Smallest and largest coordinate of a point set along each direction.
#[derive(Debug, Clone)]
pub(super) struct WidthBound([(f64, f64); 13]);

impl Default for WidthBound {
    fn default() -> Self {
        Self([(f64::MAX, f64::MIN); 13])
    }
}

impl WidthBound {
    pub(super) fn add(&mut self, point: [f64; 3]) {
        for (span, d) in self.0.iter_mut().zip(&DIRECTIONS) {
            let along = d[0] * point[0] + d[1] * point[1] + d[2] * point[2];
            *span = (span.0.min(along), span.1.max(along));
        }
    }

    /// Returns the largest width, a lower bound of the diameter.
    pub(super) fn width(&self) -> f64 {
        let widths = self
            .0
            .iter()
            .zip(&DIRECTIONS)
            .map(|((low, high), d)| (high - low) / (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt());
        widths.fold(0.0, f64::max)
    }
}
