//! Both surfaces at the same material points.

use platen_shape::{Surface, Vec3};

/// Nodes along each side: every fifth is a node of the result's grid.
pub(crate) const NODES: usize = 101;

/// Material points of the plate, v outer, u inner.
#[derive(Debug)]
pub(crate) struct Nodes {
    /// Place on the rectangle.
    pub(crate) uv: Vec<[f64; 2]>,
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
    /// Area of the plate that a node stands for.
    pub(crate) cell: f64,
}

impl Nodes {
    pub(crate) fn new(now: &Surface, before: &Surface) -> Self {
        let at = |k: usize, length: f64| length * k as f64 / (NODES - 1) as f64;
        let uv: Vec<[f64; 2]> =
            (0..NODES * NODES).map(|i| [at(i % NODES, now.width()), at(i / NODES, now.height())]).collect();
        let each = |f: &dyn Fn(f64, f64) -> Vec3| uv.iter().map(|&[u, v]| f(u, v)).collect();
        Self {
            now: each(&|u, v| now.face(u, v)),
            before: each(&|u, v| before.face(u, v)),
            normal: each(&|u, v| now.normal(u, v)),
            sigma: uv.iter().map(|&[u, v]| now.sigma_point(u, v).hypot(before.sigma_point(u, v))).collect(),
            seen: uv.iter().map(|&[u, v]| now.mask().seen(u, v) && before.mask().seen(u, v)).collect(),
            cell: now.width() * now.height() / ((NODES - 1) * (NODES - 1)) as f64,
            uv,
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.uv.len()
    }

    /// Middle of the plate before.
    pub(crate) fn centre(&self) -> Vec3 {
        self.before[self.len() / 2]
    }
}
