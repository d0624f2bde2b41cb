//! Disk mesh: a checked triangulated disk with four corners, input of every flattening.

use std::ops::Deref;

use super::error::{MeshError, malformed, not_a_disk};
use super::topology::check_topology;
use crate::Vec3;

/// Data of a [`DiskMesh`], unchecked.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DiskParts {
    /// Points of the mid-surface, metres, scanner frame.
    pub vertices: Vec<Vec3>,
    /// Vertex indices, counter-clockwise seen from the scanner.
    pub triangles: Vec<[u32; 3]>,
    /// The boundary loop: vertex indices from corner (0,0), counter-clockwise seen from the scanner.
    pub boundary: Vec<u32>,
    /// Positions of the corners (0,0), (W,0), (W,H), (0,H) in `boundary`; the first is 0.
    pub corners: [u32; 4],
    /// Per corner: standard deviation of its place along the edge that leaves it and along the one that arrives,
    /// metres.
    pub corner_sigma: [[f64; 2]; 4],
    /// Per edge: standard deviation across the edge, in the surface, metres.
    pub edge_sigma: [f64; 4],
    /// Per boundary vertex: arc length from the first corner of its edge, metres; 0 in the corners.
    pub arc: Vec<f64>,
    /// Per boundary vertex: (u, v) of the material there, metres. Across its edge it is known to `edge_sigma`; along
    /// the edge, between the corners, only as well as material keeps its share of the edge's length.
    pub places: Vec<[f64; 2]>,
    /// Arc length of the edges v = 0, u = W, v = H, u = 0, metres.
    pub edge_length: [f64; 4],
    /// Extent of the original rectangle along u, metres.
    pub width: f64,
    /// Extent of the original rectangle along v, metres.
    pub height: f64,
    /// Thickness of the plate, metres.
    pub thickness: f64,
}

/// A mesh that is one disk: connected, manifold, evenly oriented, with a single simple boundary loop.
///
/// Gives read-only access to the [`DiskParts`] of which it was built.
#[derive(Debug, Clone, PartialEq)]
pub struct DiskMesh(DiskParts);

impl DiskMesh {
    /// Checks the parts.
    ///
    /// # Errors
    /// [`MeshError::Malformed`] for indices, lengths or numbers out of range, [`MeshError::NotADisk`] for wrong
    /// topology.
    pub fn new(parts: DiskParts) -> Result<Self, MeshError> {
        check_numbers(&parts)?;
        check_loop(&parts)?;
        check_topology(&parts.triangles, &parts.boundary, parts.vertices.len())?;
        Ok(Self(parts))
    }

    /// Returns the positions in `boundary` of edge `k`'s vertices from corner k to corner k + 1, both included.
    ///
    /// The last edge ends in position 0, given as `boundary.len()`: take it modulo the length.
    #[must_use]
    pub fn edge(&self, k: usize) -> std::ops::RangeInclusive<usize> {
        let end = if k == 3 { self.boundary.len() } else { self.corners[k + 1] as usize };
        self.corners[k] as usize..=end
    }
}

impl Deref for DiskMesh {
    type Target = DiskParts;

    fn deref(&self) -> &DiskParts {
        &self.0
    }
}

fn check_numbers(parts: &DiskParts) -> Result<(), MeshError> {
    if let Some(i) = parts.vertices.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
        return Err(malformed(format!("vertex {i} is not finite")));
    }
    for (name, value) in [("width", parts.width), ("height", parts.height), ("thickness", parts.thickness)] {
        if !(value.is_finite() && value > 0.0) {
            return Err(malformed(format!("{name} is {value}, needs to be positive")));
        }
    }
    let sigmas = parts.corner_sigma.iter().flatten().chain(&parts.edge_sigma);
    if let Some(sigma) = sigmas.into_iter().find(|s| !(s.is_finite() && **s >= 0.0)) {
        return Err(malformed(format!("standard deviation {sigma}, needs to be finite and not negative")));
    }
    Ok(())
}

fn check_loop(parts: &DiskParts) -> Result<(), MeshError> {
    let n = parts.boundary.len();
    for (what, found) in [("arc lengths", parts.arc.len()), ("places", parts.places.len())] {
        if found != n {
            return Err(malformed(format!("{found} {what} for {n} boundary vertices")));
        }
    }
    if let Some(i) = parts.places.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
        return Err(malformed(format!("boundary vertex {i} has no finite place")));
    }
    let c = parts.corners.map(|c| c as usize);
    if c[0] != 0 || c[1] <= c[0] || c[2] <= c[1] || c[3] <= c[2] || c[3] >= n {
        return Err(malformed(format!("corners {c:?} in a loop of {n}: need 0 first, then growing")));
    }
    let mut seen = vec![false; parts.vertices.len()];
    for &v in &parts.boundary {
        match seen.get_mut(v as usize) {
            None => return Err(malformed(format!("boundary vertex {v} of {}", seen.len()))),
            Some(true) => return Err(not_a_disk(format!("the boundary passes vertex {v} twice"))),
            Some(slot) => *slot = true,
        }
    }
    for k in 0..4 {
        let places: Vec<_> =
            (c[k]..=if k == 3 { n } else { c[k + 1] }).map(|at| parts.places[at % n]).collect();
        let chord = between(places[0], places[places.len() - 1]);
        let forward = |step: [f64; 2]| step[0] * chord[0] + step[1] * chord[1] > 0.0;
        if !places.windows(2).all(|w| forward(between(w[0], w[1]))) {
            return Err(malformed(format!("the places of edge {k} do not run from corner to corner")));
        }
        let arc = &parts.arc[c[k]..if k == 3 { n } else { c[k + 1] }];
        let grows = arc.windows(2).all(|w| w[1] > w[0]) && parts.edge_length[k] > arc[arc.len() - 1];
        if arc[0] != 0.0 || !grows || !parts.edge_length[k].is_finite() {
            return Err(malformed(format!(
                "arc length of edge {k} does not grow from 0 to the edge's length"
            )));
        }
    }
    Ok(())
}

fn between(from: [f64; 2], to: [f64; 2]) -> [f64; 2] {
    [to[0] - from[0], to[1] - from[1]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Blank;

    /// Returns a unit square of four triangles around its centre.
    fn square() -> DiskParts {
        DiskParts {
            vertices: [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.5]]
                .map(|[x, y]| Vec3::new(x, y, 0.0))
                .to_vec(),
            triangles: vec![[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]],
            boundary: vec![0, 1, 2, 3],
            corners: [0, 1, 2, 3],
            arc: vec![0.0; 4],
            places: Blank::rectangle(1.0, 1.0).corners.to_vec(),
            edge_length: [1.0; 4],
            width: 1.0,
            height: 1.0,
            thickness: 0.04,
            ..DiskParts::default()
        }
    }

    fn refused(change: impl FnOnce(&mut DiskParts)) -> String {
        let mut parts = square();
        change(&mut parts);
        DiskMesh::new(parts).expect_err("must be refused").to_string()
    }

    #[test]
    fn a_square_is_a_disk_with_four_edges() {
        let mesh = DiskMesh::new(square()).expect("a disk");
        let edges: Vec<_> = (0..4).map(|k| mesh.edge(k).collect::<Vec<_>>()).collect();
        assert_eq!(edges, [[0, 1], [1, 2], [2, 3], [3, 4]]);
    }

    #[test]
    fn wrong_topology_is_refused() {
        assert!(refused(|p| p.triangles.truncate(3)).contains("open edges"));
        assert!(refused(|p| p.triangles[0] = [1, 0, 4]).contains("used twice"));
        assert!(refused(|p| p.vertices.push(Vec3::zeros())).contains("vertex 5 belongs to no triangle"));
        assert!(refused(|p| p.boundary = vec![0, 3, 2, 1]).contains("open edges"));
        assert!(refused(|p| p.boundary = vec![0, 1, 2, 1]).contains("passes vertex 1 twice"));
        let shell = |p: &mut DiskParts| {
            p.vertices.extend([Vec3::x(), Vec3::y(), Vec3::z(), Vec3::zeros()]);
            p.triangles.extend([[5, 6, 7], [5, 8, 6], [6, 8, 7], [7, 8, 5]]);
        };
        assert!(refused(shell).contains("9 vertices"));
        // A torus of seven vertices does not change V - E + F; it is only not connected with the square.
        let torus = |p: &mut DiskParts| {
            p.vertices.extend([Vec3::zeros(); 7]);
            let at = |k: u32| 5 + k % 7;
            let pair = |i| [[at(i), at(i + 1), at(i + 3)], [at(i), at(i + 3), at(i + 2)]];
            p.triangles.extend((0..7).flat_map(pair));
        };
        assert!(refused(torus).contains("12 vertices, 29 edges, 18 faces"));
    }

    #[test]
    fn wrong_numbers_are_refused() {
        assert!(refused(|p| p.vertices[3].y = f64::NAN).contains("vertex 3 is not finite"));
        assert!(refused(|p| p.corners = [0, 2, 1, 3]).contains("corners"));
        assert!(refused(|p| p.triangles[2][0] = 77).contains("names vertex 77"));
        assert!(refused(|p| p.places[1][0] = f64::NAN).contains("boundary vertex 1 has no finite place"));
        assert!(refused(|p| p.places[1] = p.places[0]).contains("the places of edge 0"));
        assert!(refused(|p| p.places.truncate(3)).contains("3 places for 4"));
        assert!(refused(|p| p.edge_length[1] = 0.0).contains("edge 1"));
        assert!(refused(|p| p.thickness = 0.0).contains("thickness"));
        assert!(refused(|p| p.edge_sigma[0] = -1.0).contains("standard deviation"));
    }
}
