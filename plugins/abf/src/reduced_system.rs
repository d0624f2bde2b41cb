//! Newton step with the angles and the triangles' multipliers eliminated (ABF++).
//!
//! With L the diagonal matrix of the weights and J the Jacobian of the constraints, triangles first, the step (dx, dm)
//! solves
//!
//! ```text
//! L dx + J' dm = -r        r = L (x - b) + J' m
//! J dx         = -c
//! ```
//!
//! J L^-1 J' dm = c - J L^-1 r is partitioned into triangles (1, diagonal) and vertices (2). Its Schur complement in 2
//! is the sum over the triangles of Q P Q', with Q the Jacobian rows of the triangle's corners and P = L^-1 - L^-1 1 1'
//! L^-1 / (1' L^-1 1).

use platen_numerics::sparse::{Graph, SparseError, Spd};

use crate::angles::{Corners, Jacobian, Residuals};

/// Reduced system, with the coefficients of each triangle that the elimination needs.
pub(crate) struct ReducedSystem<'a> {
    nodes: &'a [[Option<u32>; 3]],
    /// Diagonal of L^-1.
    inverse_weights: Vec<Corners>,
    /// Jacobian at the angles of the last factorisation.
    jacobian: Vec<Jacobian>,
    spd: Spd<2>,
}

/// Lagrange multipliers of the constraints.
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

impl<'a> ReducedSystem<'a> {
    pub(crate) fn new(
        nodes: &'a [[Option<u32>; 3]],
        targets: &[Corners],
        graph: &Graph,
        points: &[[f64; 2]],
    ) -> Result<Self, SparseError> {
        let inverse_weights = targets.iter().map(|b| b.map(|b| b * b)).collect();
        Ok(Self { nodes, inverse_weights, jacobian: Vec::new(), spd: Spd::analyse(graph, points)? })
    }

    /// Factors the system at the angles `x`.
    pub(crate) fn factor(&mut self, x: &[Corners]) -> Result<(), SparseError> {
        self.jacobian = x.iter().map(Jacobian::at).collect();
        self.spd.clear();
        for ((nodes, jacobian), inverse_weights) in
            self.nodes.iter().zip(&self.jacobian).zip(&self.inverse_weights)
        {
            let total: f64 = inverse_weights.iter().sum();
            for (a, b) in [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)] {
                if let (Some(i), Some(j)) = (nodes[a], nodes[b]) {
                    self.spd.add(i, j, block(jacobian.rows(a), jacobian.rows(b), inverse_weights, total));
                }
            }
        }
        self.spd.factor()
    }

    /// Solves for the step of angles and multipliers from `x`, `m` with the last factor. Adds the multipliers' step to
    /// `m` and returns the step of the angles.
    pub(crate) fn step(
        &self,
        x: &[Corners],
        targets: &[Corners],
        residuals: &Residuals,
        m: &mut Multipliers,
    ) -> Result<Vec<Corners>, SparseError> {
        // L^-1 r, with the Jacobian at `x` and not that of the factor.
        let mut y: Vec<Corners> = Vec::with_capacity(x.len());
        let mut rhs = residuals.vertices.clone();
        for (t, (x, nodes)) in x.iter().zip(self.nodes).enumerate() {
            let inverse_weights = &self.inverse_weights[t];
            let pull = Jacobian::at(x).transposed_times(&m.at(nodes));
            let here: Corners = std::array::from_fn(|k| {
                x[k] - targets[t][k] + inverse_weights[k] * (pull[k] + m.triangles[t])
            });
            let total: f64 = inverse_weights.iter().sum();
            let b = (residuals.triangles[t] - here.iter().sum::<f64>()) / total;
            let z: Corners = std::array::from_fn(|k| -here[k] - inverse_weights[k] * b);
            for (k, node) in nodes.iter().enumerate() {
                let Some(node) = node else { continue };
                let share = self.jacobian[t].times(k, &z);
                (0..2).for_each(|c| rhs[*node as usize][c] += share[c]);
            }
            y.push(here);
        }
        let mut columns = [rhs];
        self.spd.solve(&mut columns)?;
        let [vertices] = columns;
        let dm = Multipliers { triangles: Vec::new(), vertices };
        for (t, (y, nodes)) in y.iter_mut().zip(self.nodes).enumerate() {
            let inverse_weights = &self.inverse_weights[t];
            let pull = self.jacobian[t].transposed_times(&dm.at(nodes));
            let total: f64 = inverse_weights.iter().sum();
            let along: f64 = (0..3).map(|k| y[k] + inverse_weights[k] * pull[k]).sum();
            let dm_triangle = (residuals.triangles[t] - along) / total;
            *y = std::array::from_fn(|k| -y[k] - inverse_weights[k] * (pull[k] + dm_triangle));
            m.triangles[t] += dm_triangle;
        }
        for (m, dm) in m.vertices.iter_mut().zip(&dm.vertices) {
            (0..2).for_each(|c| m[c] += dm[c]);
        }
        Ok(y)
    }
}

/// Returns the block Q_a P Q_b'.
fn block(a: &[Corners; 2], b: &[Corners; 2], inverse_weights: &Corners, total: f64) -> [[f64; 2]; 2] {
    let soft = |row: &Corners| -> Corners { std::array::from_fn(|k| row[k] * inverse_weights[k]) };
    let dot = |p: &Corners, q: &Corners| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
    a.map(|a| {
        let a_soft = soft(&a);
        let a_sum: f64 = a_soft.iter().sum();
        b.map(|b| dot(&a_soft, &b) - a_sum * dot(inverse_weights, &b) / total)
    })
}
