//! Angles of successive points, and sines and cosines of successive angles, by Taylor series from a nearby direction.
//!
//! Neighbouring cells of a lattice differ by a step of the scanner, so that only the small angle from a known direction
//! is computed, without a trigonometric function per cell. The results differ from `atan2`, `sin` and `cos` by less
//! than 1e-15. For speed only: `tests::speed::speed_of_every_format`.

/// Largest angle from the known direction, or its tangent; the first term left out of each series is below 3e-18 there.
const NEAR: f64 = 1.0 / 32.0;

/// Angles in one plane, each computed from a previous direction.
#[derive(Debug, Clone, Copy)]
pub(super) struct NearAngle {
    angle: f64,
    sin: f64,
    cos: f64,
}

impl Default for NearAngle {
    fn default() -> Self {
        Self { angle: 0.0, sin: 0.0, cos: 1.0 }
    }
}

impl NearAngle {
    /// Returns `y.atan2(x)`; up to whole turns where [`sin_cos`](Self::sin_cos) was called with an angle beyond half a
    /// turn.
    #[inline]
    pub(super) fn of(&mut self, y: f64, x: f64) -> f64 {
        let (across, along) = (y * self.cos - x * self.sin, x * self.cos + y * self.sin);
        // False for numbers that are not finite, and at the origin.
        if across.abs() < NEAR * along {
            let tangent = across / along;
            let square = tangent * tangent;
            let series =
                1.0 - square * (1.0 / 3.0 - square * (0.2 - square * (1.0 / 7.0 - square * (1.0 / 9.0))));
            return self.angle + tangent * series;
        }
        self.angle = y.atan2(x);
        (self.sin, self.cos) = self.angle.sin_cos();
        self.angle
    }

    /// Returns sine and cosine of an angle.
    #[inline]
    pub(super) fn sin_cos(&mut self, angle: f64) -> (f64, f64) {
        let by = angle - self.angle;
        if by.abs() < NEAR {
            let square = by * by;
            let sin = by * (1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0)));
            let cos =
                1.0 - square / 2.0 * (1.0 - square / 12.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0)));
            return (self.sin * cos + self.cos * sin, self.cos * cos - self.sin * sin);
        }
        self.angle = angle;
        (self.sin, self.cos) = angle.sin_cos();
        (self.sin, self.cos)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_those_of_atan2() {
        let mut random = fastrand::Rng::with_seed(5);
        let mut worst = 0.0_f64;
        for step in [1e-5, 1e-3, 0.03, 0.4, 2.0] {
            let (mut near, mut by_angle, mut angle) = (NearAngle::default(), NearAngle::default(), 0.0_f64);
            for _ in 0..20_000 {
                angle += step * random.f64();
                let radius = 0.1 + 100.0 * random.f64();
                let (y, x) = (radius * angle.sin(), radius * angle.cos());
                let error = (near.of(y, x) - y.atan2(x)).abs();
                // The seam at pi: both are the same direction.
                worst = worst.max(error.min((error - std::f64::consts::TAU).abs()));
                let (sin, cos) = by_angle.sin_cos(angle);
                worst = worst.max((sin - angle.sin()).abs()).max((cos - angle.cos()).abs());
            }
        }
        println!("largest difference {worst:e}");
        assert!(worst < 1e-15);
    }

    #[test]
    fn the_origin_and_wild_numbers_are_as_with_atan2() {
        let values = [0.0, -0.0, 1.0, -1.0, 1e300, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 1e-300];
        for (y, x) in values.into_iter().flat_map(|y| values.map(|x| (y, x))) {
            let mut near = NearAngle::default();
            near.of(0.3, 0.4);
            let (found, expected) = (near.of(y, x), y.atan2(x));
            assert!(
                found == expected || found.is_nan() && expected.is_nan() || (found - expected).abs() < 1e-15,
                "{y} {x}: {found}"
            );
            // Later results are not affected.
            let after = near.of(0.3, 0.4) - 0.3_f64.atan2(0.4);
            assert!(after.abs() < 1e-15, "after {y} {x}");
        }
    }
}
