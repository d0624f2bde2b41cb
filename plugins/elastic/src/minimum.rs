//! The minimum of membrane energy and springs, by Newton's method.
//!
//! The Hessian changes little on the way: strains are parts of a thousand. So its factor is kept as long as the steps
//! shrink fast, and on most plates the first is the only one.

use platen_sdk::{Error, ErrorKind, Result};
use platen_shape::DiskMesh;
use platen_shape::flatten::plane_picture;
use platen_shape::sparse::{Graph, SparseError, Spd};

use crate::hold::Hold;
use crate::membrane::Membrane;

/// The last step is shorter than this, metres: a thousandth of what the best scan tells of a place.
const TOLERANCE: f64 = 1e-7;
/// Steps allowed; four or five are usual, a dozen on a mesh with folds in it.
const MAX_STEPS: usize = 60;
/// The factor is renewed when a step is longer than this share of the one before.
const SLOW: f64 = 0.2;
/// A step that lowers the energy by less than this share of what its slope promises is halved (Armijo's rule).
const SUFFICIENT: f64 = 1e-4;
/// Shares of the energy below this are rounding.
const ROUNDING: f64 = 1e-13;

/// Moves the material places `x` to the nearest minimum; `go_on` is asked before each step.
///
/// # Errors
/// When there is no minimum within reach, or `go_on` says so.
pub(crate) fn minimise(
    mesh: &DiskMesh,
    membrane: &Membrane<'_>,
    hold: &Hold,
    x: &mut [[f64; 2]],
    go_on: impl Fn() -> Result<()>,
) -> Result<()> {
    let nodes: Vec<_> = (0..x.len() as u32).map(Some).collect();
    let graph = Graph::of_elements(&mesh.triangles, &nodes, x.len());
    let mut spd = Spd::<2>::analyse(&graph, &plane_picture(mesh)).map_err(|e| unsolved(&e))?;
    let energy = |x: &[[f64; 2]]| membrane.energy(x) + hold.energy(x);
    let mut here = energy(x);
    let mut last_step = 0.0;
    for _ in 0..MAX_STEPS {
        go_on()?;
        if last_step == 0.0 {
            spd.clear();
            membrane.add_hessian(x, &mut spd);
            hold.add_hessian(&mut spd);
            spd.factor().map_err(|e| unsolved(&e))?;
        }
        let mut gradient = vec![[0.0; 2]; x.len()];
        membrane.add_gradient(x, &mut gradient);
        hold.add_gradient(x, &mut gradient);
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

/// The largest of 1, 1/2, 1/4 ... that lowers the energy `here` enough without turning a triangle over, and the energy there.
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
        .hint("scan again; if it stays, report this scan and flatten it with `harmonic`")
}
