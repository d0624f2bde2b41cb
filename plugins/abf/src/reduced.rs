//! The system that remains of a Newton step when the angles and the triangles' multipliers are eliminated.
//!
//! With L the diagonal of the weights and J the slopes of the constraints, triangles first, the step (dx, dm) solves
//!
//! ```text
//! L dx + J' dm = -r        r = L (x - b) + J' m
//! J dx         = -c
//! ```
//!
//! J L^-1 J' dm = c - J L^-1 r is split by triangles (1, a diagonal) and vertices (2); its Schur complement in 2 is the sum
//! over the triangles of Q P Q', Q the slopes of its corners' constraints, P = L^-1 - L^-1 1 1' L^-1 / (1' L^-1 1).

use platen_shape::sparse::{Graph, SparseError, Spd};

use crate::angles::{Corners, Failing, Slopes};

/// The reduced system and what the elimination needs of each triangle.
pub(crate) struct Reduced<'a> {
    nodes: &'a [[Option<u32>; 3]],
    /// L^-1.
    softness: Vec<Corners>,
    /// The slopes at which the system was last factored.
    slopes: Vec<Slopes>,
    spd: Spd<2>,
}

/// The multipliers of the constraints.
#[derive(Clone)]
pub(crate) struct Multipliers {
    pub(crate) triangles: Vec<f64>,
    pub(crate) vertices: Vec<[f64; 2]>,
}

impl Multipliers {
    fn at(&self, nodes: &[Option<u32>; 3]) -> [[f64; 2]; 3] {
        nodes.map(|node| node.map_or([0.0; 2], |node| self.vertices[node as usize]))
    }

    pub(crate) fn zeros(n_triangles: usize, n_inner: usize) -> Self {
        Self { triangles: vec![0.0; n_triangles], vertices: vec![[0.0; 2]; n_inner] }
    }
}

impl<'a> Reduced<'a> {
    pub(crate) fn new(
        nodes: &'a [[Option<u32>; 3]],
        targets: &[Corners],
        graph: &Graph,
        points: &[[f64; 2]],
    ) -> Result<Self, SparseError> {
        let softness = targets.iter().map(|b| b.map(|b| b * b)).collect();
        Ok(Self { nodes, softness, slopes: Vec::new(), spd: Spd::analyse(graph, points)? })
    }

    /// Factors the system at the angles `x`.
    pub(crate) fn factor(&mut self, x: &[Corners]) -> Result<(), SparseError> {
        self.slopes = x.iter().map(Slopes::at).collect();
        self.spd.clear();
        for ((nodes, slopes), softness) in self.nodes.iter().zip(&self.slopes).zip(&self.softness) {
            let total: f64 = softness.iter().sum();
            for (a, b) in [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)] {
                if let (Some(i), Some(j)) = (nodes[a], nodes[b]) {
                    self.spd.add(i, j, block(slopes.rows(a), slopes.rows(b), softness, total));
                }
            }
        }
        self.spd.factor()
    }

    /// The step of angles and multipliers from `x`, `m`, with the factor as it is; it is added to `m`.
    pub(crate) fn step(
        &self,
        x: &[Corners],
        targets: &[Corners],
        failing: &Failing,
        m: &mut Multipliers,
    ) -> Result<Vec<Corners>, SparseError> {
        // L^-1 r, with the slopes of here and now.
        let mut y: Vec<Corners> = Vec::with_capacity(x.len());
        let mut rhs = failing.vertices.clone();
        for (t, (x, nodes)) in x.iter().zip(self.nodes).enumerate() {
            let softness = &self.softness[t];
            let pull = Slopes::at(x).transposed_times(&m.at(nodes));
            let here: Corners =
                std::array::from_fn(|k| x[k] - targets[t][k] + softness[k] * (pull[k] + m.triangles[t]));
            let total: f64 = softness.iter().sum();
            let b = (failing.triangles[t] - here.iter().sum::<f64>()) / total;
            let z: Corners = std::array::from_fn(|k| -here[k] - softness[k] * b);
            for (k, node) in nodes.iter().enumerate() {
                let Some(node) = node else { continue };
                let share = self.slopes[t].times(k, &z);
                (0..2).for_each(|c| rhs[*node as usize][c] += share[c]);
            }
            y.push(here);
        }
        let mut columns = [rhs];
        self.spd.solve(&mut columns)?;
        let [vertices] = columns;
        let dm = Multipliers { triangles: Vec::new(), vertices };
        for (t, (y, nodes)) in y.iter_mut().zip(self.nodes).enumerate() {
            let softness = &self.softness[t];
            let pull = self.slopes[t].transposed_times(&dm.at(nodes));
            let total: f64 = softness.iter().sum();
            let along: f64 = (0..3).map(|k| y[k] + softness[k] * pull[k]).sum();
            let dm_triangle = (failing.triangles[t] - along) / total;
            *y = std::array::from_fn(|k| -y[k] - softness[k] * (pull[k] + dm_triangle));
            m.triangles[t] += dm_triangle;
        }
        for (m, dm) in m.vertices.iter_mut().zip(&dm.vertices) {
            (0..2).for_each(|c| m[c] += dm[c]);
        }
        Ok(y)
    }
}

/// Q_a P Q_b'.
fn block(a: &[Corners; 2], b: &[Corners; 2], softness: &Corners, total: f64) -> [[f64; 2]; 2] {
    let soft = |row: &Corners| -> Corners { std::array::from_fn(|k| row[k] * softness[k]) };
    let dot = |p: &Corners, q: &Corners| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
    a.map(|a| {
        let a_soft = soft(&a);
        let a_sum: f64 = a_soft.iter().sum();
        b.map(|b| dot(&a_soft, &b) - a_sum * dot(softness, &b) / total)
    })
}
