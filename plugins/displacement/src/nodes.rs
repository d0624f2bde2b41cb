//! Material points of both surfaces at equal (u, v).

use platen_sdk::PlateGrid;
use platen_shape::{Surface, Vec3};

/// Material points of the plate, v outer, u inner.
#[derive(Debug)]
pub(crate) struct Nodes {
    /// Their positions on the rectangle.
    pub(crate) grid: PlateGrid,
    /// Positions on the scanned face now.
    pub(crate) now: Vec<Vec3>,
    /// Positions on the scanned face in the earlier scan.
    pub(crate) before: Vec<Vec3>,
    /// Unit normal now, towards the scanner.
    pub(crate) normal: Vec<Vec3>,
    /// Standard deviation of the difference along the normal, from both fits, metres.
    pub(crate) sigma: Vec<f64>,
    /// Standard deviation of the scanner's correlated error of a difference, metres.
    pub(crate) correlated: f64,
    /// Whether both scans saw the point.
    pub(crate) seen: Vec<bool>,
}

impl Nodes {
    /// Evaluates both surfaces at every node of the grid.
    pub(crate) fn new(now: &Surface, before: &Surface, correlated: f64) -> Self {
        let grid = PlateGrid::new(now);
        Self::at(now, before, &grid.map(|u, v| [u, v]), correlated)
    }

    /// Evaluates both surfaces at `places`, (u, v) in metres.
    pub(crate) fn at(now: &Surface, before: &Surface, places: &[[f64; 2]], correlated: f64) -> Self {
        let places = || places.iter().copied();
        let seen = |[u, v]: [f64; 2]| now.mask().seen(u, v) && before.mask().seen(u, v);
        Self {
            grid: PlateGrid::new(now),
            now: places().map(|[u, v]| now.face(u, v)).collect(),
            before: places().map(|[u, v]| before.face(u, v)).collect(),
            normal: places().map(|[u, v]| now.normal(u, v)).collect(),
            sigma: places().map(|[u, v]| now.sigma_repeat(u, v).hypot(before.sigma_repeat(u, v))).collect(),
            correlated,
            seen: places().map(seen).collect(),
        }
    }

    /// Returns the earlier position of the middle point of the list: for the whole grid, the middle of the plate.
    pub(crate) fn centre(&self) -> Vec3 {
        self.before[self.before.len() / 2]
    }
}
