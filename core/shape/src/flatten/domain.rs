//! Domain of the flattenings: test of a mesh against its rectangle, and index helpers.

use crate::mesh::DiskMesh;

/// Least height of a triangle in parts of its longest side: below, the angles are meaningless. At 40 mm sides it is 40
/// nm.
const MIN_HEIGHT: f64 = 1e-6;

/// Largest relative difference between an edge and its side of the rectangle. The edges of a bent plate keep their
/// length to parts of a percent; a larger misfit means wrong corners or a wrong size.
const MAX_LENGTH_MISFIT: f64 = 0.1;

/// Reason why a disk cannot be flattened onto its rectangle.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of a variant names its fields")]
pub enum UnfitMesh {
    /// A triangle has no area in space.
    #[error("triangle {triangle} is degenerate: {height:.1e} m high on a side of {side:.1e} m")]
    Degenerate {
        triangle: usize,
        /// Its height over its longest side, metres.
        height: f64,
        /// Its longest side, metres.
        side: f64,
    },
    /// A triangle has all corners on one edge of the plate: on the rectangle it has no area.
    #[error("triangle {triangle} has all its corners on edge {edge} of the plate")]
    Ear { triangle: usize, edge: usize },
    /// An edge is far from its side of the rectangle.
    #[error("edge {edge} is {measured:.3} m long, its side of the rectangle {side:.3} m")]
    EdgeLength {
        edge: usize,
        /// Its arc length, metres.
        measured: f64,
        /// Side of the rectangle, metres.
        side: f64,
    },
}

impl UnfitMesh {
    /// Returns advice to the operator.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::EdgeLength { .. } => {
                "check width_mm and height_mm of the plate, and u_axis: the corners may be mistaken"
            }
            Self::Degenerate { .. } | Self::Ear { .. } => "scan again; if it stays, report this scan",
        }
    }
}

/// Checks the requirements of a flattening beyond those of a disk: triangles with area, in space and on the rectangle,
/// and edges about as long as the rectangle's sides.
///
/// # Errors
/// [`UnfitMesh`], with the first fault found.
pub fn check_fit(mesh: &DiskMesh) -> Result<(), UnfitMesh> {
    let sides = [mesh.width, mesh.height, mesh.width, mesh.height];
    for (edge, (&measured, side)) in mesh.edge_length.iter().zip(sides).enumerate() {
        if (measured - side).abs() > MAX_LENGTH_MISFIT * side {
            return Err(UnfitMesh::EdgeLength { edge, measured, side });
        }
    }
    let edges = edges_of_vertices(mesh);
    for (triangle, corners) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = corners.map(|v| mesh.vertices[v as usize]);
        let longest = (b - a).norm_squared().max((c - b).norm_squared()).max((a - c).norm_squared());
        let double_area = (b - a).cross(&(c - a)).norm();
        if double_area.is_nan() || double_area <= MIN_HEIGHT * longest {
            let side = longest.sqrt();
            return Err(UnfitMesh::Degenerate { triangle, height: double_area / side, side });
        }
        let common = corners.iter().fold(u8::MAX, |common, &v| common & edges[v as usize]);
        if common != 0 {
            return Err(UnfitMesh::Ear { triangle, edge: common.trailing_zeros() as usize });
        }
    }
    Ok(())
}

/// Returns, per vertex, the edges on which it lies: bit k is set for edge k. A corner lies on two edges, an interior
/// vertex on none.
pub fn edges_of_vertices(mesh: &DiskMesh) -> Vec<u8> {
    let mut edges = vec![0; mesh.vertices.len()];
    for edge in 0..4 {
        for at in mesh.edge(edge) {
            edges[mesh.boundary[at % mesh.boundary.len()] as usize] |= 1 << edge;
        }
    }
    edges
}

/// Projects the vertices onto the plate's mean u and v directions: approximate plane coordinates to order eliminations
/// by.
pub fn plane_picture(mesh: &DiskMesh) -> Vec<[f64; 2]> {
    let corner = mesh.corners.map(|at| mesh.vertices[mesh.boundary[at as usize] as usize]);
    let u = corner[1] - corner[0] + corner[2] - corner[3];
    let v = corner[3] - corner[0] + corner[2] - corner[1];
    let (u, v) = (u.try_normalize(0.0).unwrap_or(u), v.try_normalize(0.0).unwrap_or(v));
    mesh.vertices.iter().map(|p| [p.dot(&u), p.dot(&v)]).collect()
}

/// Numbers the interior vertices. Returns the number of each vertex among them, and the interior vertices.
pub fn interior(mesh: &DiskMesh) -> (Vec<Option<u32>>, Vec<u32>) {
    let edges = edges_of_vertices(mesh);
    let inner: Vec<u32> = (0..edges.len() as u32).filter(|&v| edges[v as usize] == 0).collect();
    let mut node_of = vec![None; edges.len()];
    for (node, &v) in (0..).zip(&inner) {
        node_of[v as usize] = Some(node);
    }
    (node_of, inner)
}

/// Returns the first triangle that is turned over or has no area in the chart `uv`.
pub fn first_turned(triangles: &[[u32; 3]], uv: &[[f64; 2]]) -> Option<usize> {
    let upright = |t: &[u32; 3]| signed_area(t.map(|v| uv[v as usize])) > 0.0;
    triangles.iter().position(|t| !upright(t))
}

/// Returns the area of a plane triangle, positive counter-clockwise.
#[inline]
pub fn signed_area([a, b, c]: [[f64; 2]; 3]) -> f64 {
    0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
}
