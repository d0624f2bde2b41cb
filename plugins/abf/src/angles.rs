//! Angles of a mesh: target angles, residuals and Jacobian of the planarity constraints.

use std::f64::consts::{PI, TAU};

use platen_shape::DiskMesh;
use platen_shape::flatten::cotangents;

/// Three numbers per triangle, one at each corner.
pub(crate) type Corners = [f64; 3];

/// Returns the measured angles, scaled at interior vertices so that they sum to 2 pi.
pub(crate) fn targets(mesh: &DiskMesh, node_of: &[Option<u32>], n_inner: usize) -> Vec<Corners> {
    let mut targets: Vec<_> = cotangents(mesh).into_iter().map(|c| c.map(|c| 1.0_f64.atan2(c))).collect();
    let mut sums = vec![0.0; n_inner];
    for (t, angles) in mesh.triangles.iter().zip(&targets) {
        for (&v, angle) in t.iter().zip(angles) {
            if let Some(node) = node_of[v as usize] {
                sums[node as usize] += angle;
            }
        }
    }
    for (t, angles) in mesh.triangles.iter().zip(&mut targets) {
        for (&v, angle) in t.iter().zip(angles) {
            if let Some(node) = node_of[v as usize] {
                *angle *= TAU / sums[node as usize];
            }
        }
    }
    targets
}

/// Residuals of the constraints: per triangle the sum of angles less pi; per interior vertex the sum of angles less 2
/// pi, and the logarithm of the factor by which edge lengths grow in one turn around it.
pub(crate) struct Residuals {
    pub(crate) triangles: Vec<f64>,
    pub(crate) vertices: Vec<[f64; 2]>,
}

impl Residuals {
    pub(crate) fn new(x: &[Corners], nodes: &[[Option<u32>; 3]], n_inner: usize) -> Self {
        let mut vertices = vec![[-TAU, 0.0]; n_inner];
        for (x, nodes) in x.iter().zip(nodes) {
            let log_sin = x.map(|x| x.sin().ln());
            for k in 0..3 {
                let Some(node) = nodes[k] else { continue };
                let [turn, growth] = &mut vertices[node as usize];
                *turn += x[k];
                *growth += log_sin[(k + 1) % 3] - log_sin[(k + 2) % 3];
            }
        }
        Self { triangles: x.iter().map(|x| x[0] + x[1] + x[2] - PI).collect(), vertices }
    }
}

/// Jacobian block of a triangle in the vertex constraints: for each corner, the derivatives of the turn and of the
/// growth by the triangle's three angles.
#[derive(Clone, Copy)]
pub(crate) struct Jacobian([[Corners; 2]; 3]);

impl Jacobian {
    pub(crate) fn at(x: &Corners) -> Self {
        let cot = x.map(|x| 1.0 / x.tan());
        Self(std::array::from_fn(|k| {
            let [mut turn, mut growth] = [[0.0; 3]; 2];
            turn[k] = 1.0;
            growth[(k + 1) % 3] = cot[(k + 1) % 3];
            growth[(k + 2) % 3] = -cot[(k + 2) % 3];
            [turn, growth]
        }))
    }

    /// Returns the product of the rows of corner `k` with three numbers of the triangle.
    pub(crate) fn times(&self, k: usize, x: &Corners) -> [f64; 2] {
        self.0[k].map(|row| row[0] * x[0] + row[1] * x[1] + row[2] * x[2])
    }

    /// Returns the product of the transposed block with the multipliers of the corners.
    pub(crate) fn transposed_times(&self, multipliers: &[[f64; 2]; 3]) -> Corners {
        let mut sum = [0.0; 3];
        for (rows, m) in self.0.iter().zip(multipliers) {
            (0..3).for_each(|i| sum[i] += rows[0][i] * m[0] + rows[1][i] * m[1]);
        }
        sum
    }

    pub(crate) fn rows(&self, k: usize) -> &[Corners; 2] {
        &self.0[k]
    }
}
