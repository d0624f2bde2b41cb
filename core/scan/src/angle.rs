//! Directions of beams and windows of directions.

use std::f64::consts::{PI, TAU};

/// Direction of one beam in the scanner frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Direction {
    /// Azimuth, radians, counter-clockwise from +x seen from above.
    pub azimuth: f64,
    /// Elevation, radians above the horizontal plane.
    pub elevation: f64,
}

impl Direction {
    /// Returns the direction of `point` (metres, scanner frame); that of the origin is +x.
    pub fn of(point: [f64; 3]) -> Self {
        let [x, y, z] = point;
        Self { azimuth: y.atan2(x), elevation: z.atan2(x.hypot(y)) }
    }

    /// Returns the unit vector along the beam.
    pub fn unit(self) -> [f64; 3] {
        let (sin_az, cos_az) = self.azimuth.sin_cos();
        let (sin_el, cos_el) = self.elevation.sin_cos();
        [cos_el * cos_az, cos_el * sin_az, sin_el]
    }
}

/// Returns the azimuth in (-pi, pi]; an azimuth already within is unchanged to the last bit.
pub fn wrap_azimuth(azimuth: f64) -> f64 {
    if -PI < azimuth && azimuth <= PI {
        return azimuth;
    }
    let wrapped = azimuth.rem_euclid(TAU);
    if wrapped > PI { wrapped - TAU } else { wrapped }
}

/// Angular window of the scanner: the part of the dome that a region scan covers, radians.
///
/// `azimuth_width` runs counter-clockwise from `azimuth_start`, so that a window across the seam at pi is not a special
/// case.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    /// First azimuth.
    pub azimuth_start: f64,
    /// Width towards increasing azimuth, 0 to 2 pi.
    pub azimuth_width: f64,
    /// Lowest elevation.
    pub elevation_min: f64,
    /// Highest elevation.
    pub elevation_max: f64,
}

impl Window {
    /// Returns whether `direction` lies in the window.
    pub fn contains(&self, direction: Direction) -> bool {
        let ahead = (direction.azimuth - self.azimuth_start).rem_euclid(TAU);
        ahead <= self.azimuth_width
            && (self.elevation_min..=self.elevation_max).contains(&direction.elevation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn direction_and_unit_vector_agree() {
        for point in [[3.0, 4.0, 1.0], [-2.0, 0.5, -3.0], [0.0, -1.0, 0.2]] {
            let r = point.iter().map(|c| c * c).sum::<f64>().sqrt();
            let unit = Direction::of(point).unit();
            for k in 0..3 {
                assert!((unit[k] * r - point[k]).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn window_across_the_seam_holds_both_sides() {
        let window =
            Window { azimuth_start: 3.0, azimuth_width: 0.5, elevation_min: -1.0, elevation_max: 1.0 };
        let at = |azimuth| window.contains(Direction { azimuth, elevation: 0.0 });
        assert!(at(3.1) && at(-3.1) && !at(2.9) && !at(-2.5));
    }
}
