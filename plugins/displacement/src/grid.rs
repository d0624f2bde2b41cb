//! Both surfaces at the same material points.

use platen_sdk::PlateGrid;
use platen_shape::{Surface, Vec3};

/// Material points of the plate, v outer, u inner.
#[derive(Debug)]
pub(crate) struct Nodes {
    /// Their places on the rectangle.
    pub(crate) grid: PlateGrid,
    /// On the scanned face now.
    pub(crate) now: Vec<Vec3>,
    /// On the scanned face then.
    pub(crate) before: Vec<Vec3>,
    /// Normal now, towards the scanner.
    pub(crate) normal: Vec<Vec3>,
    /// Standard deviation of the difference along the normal, from both fits.
    pub(crate) sigma: Vec<f64>,
    /// Seen both times.
    pub(crate) seen: Vec<bool>,
}

impl Nodes {
    pub(crate) fn new(now: &Surface, before: &Surface) -> Self {
        let grid = PlateGrid::new(now);
        Self {
            now: grid.map(|u, v| now.face(u, v)),
            before: grid.map(|u, v| before.face(u, v)),
            normal: grid.map(|u, v| now.normal(u, v)),
            sigma: grid.map(|u, v| now.sigma_point(u, v).hypot(before.sigma_point(u, v))),
            seen: grid.map(|u, v| now.mask().seen(u, v) && before.mask().seen(u, v)),
            grid,
        }
    }

    /// Middle of the plate before.
    pub(crate) fn centre(&self) -> Vec3 {
        self.before[PlateGrid::NODES / 2]
    }
}
