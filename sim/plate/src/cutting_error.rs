//! Cutting errors of a blank: corner offsets and bowed edges, as a map from the ordered rectangle to the cut blank.
//!
//! Corner offsets are interpolated bilinearly, edge bows are parabolas blended linearly across the rectangle.

use crate::Blank;

/// Map from the ordered rectangle to the cut blank.
#[derive(Debug, Clone)]
pub(crate) struct CuttingError {
    size: [f64; 2],
    corners: [[f64; 2]; 4],
    /// Sagitta of the edges v = 0, u = W, v = H, u = 0, positive outwards, metres.
    bows: [f64; 4],
}

impl CuttingError {
    /// Creates the map of a blank; `None` for an exact rectangle.
    pub(crate) fn new(blank: &Blank) -> Option<Self> {
        let corners = blank.corners_off_mm.map(|off| off.map(|mm| mm * 1e-3));
        let bows = blank.bows_mm.map(|mm| mm * 1e-3);
        let size = [blank.width_mm * 1e-3, blank.height_mm * 1e-3];
        let is_cut = corners.iter().flatten().chain(&bows).any(|off| *off != 0.0);
        is_cut.then_some(Self { size, corners, bows })
    }

    /// Returns the material point (u, v) of the point (a, b) of the rectangle, and its derivatives
    /// `[[du/da, du/db], [dv/da, dv/db]]`.
    pub(crate) fn material(&self, a: f64, b: f64) -> ([f64; 2], [[f64; 2]; 2]) {
        let [w, h] = self.size;
        let (s, t) = (a / w, b / h);
        let mut uv = [a, b];
        let mut slopes = [[1.0, 0.0], [0.0, 1.0]];
        let weights = [(1.0 - s, 1.0 - t), (s, 1.0 - t), (s, t), (1.0 - s, t)];
        let signs = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        for ((off, (x, y)), (by_s, by_t)) in self.corners.iter().zip(weights).zip(signs) {
            for k in 0..2 {
                uv[k] += off[k] * x * y;
                slopes[k][0] += off[k] * by_s * y / w;
                slopes[k][1] += off[k] * x * by_t / h;
            }
        }
        let [bottom, right, top, left] = self.bows;
        let (arch_s, arch_t) = (4.0 * s * (1.0 - s), 4.0 * t * (1.0 - t));
        let (slope_s, slope_t) = (4.0 * (1.0 - 2.0 * s), 4.0 * (1.0 - 2.0 * t));
        let (across_u, across_v) = (right * s - left * (1.0 - s), top * t - bottom * (1.0 - t));
        uv[0] += across_u * arch_t;
        uv[1] += across_v * arch_s;
        slopes[0][0] += (right + left) / w * arch_t;
        slopes[0][1] += across_u * slope_t / h;
        slopes[1][0] += across_v * slope_s / w;
        slopes[1][1] += (top + bottom) / h * arch_s;
        (uv, slopes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PlateState;

    #[test]
    fn corners_and_bows_are_where_they_were_asked_and_slopes_agree_with_differences() {
        let mut blank = PlateState::flat(4000.0, 3000.0, 36.0).blank;
        assert!(CuttingError::new(&blank).is_none());
        blank.corners_off_mm = [[0.0, 0.0], [4.0, 0.0], [7.0, -3.0], [3.0, -3.0]];
        blank.bows_mm = [0.0, 2.0, -1.0, 0.5];
        let cut = CuttingError::new(&blank).unwrap();
        let near = |a: f64, b: f64, [u, v]: [f64; 2]| {
            let ([x, y], _) = cut.material(a, b);
            assert!((x - u).hypot(y - v) < 1e-12, "({a}, {b}) at ({x}, {y})");
        };
        near(4.0, 3.0, [4.007, 2.997]);
        near(4.0, 1.5, [4.0055 + 0.002, 1.4985]);
        near(2.0, 3.0, [2.005, 2.997 - 0.001]);
        near(0.0, 1.5, [0.0015 - 0.0005, 1.4985]);
        let (_, slopes) = cut.material(1.1, 0.7);
        let d = 1e-6;
        let difference = |by: [f64; 2]| {
            let (p, q) = (cut.material(1.1 + by[0], 0.7 + by[1]).0, cut.material(1.1 - by[0], 0.7 - by[1]).0);
            [0, 1].map(|k| (p[k] - q[k]) / (2.0 * d))
        };
        for (column, by) in [[d, 0.0], [0.0, d]].into_iter().enumerate() {
            let difference = difference(by);
            assert!(
                (0..2).all(|k| (slopes[k][column] - difference[k]).abs() < 1e-8),
                "{slopes:?} {difference:?}"
            );
        }
    }
}
