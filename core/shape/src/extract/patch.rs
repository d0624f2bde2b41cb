//! Patch: samples on the plate's scanned face and crossings of its boundary, the output of the extraction.
//!
//! A crossing is the place where a row or a column of the lattice leaves the face.

use crate::Vec3;

/// One sample on the scanned face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Position, metres, scanner frame. The scanner is at the origin.
    pub point: Vec3,
    /// Column of the lattice.
    pub column: u32,
    /// Row of the lattice.
    pub row: u32,
    /// Standard deviation of the range, metres, as estimated from the scan.
    pub sigma: f32,
    /// Raw intensity.
    pub intensity: u16,
}

/// Kind of object next to a cell of the face along its row or column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Beyond {
    /// An object farther away than the continuation of the face: the plate ends here.
    Behind,
    /// The plate's side face: the face ends here too.
    SideFace,
    /// A nearer object, behind which the plate may continue.
    InFront,
    /// No return: the plate ends without a background, or the cell is part of a patch without echo.
    Nothing,
}

/// A plane of the background: a floor, a wall, a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneBehind {
    /// Number of the plane, equal for all cells that see it.
    pub number: u8,
    /// Distance from the scanner, metres.
    pub distance: f32,
    /// True when the row or column meets the plane in this cell only.
    pub narrow: bool,
}

/// A set of planes of the background.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PlaneSet(u8);

impl FromIterator<u8> for PlaneSet {
    /// Collects planes by their numbers, each below 8.
    fn from_iter<I: IntoIterator<Item = u8>>(numbers: I) -> Self {
        Self(numbers.into_iter().fold(0, |set, number| set | 1_u8.checked_shl(number.into()).unwrap_or(0)))
    }
}

impl PlaneSet {
    /// Returns the numbers of the planes.
    pub fn numbers(self) -> impl Iterator<Item = u8> {
        (0..8).filter(move |number| self.0 >> number & 1 == 1)
    }

    /// Returns true when no plane is in the set.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }
}

/// Mixed pixels along a row or a column: their beams straddle the end of the face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MixedPixels {
    /// The mixed pixels nearest to and farthest from the face, on the continuation of the smoothed face, metres,
    /// scanner frame.
    pub ends: [Vec3; 2],
    /// Range of the nearest one minus that of the continuation there, metres.
    pub excess: f32,
    /// Range of the background's plane along the beam of the nearest one minus that of the continuation there, metres.
    /// `None` without a plane.
    pub jump: Option<f32>,
}

/// Crossing of a row or a column of the lattice with the boundary of the face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// The last cell inside, as an index into [`Patch::samples`].
    pub sample: u32,
    /// Step from that cell along the lattice: -1, 0 or 1 columns and rows, one of the two 0.
    pub step: [i8; 2],
    /// Number of cells from `inside` to `outside`; 0 where the end of the face was located between two cells.
    pub cells: u16,
    /// Last point inside, metres, scanner frame. The end of the face lies between `inside` and `outside`.
    pub inside: Vec3,
    /// First point outside, metres, scanner frame. Both points lie on the smoothed face or its continuation.
    pub outside: Vec3,
    /// Unit normal of the face towards the scanner.
    pub normal: Vec3,
    /// Mixed pixels between `inside` and `outside`.
    pub mixed: Option<MixedPixels>,
    /// Mixed pixels in front of all planes of `strips`: these certainly see the plate.
    pub surely_mixed: Option<MixedPixels>,
    /// Planes of the background between the face and the cell at `outside` that the beams of the mixed pixels would
    /// meet if the planes extended so far: a strip of such a plane may be visible here.
    pub strips: PlaneSet,
    /// True when every cell between `inside` and `outside` was measured, so that `mixed` contains all mixed pixels.
    pub complete: bool,
    /// Range of the cell at `outside` minus that of the face's continuation there, metres; 0 without a range.
    pub excess: f32,
    /// Standard deviations of the range, metres, by which mixed pixels beside the face and beside that cell are
    /// detected.
    pub noise: [f32; 2],
    /// Plane of the background on which that cell lies.
    pub background: Option<PlaneBehind>,
    /// Kind of object next to the face.
    pub beyond: Beyond,
}

/// The plate's scanned face: its samples without side faces and mixed pixels, by column, then by row.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Patch {
    /// Samples, ordered by (column, row), each cell at most once.
    pub samples: Vec<Sample>,
    /// Ends of the face along rows and columns, ordered by sample. Cells without return inside the face are not ends.
    pub crossings: Vec<Crossing>,
    /// Angle between neighbouring columns, radians.
    pub azimuth_step: f64,
    /// Angle between neighbouring rows, radians.
    pub elevation_step: f64,
    /// Pooled standard deviation of the range on the plate, metres, as estimated from the scan.
    pub noise: f64,
}
