//! Development of a curved plate with free edges: minimum of the membrane energy by Newton steps with a constant
//! stiffness.
//!
//! In: the mesh. Out: plane places of its vertices, metres, and the remaining strain ([`LaidFlat`]).
//!
//! The unknowns are the plane places x of the vertices. With G a triangle's metric in space and M = [x1 - x0, x2 - x0],
//! E = (M^-T G M^-1 - I) / 2 is its Green strain. Moving the places by d changes E by -(grad d + grad d') / 2 as long
//! as E is small. Each step is therefore one of linear elasticity (plane stress), and the stiffness at the start serves
//! for all steps:
//!
//! ```text
//! sum over triangles of A e(d) : D : e(h) = sum of A E : D : e(h)   for all h,   e(d) = (grad d + grad d') / 2
//! ```
//!
//! A developable plate has a development without strain, which is found with any material law, to second order of the
//! mesh's sides: 10 um on 5 m at R 5 m. On double curvature the law matters: another one changes the outline by the
//! order of the remaining strain times the plate's size.

use platen_numerics::sparse::{Graph, SparseError, Spd};

use super::domain::{first_turned, plane_picture, signed_area};
use super::fixed_boundary::{cotangents, fixed_boundary};
use crate::mesh::DiskMesh;

/// Poisson's ratio of steel.
pub(super) const POISSON: f64 = 0.3;
/// Length of a step, metres, below which it is the last.
const TOLERANCE: f64 = 1e-7;
/// Largest number of steps; three or four are usual, each shorter by the strain or the rotation that is left.
const MAX_STEPS: usize = 20;
/// Stiffness that holds the plate in its place. No force acts there, so that any value serves.
const HELD: f64 = 1.0;

/// The plate laid flat.
#[derive(Debug, Clone)]
pub struct LaidFlat {
    /// Per vertex: place in the plane, metres; corner (0,0) at the origin, corner (W,0) on the u axis.
    pub uv: Vec<[f64; 2]>,
    /// Root mean square over the plate of the remaining strain.
    pub strain: f64,
}

/// Develops the mesh into the plane with free edges; `None` when a triangle folds over during the steps or they do not
/// converge.
///
/// Cost: two sparse Cholesky factorisations.
///
/// # Errors
/// [`SparseError`] when the equations of the mesh cannot be solved.
pub fn lay_flat(mesh: &DiskMesh) -> Result<Option<LaidFlat>, SparseError> {
    let mut uv = fixed_boundary(mesh, &cotangents(mesh))?;
    if first_turned(&mesh.triangles, &uv).is_some() {
        return Ok(None);
    }
    let metrics: Vec<[f64; 3]> = mesh.triangles.iter().map(|t| metric(mesh, t)).collect();
    let [origin, on_axis] = [0, 1].map(|k| mesh.boundary[mesh.corners[k] as usize]);
    let spd = stiffness(mesh, &uv, [origin, on_axis])?;
    for _ in 0..MAX_STEPS {
        let mut load = vec![[0.0; 2]; uv.len()];
        for (t, metric) in mesh.triangles.iter().zip(&metrics) {
            let (area, hats) = hats(t.map(|v| uv[v as usize]));
            for (v, force) in t.iter().zip(forces(area, &hats, strain(&hats, metric))) {
                (0..2).for_each(|c| load[*v as usize][c] += force[c]);
            }
        }
        (0..2).for_each(|c| load[origin as usize][c] -= HELD * uv[origin as usize][c]);
        load[on_axis as usize][1] -= HELD * uv[on_axis as usize][1];
        let mut columns = [load];
        spd.solve(&mut columns)?;
        let [step] = columns;
        let mut longest = 0.0_f64;
        for (x, d) in uv.iter_mut().zip(&step) {
            longest = longest.max(d[0].hypot(d[1]));
            (0..2).for_each(|c| x[c] += d[c]);
        }
        if longest.is_nan() || first_turned(&mesh.triangles, &uv).is_some() {
            return Ok(None);
        }
        if longest < TOLERANCE {
            let strain = rms_strain(mesh, &metrics, &uv);
            return Ok(Some(LaidFlat { uv, strain }));
        }
    }
    Ok(None)
}

/// Assembles and factors the stiffness of the flat plate at the places `uv`, held in its place at two corners.
fn stiffness(mesh: &DiskMesh, uv: &[[f64; 2]], [origin, on_axis]: [u32; 2]) -> Result<Spd<2>, SparseError> {
    let nodes: Vec<_> = (0..uv.len() as u32).map(Some).collect();
    let graph = Graph::of_elements(&mesh.triangles, &nodes, uv.len());
    let mut spd = Spd::<2>::analyse(&graph, &plane_picture(mesh))?;
    for t in &mesh.triangles {
        let (area, hats) = hats(t.map(|v| uv[v as usize]));
        for (i, j) in [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)] {
            spd.add(t[i], t[j], plane_stress(hats[i], hats[j], POISSON).map(|row| row.map(|x| area * x)));
        }
    }
    spd.add(origin, origin, [[HELD, 0.0], [0.0, HELD]]);
    spd.add(on_axis, on_axis, [[0.0, 0.0], [0.0, HELD]]);
    spd.factor()?;
    Ok(spd)
}

/// Returns the block of two hat gradients in linear plane stress, per area, Young's modulus 1.
#[must_use]
pub fn plane_stress(a: [f64; 2], b: [f64; 2], poisson: f64) -> [[f64; 2]; 2] {
    let young = 1.0 / (1.0 - poisson * poisson);
    let shear = 0.5 * (1.0 - poisson) * young;
    [
        [young * a[0] * b[0] + shear * a[1] * b[1], young * poisson * a[0] * b[1] + shear * a[1] * b[0]],
        [young * poisson * a[1] * b[0] + shear * a[0] * b[1], young * a[1] * b[1] + shear * a[0] * b[0]],
    ]
}

/// Returns the metric of a triangle in space: (e1.e1, e1.e2, e2.e2) of its sides from the first corner.
pub(super) fn metric(mesh: &DiskMesh, t: &[u32; 3]) -> [f64; 3] {
    let [a, b, c] = t.map(|v| mesh.vertices[v as usize]);
    let (e1, e2) = (b - a, c - a);
    [e1.dot(&e1), e1.dot(&e2), e2.dot(&e2)]
}

/// Returns the area of a plane triangle and the gradients of its three hat functions.
pub(super) fn hats([a, b, c]: [[f64; 2]; 3]) -> (f64, [[f64; 2]; 3]) {
    let area = signed_area([a, b, c]);
    let hat = |p: [f64; 2], q: [f64; 2]| [(p[1] - q[1]) / (2.0 * area), (q[0] - p[0]) / (2.0 * area)];
    (area, [hat(b, c), hat(c, a), hat(a, b)])
}

/// Returns Green's strain 11, 22, 12: the rows of M^-1 are the gradients of the second and third hat function.
pub(super) fn strain([_, p, q]: &[[f64; 2]; 3], [g11, g12, g22]: &[f64; 3]) -> [f64; 3] {
    let stretch =
        |i: usize, j: usize| g11 * p[i] * p[j] + g12 * (p[i] * q[j] + q[i] * p[j]) + g22 * q[i] * q[j];
    [0.5 * (stretch(0, 0) - 1.0), 0.5 * (stretch(1, 1) - 1.0), 0.5 * stretch(0, 1)]
}

/// Returns the forces of a triangle's strain on its corners, plane stress, Young's modulus 1.
pub(super) fn forces(area: f64, hats: &[[f64; 2]; 3], [e11, e22, e12]: [f64; 3]) -> [[f64; 2]; 3] {
    let lateral = POISSON * (e11 + e22);
    let [s11, s22, s12] =
        [(1.0 - POISSON) * e11 + lateral, (1.0 - POISSON) * e22 + lateral, (1.0 - POISSON) * e12]
            .map(|s| area * s / (1.0 - POISSON * POISSON));
    hats.map(|hat| [s11 * hat[0] + s12 * hat[1], s12 * hat[0] + s22 * hat[1]])
}

fn rms_strain(mesh: &DiskMesh, metrics: &[[f64; 3]], uv: &[[f64; 2]]) -> f64 {
    let (mut square, mut total) = (0.0, 0.0);
    for (t, metric) in mesh.triangles.iter().zip(metrics) {
        let (area, hats) = hats(t.map(|v| uv[v as usize]));
        let [a, b, c] = strain(&hats, metric);
        square += area * (a * a + b * b + 2.0 * c * c);
        total += area;
    }
    (square / total).sqrt()
}
