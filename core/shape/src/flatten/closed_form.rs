//! Meshes of closed-form plates with known material coordinates, for tests and benchmarks only.

use crate::mesh::{DiskMesh, DiskParts, MeshError};
use crate::{Blank, Vec3};
use platen_numerics::random::Random;
use spade::{DelaunayTriangulation, Point2, Triangulation};

/// A plate's mesh with the known material coordinates of its vertices.
#[derive(Debug, Clone)]
pub struct ClosedForm {
    /// Material coordinates per vertex, metres.
    pub uv: Vec<[f64; 2]>,
    /// The mesh, to be modified or checked.
    pub parts: DiskParts,
}

impl ClosedForm {
    /// Builds the plate `size` bent by `surface` (material coordinates to space), with `cells` cells along u and v.
    /// Interior vertices are moved by up to `jitter` of a cell, at random by `seed`, and joined by Delaunay's
    /// criterion.
    pub fn new(
        surface: impl Fn([f64; 2]) -> [f64; 3],
        size: [f64; 2],
        cells: [u32; 2],
        jitter: f64,
        seed: u64,
    ) -> Self {
        let [nu, nv] = cells;
        let corners = [0, nu, nu + nv, 2 * nu + nv];
        let uv = material_points(size, cells, jitter, seed);
        let point = |p: [f64; 2]| Vec3::from(surface(p));
        let mut arc = Vec::new();
        let mut edge_length = [0.0; 4];
        for edge in 0..4 {
            let end = corners.get(edge + 1).map_or(2 * (nu + nv), |&at| at);
            for at in corners[edge]..end {
                let next = if at + 1 == 2 * (nu + nv) { 0 } else { at + 1 };
                arc.push(edge_length[edge]);
                edge_length[edge] += arc_length(&point, uv[at as usize], uv[next as usize]);
            }
        }
        let at = corners.map(|at| at as usize);
        let parts = DiskParts {
            places: Blank::rectangle(size[0], size[1]).places(at, &arc, edge_length),
            vertices: uv.iter().map(|&p| point(p)).collect(),
            triangles: delaunay(&uv),
            boundary: (0..2 * (nu + nv)).collect(),
            corners,
            arc,
            edge_length,
            corner_sigma: [[2e-4; 2]; 4],
            edge_sigma: [1e-4; 4],
            width: size[0],
            height: size[1],
            thickness: 0.036,
        };
        Self { uv, parts }
    }

    /// Adds noise of standard deviation `sigma` along z to the interior vertices, at random by `seed`.
    #[must_use]
    pub fn with_noise(mut self, sigma: f64, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let first = self.parts.boundary.len();
        self.parts.vertices[first..].iter_mut().for_each(|p| p.z += sigma * random.normal());
        self
    }

    /// Returns the checked mesh.
    ///
    /// # Errors
    /// [`MeshError`].
    pub fn mesh(&self) -> Result<DiskMesh, MeshError> {
        DiskMesh::new(self.parts.clone())
    }

    /// Returns the mean and largest distance of a chart from the known material coordinates, metres.
    pub fn errors(&self, uv: &[[f64; 2]]) -> [f64; 2] {
        let errors = || self.uv.iter().zip(uv).map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]));
        [errors().sum::<f64>() / self.uv.len() as f64, errors().fold(0.0, f64::max)]
    }
}

/// Returns a plate rolled to a cylinder whose straight lines make the angle `axis` (radians) with u.
pub fn cylinder(radius: f64, axis: f64) -> impl Fn([f64; 2]) -> [f64; 3] {
    let (sin, cos) = axis.sin_cos();
    move |[u, v]| {
        let (along, across) = (u * cos + v * sin, (v * cos - u * sin) / radius);
        [along, radius * across.sin(), radius * (1.0 - across.cos())]
    }
}

/// Returns a plate rolled to a cone with its apex at the material point `apex`; its surface makes the angle
/// `half_angle` with its axis.
pub fn cone(apex: [f64; 2], half_angle: f64) -> impl Fn([f64; 2]) -> [f64; 3] {
    let (sin, cos) = half_angle.sin_cos();
    move |[u, v]| {
        let (x, y) = (u - apex[0], v - apex[1]);
        let (slant, turn) = (x.hypot(y), y.atan2(x) / sin);
        [slant * sin * turn.cos(), slant * sin * turn.sin(), slant * cos]
    }
}

/// Returns a plate that is flat up to u = `from` and rolled to a cylinder beyond.
pub fn half_bent(radius: f64, from: f64) -> impl Fn([f64; 2]) -> [f64; 3] {
    move |[u, v]| {
        let bent = (u - from).max(0.0) / radius;
        [u.min(from) + radius * bent.sin(), v, radius * (1.0 - bent.cos())]
    }
}

/// Returns a plate pressed to a sphere such that the fibres along u keep their length and lie on great circles across
/// the middle line.
pub fn sphere_of_fibres(radius: f64, size: [f64; 2]) -> impl Fn([f64; 2]) -> [f64; 3] {
    move |[u, v]| {
        let (a, b) = ((u - size[0] / 2.0) / radius, (v - size[1] / 2.0) / radius);
        [radius * a.sin(), radius * a.cos() * b.sin(), radius * (1.0 - a.cos() * b.cos())]
    }
}

/// Returns the material points: the boundary loop from (0,0), then the interior row by row.
fn material_points(size: [f64; 2], [nu, nv]: [u32; 2], jitter: f64, seed: u64) -> Vec<[f64; 2]> {
    let mut random = Random::new(seed);
    let at = |i: f64, j: f64| [size[0] * i / f64::from(nu), size[1] * j / f64::from(nv)];
    let on = |i: u32, j: u32| at(f64::from(i), f64::from(j));
    let mut uv = Vec::new();
    uv.extend((0..nu).map(|i| on(i, 0)));
    uv.extend((0..nv).map(|j| on(nu, j)));
    uv.extend((1..=nu).rev().map(|i| on(i, nv)));
    uv.extend((1..=nv).rev().map(|j| on(0, j)));
    for j in 1..nv {
        for i in 1..nu {
            let mut moved = |x: u32| f64::from(x) + jitter * (2.0 * random.unit() - 1.0);
            uv.push(at(moved(i), moved(j)));
        }
    }
    uv
}

/// Returns the length of the image of the straight segment from `a` to `b`, by 64 chords: one part in 10^8 short at 100
/// mm on R 5 m.
fn arc_length(point: &impl Fn([f64; 2]) -> Vec3, a: [f64; 2], b: [f64; 2]) -> f64 {
    const PIECES: u32 = 64;
    let on = |k: u32| {
        let s = f64::from(k) / f64::from(PIECES);
        point([a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1])])
    };
    (0..PIECES).map(|k| (on(k + 1) - on(k)).norm()).sum()
}

fn delaunay(uv: &[[f64; 2]]) -> Vec<[u32; 3]> {
    let mut triangulation = DelaunayTriangulation::<Point2<f64>>::new();
    for p in uv {
        // Only coordinates that are not finite are refused; none are generated above.
        if triangulation.insert(Point2::new(p[0], p[1])).is_err() {
            return Vec::new();
        }
    }
    triangulation.inner_faces().map(|face| face.vertices().map(|v| v.fix().index() as u32)).collect()
}
