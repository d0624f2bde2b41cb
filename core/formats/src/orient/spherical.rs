//! Spherical coordinates (range, azimuth, elevation) of stored cells as arrays, the form in which both passes use them.

use std::f64::consts::FRAC_PI_2;
use std::ops::Range;

use platen_scan::{Direction, State, wrap_azimuth};

use super::near_angle::NearAngle;
use super::places::Places;
use super::{Position, RawCell};

/// Range below which a cell flagged valid is not a measurement, in the file's unit: writers without a flag store
/// missing cells at the origin, some of them through a transform that leaves rounding noise.
const NO_RANGE: f64 = 1e-6;

/// Range above which a number is not a measurement in any unit.
pub(super) const NO_NUMBER: f64 = 1e12;

/// Cells as ranges and directions, in the unit and frame of their file and in its order: arrays of one length.
#[derive(Debug, Clone, Default)]
pub(crate) struct SphericalCells {
    /// Rows and columns in the file.
    pub(crate) places: Places,
    /// Ranges; not finite where the file contains no numbers.
    pub(crate) range: Vec<f64>,
    /// Azimuths, with the elevations below; directions stored in the file are kept to the last bit.
    pub(crate) azimuth: Vec<f64>,
    pub(crate) elevation: Vec<f64>,
    /// Intensities in the scale of the file.
    pub(crate) intensity: Vec<f64>,
    /// States as stored; see [`SphericalCells::true_state`].
    pub(crate) state: Vec<State>,
}

impl SphericalCells {
    /// Returns an empty set with capacity for `n` cells.
    pub(crate) fn with_capacity(n: usize) -> Self {
        Self {
            places: Places::default(),
            range: Vec::with_capacity(n),
            azimuth: Vec::with_capacity(n),
            elevation: Vec::with_capacity(n),
            intensity: Vec::with_capacity(n),
            state: Vec::with_capacity(n),
        }
    }

    /// Returns the number of cells.
    pub(crate) fn len(&self) -> usize {
        self.places.len()
    }

    /// Returns the state of a cell as determined by its numbers.
    pub(super) fn true_state(&self, cell: usize) -> State {
        true_state(self.range[cell], self.state[cell])
    }

    /// Returns the states of some cells as determined by their numbers.
    pub(super) fn true_states(&self, some: Range<usize>) -> Vec<State> {
        let stored = self.range[some.clone()].iter().zip(&self.state[some]);
        stored.map(|(range, state)| true_state(*range, *state)).collect()
    }

    /// Appends some of other cells, whose places are given.
    pub(crate) fn append(&mut self, other: &Self, some: Range<usize>, places: &Places) {
        places.runs().iter().for_each(|run| self.places.append(*run));
        self.range.extend_from_slice(&other.range[some.clone()]);
        self.azimuth.extend_from_slice(&other.azimuth[some.clone()]);
        self.elevation.extend_from_slice(&other.elevation[some.clone()]);
        self.intensity.extend_from_slice(&other.intensity[some.clone()]);
        self.state.extend_from_slice(&other.state[some]);
    }

    /// Removes all cells; keeps their room.
    pub(crate) fn clear(&mut self) {
        let Self { places, range, azimuth, elevation, intensity, state } = self;
        places.clear();
        [range, azimuth, elevation, intensity].into_iter().for_each(Vec::clear);
        state.clear();
    }
}

fn true_state(range: f64, stored: State) -> State {
    if (NO_RANGE..NO_NUMBER).contains(&range) { stored } else { State::NoReturn }
}

/// Cells, and the parts of their directions' unit vectors to the east, to the north and horizontal.
#[derive(Debug, Default)]
pub(crate) struct Converted {
    pub(crate) cells: SphericalCells,
    pub(crate) parts: Vec<[f64; 3]>,
}

impl Converted {
    /// Removes all cells; keeps their room.
    pub(crate) fn clear(&mut self) {
        self.cells.clear();
        self.parts.clear();
    }
}

/// Conversion of successive cells, whose directions are near to each other.
#[derive(Debug, Default)]
pub(crate) struct ToSpherical {
    azimuth: NearAngle,
    elevation: NearAngle,
}

impl ToSpherical {
    /// Appends a cell.
    #[inline]
    pub(crate) fn append(&mut self, cell: &RawCell, to: &mut Converted) {
        let RawCell { row, column, position, intensity, state } = *cell;
        let (range, direction, parts) = self.convert(position);
        let cells = &mut to.cells;
        cells.places.push(row, column);
        cells.range.push(range);
        cells.azimuth.push(direction.azimuth);
        cells.elevation.push(direction.elevation);
        cells.intensity.push(intensity);
        cells.state.push(state);
        to.parts.push(parts);
    }

    /// Appends the ranges and directions of cells.
    #[inline]
    pub(crate) fn append_positions(
        &mut self,
        positions: impl ExactSizeIterator<Item = Position>,
        to: &mut Converted,
    ) {
        let Converted { cells: SphericalCells { range, azimuth, elevation, .. }, parts } = to;
        let (start, end) = (range.len(), range.len() + positions.len());
        [&mut *range, azimuth, elevation].into_iter().for_each(|numbers| numbers.resize(end, 0.0));
        parts.resize(end, [0.0; 3]);
        let angles = azimuth[start..].iter_mut().zip(&mut elevation[start..]);
        let slots = range[start..].iter_mut().zip(angles).zip(&mut parts[start..]);
        for (position, ((range, (azimuth, elevation)), parts)) in positions.zip(slots) {
            let direction;
            (*range, direction, *parts) = self.convert(position);
            (*azimuth, *elevation) = (direction.azimuth, direction.elevation);
        }
    }

    /// Returns range and direction, and the parts of its unit vector.
    // Without inlining the position is passed through memory and delays the next step; for speed only: `tests::speed`.
    #[inline(always)]
    fn convert(&mut self, position: Position) -> (f64, Direction, [f64; 3]) {
        match position {
            Position::Cartesian(xyz) => self.of_cartesian(xyz),
            Position::Spherical(range, direction) => self.of_spherical(range, direction),
        }
    }

    #[inline(always)]
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
            // Beyond the zenith, where the azimuth differs; or not a number.
            return self.of_cartesian([parts[0], parts[1], sin_elevation].map(|part| part * range));
        }
        (range, Direction { azimuth: wrap_azimuth(direction.azimuth), ..direction }, parts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn convert(position: Position) -> (f64, Direction, [f64; 3], State) {
        let cell = RawCell { row: 3, column: 4, position, intensity: 0.5, state: State::Valid };
        let mut converted = Converted::default();
        ToSpherical::default().append(&cell, &mut converted);
        let Converted { cells, parts } = converted;
        let direction = Direction { azimuth: cells.azimuth[0], elevation: cells.elevation[0] };
        (cells.range[0], direction, parts[0], cells.true_state(0))
    }

    #[test]
    fn a_position_is_the_same_in_either_form() {
        let directions = [(0.3, 0.1), (-3.0, -1.5), (3.1, 1.57), (0.0, 0.0), (4.0, -0.7), (-9.0, 0.2)];
        for (azimuth, elevation) in directions {
            let direction = Direction { azimuth, elevation };
            let (range, same, parts, _) = convert(Position::Spherical(7.5, direction));
            let (distance, found, others, _) =
                convert(Position::Cartesian(direction.unit().map(|c| c * 7.5)));
            assert_eq!((range, same.elevation), (7.5, elevation));
            assert!((distance - 7.5).abs() < 1e-14);
            let turn = wrap_azimuth(found.azimuth - same.azimuth);
            assert!(turn.abs() < 1e-12 && (found.elevation - elevation).abs() < 1e-12);
            assert!(parts.iter().zip(others).all(|(a, b)| (a - b).abs() < 1e-14), "{parts:?} {others:?}");
        }
    }

    #[test]
    fn a_direction_beyond_the_zenith_is_that_of_its_point() {
        let beyond = Direction { azimuth: 0.2, elevation: 1.8 };
        let (_, found, ..) = convert(Position::Spherical(2.0, beyond));
        assert!(found.unit().iter().zip(beyond.unit()).all(|(a, b)| (a - b).abs() < 1e-15));
        assert!((found.elevation - (std::f64::consts::PI - 1.8)).abs() < 1e-15);
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
            assert_eq!(convert(place).3, State::NoReturn, "{place:?}");
        }
    }
}
