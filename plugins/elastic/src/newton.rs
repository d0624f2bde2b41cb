//! Newton's method with line search for the minimum of membrane energy plus springs.
//!
//! The Hessian changes little between steps, because strains are parts per thousand. Its factor is therefore reused as
//! long as the steps shrink fast; most plates need only one factorisation.

use platen_numerics::sparse::{Graph, SparseError, Spd};
use platen_sdk::{Error, ErrorKind, Result};
use platen_shape::DiskMesh;
use platen_shape::flatten::plane_picture;

use crate::boundary_springs::BoundarySprings;
use crate::membrane::Membrane;

/// Convergence: no vertex moves farther in a full step, metres. It is a thousandth of the position uncertainty of the
/// best scan.
const TOLERANCE: f64 = 1e-7;
/// Largest number of steps; four or five are usual, a dozen on a folded mesh.
const MAX_STEPS: usize = 60;
/// The Hessian is factored again if a step is longer than this share of the previous one.
const SLOW: f64 = 0.2;
/// Armijo's constant: a step that lowers the energy by less than this share of the linear prediction is halved.
const SUFFICIENT: f64 = 1e-4;
/// Relative rounding error of the energy.
const ROUNDING: f64 = 1e-13;

/// Moves the material positions `x` to the nearest minimum. `check` is called before each step.
///
/// # Errors
/// When no minimum is found, or `check` fails.
pub(crate) fn minimise(
    mesh: &DiskMesh,
    membrane: &Membrane<'_>,
    springs: &BoundarySprings,
    x: &mut [[f64; 2]],
    check: impl Fn() -> Result<()>,
) -> Result<()> {
    let nodes: Vec<_> = (0..x.len() as u32).map(Some).collect();
    let graph = Graph::of_elements(&mesh.triangles, &nodes, x.len());
    let mut spd = Spd::<2>::analyse(&graph, &plane_picture(mesh)).map_err(|e| unsolved(&e))?;
    let energy = |x: &[[f64; 2]]| membrane.energy(x) + springs.energy(x);
    let mut here = energy(x);
    let mut last_step = 0.0;
    for _ in 0..MAX_STEPS {
        check()?;
        if last_step == 0.0 {
            spd.clear();
            membrane.add_hessian(x, &mut spd);
            springs.add_hessian(&mut spd);
            spd.factor().map_err(|e| unsolved(&e))?;
        }
        let mut gradient = vec![[0.0; 2]; x.len()];
        membrane.add_gradient(x, &mut gradient);
        springs.add_gradient(x, &mut gradient);
        let mut direction = [gradient.iter().map(|g| [-g[0], -g[1]]).collect::<Vec<_>>()];
        spd.solve(&mut direction).map_err(|e| unsolved(&e))?;
        let [direction] = direction;
        let Some((share, there)) = line_search(energy, here, x, &direction, &gradient) else {
            return Err(not_found("no step lowers the energy"));
        };
        here = there;
        let mut longest = 0.0_f64;
        for (x, d) in x.iter_mut().zip(&direction) {
            longest = longest.max(share * d[0].hypot(d[1]));
            (0..2).for_each(|c| x[c] += share * d[c]);
        }
        if share == 1.0 && longest < TOLERANCE {
            return Ok(());
        }
        let slow = share < 1.0 || (last_step > 0.0 && longest > SLOW * last_step);
        last_step = if slow { 0.0 } else { longest };
    }
    Err(not_found(&format!("no minimum in {MAX_STEPS} steps")))
}

/// Performs a backtracking line search: returns the largest of 1, 1/2, 1/4 ... that satisfies Armijo's rule without
/// inverting a triangle, and the energy there. `here` is the energy at `x`.
fn line_search(
    energy: impl Fn(&[[f64; 2]]) -> f64,
    here: f64,
    x: &[[f64; 2]],
    direction: &[[f64; 2]],
    gradient: &[[f64; 2]],
) -> Option<(f64, f64)> {
    let slope: f64 = direction.iter().zip(gradient).map(|(d, g)| d[0] * g[0] + d[1] * g[1]).sum();
    let there = |share: f64| {
        let moved: Vec<_> =
            x.iter().zip(direction).map(|(x, d)| [x[0] + share * d[0], x[1] + share * d[1]]).collect();
        energy(&moved)
    };
    let shares = std::iter::successors(Some(1.0), |share| Some(share / 2.0)).take(40);
    let mut tried = shares.map(|share| (share, there(share)));
    tried.find(|(share, there)| *there <= here * (1.0 + ROUNDING) + SUFFICIENT * share * slope)
}

pub(crate) fn unsolved(error: &SparseError) -> Error {
    not_found(&error.to_string())
}

pub(crate) fn not_found(what: &str) -> Error {
    Error::new(ErrorKind::BadData, format!("no least membrane energy: {what}"))
        .hint("scan again; if the error stays, report this scan and flatten it with `harmonic`")
}
