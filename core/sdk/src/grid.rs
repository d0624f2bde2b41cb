//! Grid of the fields that comparisons return.

use platen_shape::Surface;

use platen_model::{Field, NodeState};

/// Uniform grid over the whole plate, v outer, u inner; every fifth node is a node of the result's grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlateGrid {
    width: f64,
    height: f64,
}

impl PlateGrid {
    /// Nodes along each side.
    pub const SIDE: usize = 101;
    /// Number of nodes.
    pub const NODES: usize = Self::SIDE * Self::SIDE;

    /// Makes the grid over the rectangle of a surface.
    #[must_use]
    pub fn new(surface: &Surface) -> Self {
        Self { width: surface.width(), height: surface.height() }
    }

    /// Returns the place of a node on the plate, (u, v) in metres.
    #[must_use]
    pub fn at(&self, node: usize) -> [f64; 2] {
        let along = |k: usize, length: f64| length * k as f64 / (Self::SIDE - 1) as f64;
        [along(node % Self::SIDE, self.width), along(node / Self::SIDE, self.height)]
    }

    /// Returns `f(u, v)` at every node.
    pub fn map<T>(&self, mut f: impl FnMut(f64, f64) -> T) -> Vec<T> {
        (0..Self::NODES).map(|node| self.at(node)).map(|[u, v]| f(u, v)).collect()
    }

    /// Returns the area of a cell, square metres.
    #[must_use]
    pub fn cell(&self) -> f64 {
        self.width * self.height / ((Self::SIDE - 1) * (Self::SIDE - 1)) as f64
    }

    /// Makes a field with one number per node.
    #[must_use]
    pub fn scalar(&self, name: &str, unit: &str, values: Vec<f64>, state: Vec<NodeState>) -> Field {
        self.field(name, unit, 1, values, state)
    }

    /// Makes a field with several numbers per node, components innermost.
    #[must_use]
    pub fn field(
        &self,
        name: &str,
        unit: &str,
        components: usize,
        values: Vec<f64>,
        state: Vec<NodeState>,
    ) -> Field {
        let (name, unit) = (name.into(), unit.into());
        Field { name, unit, nodes: [Self::SIDE; 2], components, values, state }
    }

    /// Returns the connected components of equal label (4-neighbourhood). Nodes with label 0 belong to none.
    #[must_use]
    pub fn connected_components(label: &[i8]) -> Vec<Vec<usize>> {
        let mut visited = vec![false; label.len()];
        let mut patches = Vec::new();
        for first in (0..label.len()).filter(|&node| label[node] != 0) {
            if visited[first] {
                continue;
            }
            visited[first] = true;
            let mut patch = vec![first];
            let mut next = 0;
            while let Some(&node) = patch.get(next) {
                next += 1;
                for neighbour in neighbours(node) {
                    if !visited[neighbour] && label[neighbour] == label[first] {
                        visited[neighbour] = true;
                        patch.push(neighbour);
                    }
                }
            }
            patches.push(patch);
        }
        patches
    }
}

fn neighbours(node: usize) -> impl Iterator<Item = usize> {
    const SIDE: usize = PlateGrid::SIDE;
    let (u, v) = (node % SIDE, node / SIDE);
    let candidates = [
        (u > 0, node.wrapping_sub(1)),
        (u + 1 < SIDE, node + 1),
        (v > 0, node.wrapping_sub(SIDE)),
        (v + 1 < SIDE, node + SIDE),
    ];
    candidates.into_iter().filter_map(|(inside, node)| inside.then_some(node))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_are_connected_by_sides_and_do_not_wrap_round() {
        let mut label = vec![0_i8; PlateGrid::NODES];
        // The last node of a row and the first of the next row are not neighbours; diagonal nodes are not neighbours
        // either.
        for node in [100, 101, 5 * 101 + 5, 6 * 101 + 6] {
            label[node] = 1;
        }
        // Two adjacent areas of different sign are two patches.
        (label[2000], label[2001], label[2002]) = (1, 1, -1);
        let patches = PlateGrid::connected_components(&label);
        assert_eq!(patches, [vec![100], vec![101], vec![510], vec![612], vec![2000, 2001], vec![2002]]);
    }
}
