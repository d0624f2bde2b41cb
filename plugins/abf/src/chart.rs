//! From the mesh to the chart: angles, then layout.

use std::f64::consts::PI;

use platen_sdk::{Error, ErrorKind, Result};
use platen_shape::DiskMesh;
use platen_shape::flatten::{fixed_boundary, interior, plane_picture};
use platen_shape::sparse::{Graph, SparseError};

use crate::angles::{Corners, Failing, targets};
use crate::reduced::{Multipliers, Reduced};

/// The last step is smaller than this, radians: 0.01 micrometre across the plate.
const TOLERANCE: f64 = 1e-8;
/// Steps allowed; four to eight are usual.
const MAX_STEPS: usize = 60;
/// The factor is renewed when a step is longer than this share of the one before.
const SLOW: f64 = 0.2;
/// A step leaves an angle at least this share of its distance to 0 and to pi.
const KEPT: f64 = 0.1;

/// (u, v) per vertex, metres; `go_on` is asked between the steps.
pub(crate) fn abf(mesh: &DiskMesh, go_on: impl Fn() -> Result<()>) -> Result<Vec<[f64; 2]>> {
    let angles = plane_angles(mesh, go_on)?;
    let cotangents: Vec<_> = angles.iter().map(|x| x.map(|x| 1.0 / x.tan())).collect();
    fixed_boundary(mesh, &cotangents).map_err(|e| unsolved(&e))
}

/// The angles of a plane mesh nearest to those of `mesh`.
pub(crate) fn plane_angles(mesh: &DiskMesh, go_on: impl Fn() -> Result<()>) -> Result<Vec<Corners>> {
    let (node_of, inner) = interior(mesh);
    let nodes: Vec<_> = mesh.triangles.iter().map(|t| t.map(|v| node_of[v as usize])).collect();
    let targets = targets(mesh, &node_of, inner.len());
    let picture = plane_picture(mesh);
    let points: Vec<_> = inner.iter().map(|&v| picture[v as usize]).collect();
    let graph = Graph::of_elements(&mesh.triangles, &node_of, inner.len());
    let mut reduced = Reduced::new(&nodes, &targets, &graph, &points).map_err(|e| unsolved(&e))?;
    let mut x = targets.clone();
    let mut m = Multipliers::zeros(x.len(), inner.len());
    let mut last_step = 0.0;
    for _ in 0..MAX_STEPS {
        go_on()?;
        if last_step == 0.0 {
            reduced.factor(&x).map_err(|e| unsolved(&e))?;
        }
        let failing = Failing::of(&x, &nodes, inner.len());
        let step = reduced.step(&x, &targets, &failing, &mut m).map_err(|e| unsolved(&e))?;
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
    Err(refused(&format!("not reached in {MAX_STEPS} steps")))
}

/// The share of a step, 1 or less, that keeps all angles within 0 and pi.
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
    Error::new(ErrorKind::BadData, format!("no plane angles near the mesh's: {what}"))
        .hint("scan again; if it stays, report this scan and flatten it with `harmonic`")
}
