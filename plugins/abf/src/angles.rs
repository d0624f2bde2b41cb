//! The angles of a mesh, their targets and what a plane asks of them.

use std::f64::consts::{PI, TAU};

use platen_shape::DiskMesh;
use platen_shape::flatten::cotangents;

/// Three numbers of a triangle, one per corner.
pub(crate) type Corners = [f64; 3];

/// The measured angles, at interior vertices scaled so that they sum up to 2 pi.
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

/// By how much the constraints fail: per triangle the sum less pi; per interior vertex the sum less 2 pi, and by how much
/// the logarithm of its ring's length grows in one turn.
pub(crate) struct Failing {
    pub(crate) triangles: Vec<f64>,
    pub(crate) vertices: Vec<[f64; 2]>,
}

impl Failing {
    pub(crate) fn of(x: &[Corners], nodes: &[[Option<u32>; 3]], n_inner: usize) -> Self {
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

/// The derivatives of a triangle's share in the vertex constraints: per corner, by its three angles, of the turn and of
/// the growth.
#[derive(Clone, Copy)]
pub(crate) struct Slopes([[Corners; 2]; 3]);

impl Slopes {
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

    /// Rows of corner `k` times three numbers of the triangle.
    pub(crate) fn times(&self, k: usize, x: &Corners) -> [f64; 2] {
        self.0[k].map(|row| row[0] * x[0] + row[1] * x[1] + row[2] * x[2])
    }

    /// The rows' sum, weighted by the multipliers of the corners.
    pub(crate) fn transposed_times(&self, multipliers: &[[f64; 2]; 3]) -> Corners {
        let mut sum = [0.0; 3];
        for (rows, m) in self.0.iter().zip(multipliers) {
            (0..3).for_each(|i| sum[i] += rows[0][i] * m[0] + rows[1][i] * m[1]);
        }
        sum
    }

    /// Rows of corner `k`.
    pub(crate) fn rows(&self, k: usize) -> &[Corners; 2] {
        &self.0[k]
    }
}
