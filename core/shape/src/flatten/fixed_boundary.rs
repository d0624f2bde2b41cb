//! Maps with a fixed boundary: minimum of sum k_ij |p_i - p_j|^2 over the interior vertices (Masuda et al., 4.3, eq.
//! 4).
//!
//! In: a mesh, its boundary places (u, v) and one weight per triangle corner. Out: (u, v) of all vertices, metres.

use platen_numerics::sparse::{Graph, SparseError, Spd};

use super::domain::{interior, plane_picture};
use crate::mesh::DiskMesh;

/// Returns the cotangents of the three angles of every triangle of the mesh, at its corners in their order.
pub fn cotangents(mesh: &DiskMesh) -> Vec<[f64; 3]> {
    let of_triangle = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| mesh.vertices[v as usize]);
        let double_area = (b - a).cross(&(c - a)).norm();
        [(b - a).dot(&(c - a)), (c - b).dot(&(a - b)), (a - c).dot(&(b - c))].map(|dot| dot / double_area)
    };
    mesh.triangles.iter().map(of_triangle).collect()
}

/// Computes the map that minimises sum k_ij |p_i - p_j|^2 over the interior vertices, with the boundary held at its
/// places, metres.
///
/// `weights` contains three numbers per triangle, one per corner. k_ij is the sum, over the one or two triangles at the
/// edge ij, of the number at the corner opposite to it. Cotangents give the harmonic map (Masuda et al., eq. 4), ones
/// Tutte's map. Cost: one sparse Cholesky factorisation, two right-hand sides.
///
/// # Errors
/// [`SparseError::NotPositiveDefinite`] when the weights do not hold the interior.
pub fn fixed_boundary(mesh: &DiskMesh, weights: &[[f64; 3]]) -> Result<Vec<[f64; 2]>, SparseError> {
    let (node_of, inner) = interior(mesh);
    let picture = plane_picture(mesh);
    let points: Vec<_> = inner.iter().map(|&v| picture[v as usize]).collect();
    let mut uv = vec![[0.0; 2]; mesh.vertices.len()];
    for (&v, &place) in mesh.boundary.iter().zip(&mesh.places) {
        uv[v as usize] = place;
    }
    let mut spd = Spd::<1>::analyse(&Graph::of_elements(&mesh.triangles, &node_of, inner.len()), &points)?;
    let mut rhs = [vec![[0.0]; inner.len()], vec![[0.0]; inner.len()]];
    let mut diagonal = vec![0.0; inner.len()];
    for (t, k) in mesh.triangles.iter().zip(weights) {
        for corner in 0..3 {
            let ends = [t[(corner + 1) % 3], t[(corner + 2) % 3]];
            let nodes = ends.map(|v| node_of[v as usize]);
            for (node, other) in [(nodes[0], ends[1]), (nodes[1], ends[0])] {
                let Some(node) = node else { continue };
                diagonal[node as usize] += k[corner];
                if node_of[other as usize].is_none() {
                    (0..2).for_each(|c| rhs[c][node as usize][0] += k[corner] * uv[other as usize][c]);
                }
            }
            if let [Some(i), Some(j)] = nodes {
                spd.add(i, j, [[-k[corner]]]);
            }
        }
    }
    diagonal.iter().enumerate().for_each(|(i, &k)| spd.add(i as u32, i as u32, [[k]]));
    spd.factor()?;
    spd.solve(&mut rhs)?;
    for (&v, (u, v_coordinate)) in inner.iter().zip(rhs[0].iter().zip(&rhs[1])) {
        uv[v as usize] = [u[0], v_coordinate[0]];
    }
    Ok(uv)
}
