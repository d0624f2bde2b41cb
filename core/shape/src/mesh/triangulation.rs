//! Delaunay triangulation of about 10,000 vertices on the mid-surface (Masuda et al., 4.2).
//!
//! Vertices are selected and joined in the coordinates (a, b) of the [`SmoothFace`], which are nearly those of the
//! plate. There the boundary is exactly the rectangle, so that the convex hull is the plate and there are no slivers
//! along its edges.

use spade::{DelaunayTriangulation, Point2, Triangulation};

use super::{DiskMesh, DiskParts, MeshError, SmoothFace};
use crate::{Blank, Outline, PlateSpec, Vec3};

/// Largest distance, in parts of a cell's size, of the sample that becomes the cell's vertex from the cell's middle;
/// without such a sample the middle is the vertex. The limit keeps vertices apart, above all from the boundary.
const NEAR_MIDDLE: f64 = 0.3;
/// Gauss-Legendre places and weights on [0, 1], for arc lengths.
const GAUSS: [(f64, f64); 3] =
    [(0.112_701_665_379_258_3, 5.0 / 18.0), (0.5, 4.0 / 9.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];

impl SmoothFace {
    /// Meshes the mid-surface with about `n_vertices`, with its boundary mapped to the outline of `blank`. Also returns
    /// the vertices' coordinates (a, b).
    ///
    /// # Errors
    /// [`MeshError::NotADisk`] when the vertices could not be joined.
    pub fn mesh(
        &self,
        outline: &Outline,
        spec: &PlateSpec,
        blank: &Blank,
        n_vertices: usize,
    ) -> Result<(DiskMesh, Vec<[f64; 2]>), MeshError> {
        let cell = (spec.width * spec.height / n_vertices.max(16) as f64).sqrt();
        let n = [spec.width, spec.height].map(|length| ((length / cell).round() as usize).max(3));
        let (boundary, corners) = boundary(spec.width, spec.height, n);
        let mut places = boundary;
        let n_boundary = places.len();
        places.extend(self.interior(spec, n));
        let (arc, edge_length) = self.arcs(&places[..n_boundary], corners);
        let mesh = DiskMesh::new(DiskParts {
            vertices: places.iter().map(|[a, b]| self.mid.point(*a, *b).into()).collect(),
            triangles: delaunay(&places)?,
            boundary: (0..n_boundary as u32).collect(),
            corners: corners.map(|c| c as u32),
            corner_sigma: [0, 1, 2, 3].map(|k| {
                let (seen, cut) = (outline.corners[k].sigma, blank.corner_sigma[k]);
                [0, 1].map(|d| seen[d].hypot(cut[d]))
            }),
            edge_sigma: [0, 1, 2, 3].map(|k| outline.edges[k].sigma.hypot(blank.edge_sigma[k])),
            places: blank.places(corners, &arc, edge_length),
            arc,
            edge_length,
            width: spec.width,
            height: spec.height,
            thickness: spec.thickness,
        })?;
        Ok((mesh, places))
    }

    /// Selects the coordinates (a, b) of the vertices of [`SmoothFace::mesh`] inside the boundary: one per cell of a
    /// grid.
    fn interior(&self, spec: &PlateSpec, n: [usize; 2]) -> Vec<[f64; 2]> {
        let size = [spec.width / n[0] as f64, spec.height / n[1] as f64];
        let middle = |cell: [usize; 2]| [0, 1].map(|d| (cell[d] as f64 + 0.5) * size[d]);
        let mut chosen: Vec<(f64, [f64; 2])> =
            (0..n[0] * n[1]).map(|c| (NEAR_MIDDLE, middle([c % n[0], c / n[0]]))).collect();
        for place in &self.places {
            let cell = [0, 1].map(|d| ((place[d] / size[d]).max(0.0) as usize).min(n[d] - 1));
            let middle = middle(cell);
            let distance = (0..2).map(|d| ((place[d] - middle[d]) / size[d]).abs()).fold(0.0, f64::max);
            let best = &mut chosen[cell[1] * n[0] + cell[0]];
            if distance < best.0 {
                *best = (distance, *place);
            }
        }
        chosen.into_iter().map(|(_, place)| place).collect()
    }

    /// Integrates the arc length of the mid-surface's edges at the boundary vertices, and of whole edges.
    fn arcs(&self, boundary: &[[f64; 2]], corners: [usize; 4]) -> (Vec<f64>, [f64; 4]) {
        let mut arc = Vec::with_capacity(boundary.len());
        let mut edge_length = [0.0; 4];
        let mut edge = 0;
        let mut length = 0.0;
        for (i, from) in boundary.iter().enumerate() {
            if edge < 3 && i == corners[edge + 1] {
                edge += 1;
                length = 0.0;
            }
            arc.push(length);
            length += self.arc(*from, boundary[(i + 1) % boundary.len()]);
            edge_length[edge] = length;
        }
        (arc, edge_length)
    }

    /// Returns the length on the mid-surface of the straight segment in (a, b) between two places.
    fn arc(&self, from: [f64; 2], to: [f64; 2]) -> f64 {
        let d = [to[0] - from[0], to[1] - from[1]];
        GAUSS
            .iter()
            .map(|(s, weight)| {
                let [_, along_a, along_b] =
                    self.mid.frame(from[0] + s * d[0], from[1] + s * d[1]).map(Vec3::from);
                weight * (along_a * d[0] + along_b * d[1]).norm()
            })
            .sum()
    }
}

/// Returns the loop around `[0, width] x [0, height]` with `n` equal steps per side, and the positions of the corners
/// in it.
fn boundary(width: f64, height: f64, n: [usize; 2]) -> (Vec<[f64; 2]>, [usize; 4]) {
    let along = |k: usize, n: usize, length: f64| if k == n { length } else { length * k as f64 / n as f64 };
    let mut places = Vec::with_capacity(2 * (n[0] + n[1]));
    places.extend((0..n[0]).map(|k| [along(k, n[0], width), 0.0]));
    places.extend((0..n[1]).map(|k| [width, along(k, n[1], height)]));
    places.extend((0..n[0]).map(|k| [along(n[0] - k, n[0], width), height]));
    places.extend((0..n[1]).map(|k| [0.0, along(n[1] - k, n[1], height)]));
    (places, [0, n[0], n[0] + n[1], 2 * n[0] + n[1]])
}

/// Returns the Delaunay triangles of the places, counter-clockwise.
fn delaunay(places: &[[f64; 2]]) -> Result<Vec<[u32; 3]>, MeshError> {
    let fault = |what: String| MeshError::NotADisk { what };
    let points = places.iter().map(|[a, b]| Point2::new(*a, *b)).collect();
    let mesh =
        DelaunayTriangulation::<Point2<f64>>::bulk_load_stable(points).map_err(|e| fault(e.to_string()))?;
    if mesh.num_vertices() != places.len() {
        return Err(fault(format!(
            "{} of {} vertices coincide",
            places.len() - mesh.num_vertices(),
            places.len()
        )));
    }
    Ok(mesh.inner_faces().map(|f| f.vertices().map(|v| v.index() as u32)).collect())
}
