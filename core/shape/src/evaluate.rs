//! Evaluation of the fitted surface at material points: markers, reference lines and a grid, with standard deviations.
//!
//! In: the surface S and the uncertainties of its edges and of the flattening. Out: positions, curvatures and their
//! standard deviations. (u, v) are coordinates of the mid-surface; every position is that of the scanned face above it.
//!
//! Masuda et al., 4.4, map reference lines in the same way; the uncertainties are own.

use crate::flatten::Misplacement;
use crate::range_error::RangeError;
use crate::surface::{Curvature, Surface};
use crate::{Chart, DiskMesh, Vec3};

/// Spacing of the points of a reference line, metres.
pub const LINE_STEP: f64 = 0.05;
/// Number of places of the grid along u and along v.
pub const GRID: [usize; 2] = [21, 21];

/// Uncertainty of material points within the surface.
///
/// A point's u follows from the edges u = 0 and u = W, each with its own standard deviation, and from the flattening
/// with its uncertainty; likewise v. The scanner's range error moves the edges within the surface, and the surface
/// itself along the normal.
#[derive(Debug, Clone, PartialEq)]
pub struct Location {
    width: f64,
    height: f64,
    edge_sigma: [f64; 4],
    /// Largest standard deviations of u and v by the flattening among the vertices of each cell of the rectangle.
    cells: Vec<[f64; 2]>,
    range_error: RangeError,
}

/// A material point on the scanned face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Along u, metres.
    pub u: f64,
    /// Along v, metres.
    pub v: f64,
    /// Position on the scanned face, metres, scanner frame.
    pub position: Vec3,
    /// Standard deviations along u, along v and along the normal, metres.
    pub sigma: [f64; 3],
    /// False where no sample was near and the surface was bridged.
    pub seen: bool,
}

/// A node of the grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Node {
    /// The material point.
    pub place: Place,
    /// Curvature of the mid-surface.
    pub curvature: Curvature,
    /// Standard deviations of the curvatures along u and v and of the twist, 1/m.
    pub sigma_curvature: [f64; 3],
}

/// Places on a regular grid over the rectangle, edges included; v outer, u inner.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// Nodes along u.
    pub n_u: usize,
    /// Nodes along v.
    pub n_v: usize,
    /// The nodes.
    pub nodes: Vec<Node>,
}

/// Number of cells of [`Location`] along each side.
const CELLS: usize = 16;

impl Location {
    /// Collects the uncertainties of the mesh's edges, those stated by the chart, and the chart's misplacement, which
    /// counts as a standard deviation.
    #[must_use]
    pub fn new(mesh: &DiskMesh, chart: &Chart, misplacement: &Misplacement) -> Self {
        let mut cells = vec![[0.0_f64; 2]; CELLS * CELLS];
        let own = |vertex: usize| chart.sigma.as_ref().map_or([0.0; 2], |sigma| sigma[vertex]);
        for (vertex, ([u, v], by)) in chart.uv.iter().zip(&misplacement.by).enumerate() {
            let own = own(vertex);
            let sigma = [0, 1].map(|c| own[c].hypot(by[c]));
            let cell = &mut cells[cell(*u, mesh.width) + CELLS * cell(*v, mesh.height)];
            *cell = [cell[0].max(sigma[0]), cell[1].max(sigma[1])];
        }
        Self {
            width: mesh.width,
            height: mesh.height,
            edge_sigma: mesh.edge_sigma,
            cells,
            range_error: RangeError::default(),
        }
    }

    /// Adds the scanner's range error, which is not in the covariance of a fit.
    #[must_use]
    pub fn with_range_error(self, range_error: RangeError) -> Self {
        Self { range_error, ..self }
    }

    /// Returns the standard deviations of u and of v and along the normal at a place of `surface`, metres.
    #[must_use]
    pub fn sigma(&self, surface: &Surface, u: f64, v: f64) -> [f64; 3] {
        let (x, y) = ((u / self.width).clamp(0.0, 1.0), (v / self.height).clamp(0.0, 1.0));
        let [bottom, right, top, left] = self.edge_sigma;
        let flattening = self.cells[cell(u, self.width) + CELLS * cell(v, self.height)];
        // Contribution of an edge, `at` a place on it, along the direction `along`, weighted by its share in the place.
        let edge = |share: f64, sigma: f64, at: [f64; 2], along: &Vec3| {
            let moved = self.range_error.along(&surface.face(at[0], at[1]), along);
            (share * sigma).hypot(share * moved)
        };
        let derivatives = surface.derivatives(u, v);
        let [along_u, along_v] = [derivatives.u, derivatives.v].map(|along| along.normalize());
        let of_u = edge(1.0 - x, left, [0.0, v], &along_u).hypot(edge(x, right, [self.width, v], &along_u));
        let of_v = edge(1.0 - y, bottom, [u, 0.0], &along_v).hypot(edge(y, top, [u, self.height], &along_v));
        let normal = surface.sigma_point(u, v);
        let moved = self.range_error.along(&surface.face(u, v), &derivatives.normal());
        [of_u.hypot(flattening[0]), of_v.hypot(flattening[1]), normal.hypot(moved)]
    }
}

fn cell(x: f64, length: f64) -> usize {
    ((x / length * CELLS as f64).max(0.0) as usize).min(CELLS - 1)
}

/// Evaluates the material point (u, v) on the scanned face.
#[must_use]
pub fn place(surface: &Surface, location: &Location, u: f64, v: f64) -> Place {
    let sigma = location.sigma(surface, u, v);
    Place { u, v, position: surface.face(u, v), sigma, seen: surface.mask().seen(u, v) }
}

/// Evaluates points of a straight line of the rectangle: one every [`LINE_STEP`] from `from`, and the end.
#[must_use]
pub fn reference_line(surface: &Surface, location: &Location, from: [f64; 2], to: [f64; 2]) -> Vec<Place> {
    let length = (to[0] - from[0]).hypot(to[1] - from[1]);
    let steps = (length / LINE_STEP - 1e-9).ceil().max(0.0) as usize;
    (0..=steps)
        .map(|k| if k == steps { 1.0 } else { k as f64 * LINE_STEP / length })
        .map(|f| place(surface, location, from[0] + f * (to[0] - from[0]), from[1] + f * (to[1] - from[1])))
        .collect()
}

/// Evaluates the grid of `n_u` x `n_v` places over the whole rectangle, at least 2 x 2.
#[must_use]
pub fn grid(surface: &Surface, location: &Location, n_u: usize, n_v: usize) -> Grid {
    let (n_u, n_v) = (n_u.max(2), n_v.max(2));
    let at = |k: usize, n: usize, length: f64| length * k as f64 / (n - 1) as f64;
    let nodes = (0..n_u * n_v)
        .map(|k| (at(k % n_u, n_u, surface.width()), at(k / n_u, n_v, surface.height())))
        .map(|(u, v)| Node {
            place: place(surface, location, u, v),
            curvature: surface.curvature(u, v),
            sigma_curvature: surface.sigma_curvature(u, v),
        })
        .collect();
    Grid { n_u, n_v, nodes }
}
