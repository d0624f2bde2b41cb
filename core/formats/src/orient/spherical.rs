//! Spherical coordinates (range, azimuth, elevation) of stored cells, the form in which both passes use them.

use std::f64::consts::FRAC_PI_2;

use platen_scan::{Direction, State, wrap_azimuth};

use super::near_angle::NearAngle;
use super::{Position, RawCell};

/// Range below which a cell flagged valid holds no measurement, in the file's unit: writers that have no flag
/// store missing cells at the origin, some of them through a transform that leaves rounding noise.
const NO_RANGE: f64 = 1e-6;

/// Range above which a number is no measurement in any unit.
pub(super) const NO_NUMBER: f64 = 1e12;

/// A cell as range and direction, in the unit and frame of its file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SphericalCell {
    /// Row number in the file.
    pub(crate) row: u32,
    /// Column number in the file.
    pub(crate) column: u32,
    /// Not finite where the file holds no numbers.
    pub(crate) range: f64,
    /// A file's own direction is kept to the last bit.
    pub(crate) direction: Direction,
    /// Intensity in the scale of the file.
    pub(crate) intensity: f64,
    /// State as stored; see [`SphericalCell::true_state`].
    pub(crate) state: State,
}

impl SphericalCell {
    /// Returns the state by the numbers of the cell.
    pub(super) fn true_state(&self) -> State {
        if (NO_RANGE..NO_NUMBER).contains(&self.range) { self.state } else { State::NoReturn }
    }
}

/// Conversion of successive cells, whose directions are near to each other.
#[derive(Debug, Default)]
pub(crate) struct ToSpherical {
    azimuth: NearAngle,
    elevation: NearAngle,
}

impl ToSpherical {
    /// Returns the cell as range and direction, and the parts of the direction's unit vector to the east, to the north and horizontal.
    #[inline]
    pub(crate) fn convert(&mut self, cell: &RawCell) -> (SphericalCell, [f64; 3]) {
        let (range, direction, parts) = match cell.position {
            Position::Cartesian(xyz) => self.of_cartesian(xyz),
            Position::Spherical(range, direction) => self.of_spherical(range, direction),
        };
        let RawCell { row, column, intensity, state, .. } = *cell;
        (SphericalCell { row, column, range, direction, intensity, state }, parts)
    }

    #[inline]
    fn of_cartesian(&mut self, [x, y, z]: [f64; 3]) -> (f64, Direction, [f64; 3]) {
        let across = x * x + y * y;
        let (range, horizontal) = ((across + z * z).sqrt(), across.sqrt());
        let azimuth = wrap_azimuth(self.azimuth.of(y, x));
        let direction = Direction { azimuth, elevation: self.elevation.of(z, horizontal) };
        let per_range = 1.0 / range;
        (range, direction, [x, y, horizontal].map(|part| part * per_range))
    }

    #[inline]
    fn of_spherical(&mut self, range: f64, direction: Direction) -> (f64, Direction, [f64; 3]) {
        let (sin_azimuth, cos_azimuth) = self.azimuth.sin_cos(direction.azimuth);
        let (sin_elevation, cos_elevation) = self.elevation.sin_cos(direction.elevation);
        let parts = [cos_elevation * cos_azimuth, cos_elevation * sin_azimuth, cos_elevation];
        if !(-FRAC_PI_2..=FRAC_PI_2).contains(&direction.elevation) || !direction.azimuth.is_finite() {
            // Beyond the zenith, where the azimuth is another; or no number.
            return self.of_cartesian([parts[0], parts[1], sin_elevation].map(|part| part * range));
        }
        (range, Direction { azimuth: wrap_azimuth(direction.azimuth), ..direction }, parts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn convert(position: Position) -> (SphericalCell, [f64; 3]) {
        let cell = RawCell { row: 3, column: 4, position, intensity: 0.5, state: State::Valid };
        ToSpherical::default().convert(&cell)
    }

    #[test]
    fn a_position_is_the_same_in_either_form() {
        let directions = [(0.3, 0.1), (-3.0, -1.5), (3.1, 1.57), (0.0, 0.0), (4.0, -0.7), (-9.0, 0.2)];
        for (azimuth, elevation) in directions {
            let direction = Direction { azimuth, elevation };
            let (spherical, parts) = convert(Position::Spherical(7.5, direction));
            let (cartesian, others) = convert(Position::Cartesian(direction.unit().map(|c| c * 7.5)));
            assert_eq!((spherical.range, spherical.direction.elevation), (7.5, elevation));
            assert!((cartesian.range - 7.5).abs() < 1e-14);
            let turn = wrap_azimuth(cartesian.direction.azimuth - spherical.direction.azimuth);
            assert!(turn.abs() < 1e-12 && (cartesian.direction.elevation - elevation).abs() < 1e-12);
            assert!(parts.iter().zip(others).all(|(a, b)| (a - b).abs() < 1e-14), "{parts:?} {others:?}");
        }
    }

    #[test]
    fn a_direction_beyond_the_zenith_is_that_of_its_point() {
        let beyond = Direction { azimuth: 0.2, elevation: 1.8 };
        let (cell, _) = convert(Position::Spherical(2.0, beyond));
        assert!(cell.direction.unit().iter().zip(beyond.unit()).all(|(a, b)| (a - b).abs() < 1e-15));
        assert!((cell.direction.elevation - (std::f64::consts::PI - 1.8)).abs() < 1e-15);
    }

    #[test]
    fn what_is_no_number_is_no_return() {
        let nan = f64::NAN;
        let places = [
            Position::Cartesian([nan, 1.0, 1.0]),
            Position::Cartesian([1.0, f64::INFINITY, 1.0]),
            Position::Cartesian([0.0; 3]),
            Position::Spherical(5.0, Direction { azimuth: nan, elevation: 0.0 }),
            Position::Spherical(5.0, Direction { azimuth: 0.0, elevation: nan }),
            Position::Spherical(nan, Direction { azimuth: 0.0, elevation: 0.0 }),
            Position::Spherical(5.0, Direction { azimuth: f64::INFINITY, elevation: 0.0 }),
        ];
        for place in places {
            assert_eq!(convert(place).0.true_state(), State::NoReturn, "{place:?}");
        }
    }
}
