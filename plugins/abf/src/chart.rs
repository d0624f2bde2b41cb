//! Chart of a mesh: plane angles by Newton's method, then the layout.

use std::f64::consts::PI;

use platen_numerics::sparse::{Graph, SparseError};
use platen_sdk::{Error, ErrorKind, Result};
use platen_shape::DiskMesh;
use platen_shape::flatten::{fixed_boundary, interior, plane_picture};

use crate::angles::{Corners, Residuals, targets};
use crate::reduced_system::{Multipliers, ReducedSystem};

/// Convergence: no angle changes by more in a full step, radians. It corresponds to 0.01 micrometre across the plate.
const TOLERANCE: f64 = 1e-8;
/// Largest number of steps; four to eight are usual.
const MAX_STEPS: usize = 60;
/// The system is factored again if a step is longer than this share of the previous one.
const SLOW: f64 = 0.2;
/// Smallest share of an angle's distance to 0 and to pi that must remain after a step.
const KEPT: f64 = 0.1;

/// Returns (u, v) per vertex, metres. `check` is called between the steps and stops the work with its error.
pub(crate) fn abf(mesh: &DiskMesh, check: impl Fn() -> Result<()>) -> Result<Vec<[f64; 2]>> {
    let angles = plane_angles(mesh, check)?;
    let cotangents: Vec<_> = angles.iter().map(|x| x.map(|x| 1.0 / x.tan())).collect();
    fixed_boundary(mesh, &cotangents).map_err(|e| unsolved(&e))
}

/// Returns the angles of a plane mesh nearest to those of `mesh`.
pub(crate) fn plane_angles(mesh: &DiskMesh, check: impl Fn() -> Result<()>) -> Result<Vec<Corners>> {
    let (node_of, inner) = interior(mesh);
    let nodes: Vec<_> = mesh.triangles.iter().map(|t| t.map(|v| node_of[v as usize])).collect();
    let targets = targets(mesh, &node_of, inner.len());
    let picture = plane_picture(mesh);
    let points: Vec<_> = inner.iter().map(|&v| picture[v as usize]).collect();
    let graph = Graph::of_elements(&mesh.triangles, &node_of, inner.len());
    let mut system = ReducedSystem::new(&nodes, &targets, &graph, &points).map_err(|e| unsolved(&e))?;
    let mut x = targets.clone();
    let mut m = Multipliers::zeros(x.len(), inner.len());
    let mut last_step = 0.0;
    for _ in 0..MAX_STEPS {
        check()?;
        if last_step == 0.0 {
            system.factor(&x).map_err(|e| unsolved(&e))?;
        }
        let residuals = Residuals::new(&x, &nodes, inner.len());
        let step = system.step(&x, &targets, &residuals, &mut m).map_err(|e| unsolved(&e))?;
        let share = allowed(&x, &step);
        let longest = step.iter().flatten().fold(0.0, |max: f64, d| max.max(share * d.abs()));
        for (x, d) in x.iter_mut().zip(&step) {
            (0..3).for_each(|k| x[k] += share * d[k]);
        }
        if share == 1.0 && longest < TOLERANCE {
            return Ok(x);
        }
        let slow = share < 1.0 || (last_step > 0.0 && longest > SLOW * last_step);
        last_step = if slow { 0.0 } else { longest };
    }
    Err(refused(&format!("no convergence in {MAX_STEPS} steps")))
}

/// Returns the share of a step, at most 1, that keeps all angles between 0 and pi.
fn allowed(x: &[Corners], step: &[Corners]) -> f64 {
    let of_angle = |(&x, &d): (&f64, &f64)| {
        let room = (1.0 - KEPT) * if d < 0.0 { x } else { PI - x };
        if d.abs() > room { room / d.abs() } else { 1.0 }
    };
    x.iter().flatten().zip(step.iter().flatten()).map(of_angle).fold(1.0, f64::min)
}

fn unsolved(error: &SparseError) -> Error {
    refused(&error.to_string())
}

fn refused(what: &str) -> Error {
    Error::new(ErrorKind::BadData, format!("no plane angles found near those of the mesh: {what}"))
        .hint("scan again; if the error stays, report this scan and flatten it with `harmonic`")
}
