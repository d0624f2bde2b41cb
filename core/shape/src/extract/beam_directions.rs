//! Beam directions from sines and cosines stored per row and per column, without trigonometry per cell.
//!
//! For speed only: benchmark `columns`.

use crate::Vec3;

/// Largest angle, radians, for which the series of [`AngleSinCos::by`] is exact to the last bits of an f64.
const SMALL: f64 = 0.02;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct AngleSinCos {
    pub(super) sin: f64,
    pub(super) cos: f64,
}

impl AngleSinCos {
    pub(super) fn of(angle: f64) -> Self {
        let (sin, cos) = angle.sin_cos();
        Self { sin, cos }
    }

    /// Returns the sum with another angle, radians.
    #[inline]
    pub(super) fn by(self, angle: f64) -> Self {
        let by = if angle.abs() < SMALL {
            let x2 = angle * angle;
            let sin = angle * (1.0 - x2 * (1.0 / 6.0) * (1.0 - x2 * (1.0 / 20.0)));
            let cos = 1.0 - 0.5 * x2 * (1.0 - x2 * (1.0 / 12.0) * (1.0 - x2 * (1.0 / 30.0)));
            Self { sin, cos }
        } else {
            Self::of(angle)
        };
        Self { sin: self.sin * by.cos + self.cos * by.sin, cos: self.cos * by.cos - self.sin * by.sin }
    }
}

/// Direction of a beam from the scanner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct BeamDirection {
    pub(super) azimuth: AngleSinCos,
    pub(super) elevation: AngleSinCos,
}

impl BeamDirection {
    /// Returns the unit vector, scanner frame.
    #[inline]
    pub(super) fn unit(&self) -> Vec3 {
        let Self { azimuth, elevation } = self;
        Vec3::new(elevation.cos * azimuth.cos, elevation.cos * azimuth.sin, elevation.sin)
    }

    /// Returns the unit normal, towards the scanner, of a surface seen in this direction. `inverse` is its inverse
    /// range, `by_azimuth` and `by_elevation` the derivatives of that by the angles. `None` on a surface without
    /// normal.
    ///
    /// On the plane n . x = h the inverse range along the unit direction d is n . d / h: the normal is the gradient of
    /// the inverse range continued homogeneously, q d + q_el e_el + q_az / cos el e_az.
    #[inline]
    pub(super) fn normal(&self, inverse: f64, by_azimuth: f64, by_elevation: f64) -> Option<Vec3> {
        let Self { azimuth, elevation } = self;
        let outward = inverse * elevation.cos - by_elevation * elevation.sin;
        let sideways = by_azimuth / elevation.cos;
        let gradient = Vec3::new(
            outward * azimuth.cos - sideways * azimuth.sin,
            outward * azimuth.sin + sideways * azimuth.cos,
            inverse * elevation.sin + by_elevation * elevation.cos,
        );
        let norm = gradient.norm();
        (norm > 0.0).then(|| gradient * (-1.0 / norm))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_is_that_of_the_sum_of_the_angles() {
        for (angle, by) in [(0.3, 0.0), (-2.0, 1e-4), (1.5, -0.0199), (3.0, 0.0201), (0.1, 2.0)] {
            let (turned, sum) = (AngleSinCos::of(angle).by(by), AngleSinCos::of(angle + by));
            assert!(
                (turned.sin - sum.sin).abs() < 1e-15 && (turned.cos - sum.cos).abs() < 1e-15,
                "{angle} {by}"
            );
        }
    }

    #[test]
    fn the_normal_of_a_plane_is_its_own() {
        let (plane, h) = (Vec3::new(0.2, -0.3, 0.9).normalize(), -3.0);
        let inverse = |azimuth: f64, elevation: f64| {
            let beam =
                BeamDirection { azimuth: AngleSinCos::of(azimuth), elevation: AngleSinCos::of(elevation) };
            plane.dot(&beam.unit()) / h
        };
        let (azimuth, elevation, d) = (0.7, -0.9, 1e-5);
        let beam = BeamDirection { azimuth: AngleSinCos::of(azimuth), elevation: AngleSinCos::of(elevation) };
        let by_azimuth = (inverse(azimuth + d, elevation) - inverse(azimuth - d, elevation)) / (2.0 * d);
        let by_elevation = (inverse(azimuth, elevation + d) - inverse(azimuth, elevation - d)) / (2.0 * d);
        let normal = beam.normal(inverse(azimuth, elevation), by_azimuth, by_elevation).expect("a normal");
        assert!((normal - plane).norm() < 1e-9, "{normal}");
    }
}
