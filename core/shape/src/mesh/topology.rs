//! Topology test of a disk by the indices of its triangles: Euler characteristic, connectedness, boundary loop.

use platen_numerics::union_find::UnionFind;

use super::error::{MeshError, malformed, not_a_disk};

/// Checks that the triangles form one disk:
///
/// - every directed edge occurs once;
/// - the edges without an opposite are the boundary loop;
/// - the triangles are connected through edges;
/// - V - E + F = 1.
///
/// Together these conditions exclude pinched vertices and handles.
pub(super) fn check_topology(
    triangles: &[[u32; 3]],
    boundary: &[u32],
    n_vertices: usize,
) -> Result<(), MeshError> {
    let fans = Fans::of(triangles, n_vertices)?;
    let (mut parts, mut n_parts) = (UnionFind::of(triangles.len()), triangles.len());
    let mut n_open = 0;
    for vertex in 0..n_vertices as u32 {
        let fan = fans.at(vertex);
        if fan.is_empty() {
            return Err(not_a_disk(format!("vertex {vertex} belongs to no triangle")));
        }
        for (k, side) in fan.iter().enumerate() {
            if side.next == vertex || fan[..k].iter().any(|s| s.next == side.next) {
                return Err(not_a_disk(format!(
                    "edge {vertex}-{} is used twice in one direction",
                    side.next
                )));
            }
            match fan.iter().find(|other| other.last == side.next) {
                Some(other) => n_parts -= usize::from(parts.union(side.triangle, other.triangle).is_some()),
                None => n_open += 1,
            }
        }
    }
    let followers = boundary.iter().skip(1).chain(boundary.first());
    let n_matched = boundary.iter().zip(followers).filter(|(a, b)| fans.is_open(**a, **b)).count();
    if n_open != boundary.len() || n_matched != n_open {
        let n_loop = boundary.len();
        return Err(not_a_disk(format!("{n_open} open edges, {n_matched} of them on the loop of {n_loop}")));
    }
    let n_faces = triangles.len();
    let n_edges = (3 * n_faces + n_open) / 2;
    if n_vertices + n_faces != n_edges + 1 || n_parts != 1 {
        return Err(not_a_disk(format!("{n_vertices} vertices, {n_edges} edges, {n_faces} faces")));
    }
    Ok(())
}

/// A triangle as seen from one of its vertices: counter-clockwise the vertex, `next`, `last`.
#[derive(Clone, Copy, Default)]
struct Side {
    next: u32,
    last: u32,
    triangle: u32,
}

/// The triangles at each vertex.
struct Fans {
    starts: Vec<u32>,
    sides: Vec<Side>,
}

impl Fans {
    fn of(triangles: &[[u32; 3]], n_vertices: usize) -> Result<Self, MeshError> {
        let mut starts = vec![0u32; n_vertices + 1];
        for (t, v) in triangles.iter().enumerate().flat_map(|(t, tri)| tri.map(|v| (t, v))) {
            *starts[1..]
                .get_mut(v as usize)
                .ok_or_else(|| malformed(format!("triangle {t} names vertex {v}")))? += 1;
        }
        (0..n_vertices).for_each(|v| starts[v + 1] += starts[v]);
        let mut free = starts.clone();
        let mut sides = vec![Side::default(); triangles.len() * 3];
        for (triangle, &[a, b, c]) in (0u32..).zip(triangles) {
            for (v, next, last) in [(a, b, c), (b, c, a), (c, a, b)] {
                sides[free[v as usize] as usize] = Side { next, last, triangle };
                free[v as usize] += 1;
            }
        }
        Ok(Self { starts, sides })
    }

    fn at(&self, vertex: u32) -> &[Side] {
        &self.sides[self.starts[vertex as usize] as usize..self.starts[vertex as usize + 1] as usize]
    }

    /// Returns whether a triangle lies to the left of the edge from `a` to `b` and none to its right.
    fn is_open(&self, a: u32, b: u32) -> bool {
        let fan = self.at(a);
        fan.iter().any(|side| side.next == b) && fan.iter().all(|side| side.last != b)
    }
}
