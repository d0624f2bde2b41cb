//! Place of the next bend on a doubly curved target: the place and direction of the largest missing curvature.
//!
//! Limit: bending in two directions stretches the plate, so that neither the gap after a bend nor a plan can be
//! predicted from bends along lines.

use platen_model::{Advice, CannotAdvise, PlateHistory, Sentence, Step};
use platen_shape::surface::Curvature;
use platen_shape::{Surface, TargetSurface};

use crate::next_bend::{cannot, done, of, passes};
use crate::remarks::STRETCHES;

/// Spacing of the places that are tried, metres, and half the side of the square over which the curvature is averaged.
const GRID: f64 = 0.1;
const HALF: f64 = 0.2;
/// Least missing curvature that is considered, 1/m: a radius of 200 m.
const LEAST: f64 = 5e-3;

/// Returns the place after the last stroke.
pub(crate) fn advise(history: &PlateHistory, target: &TargetSurface, now: &Surface) -> Advice {
    if passes(history) {
        return done();
    }
    let count = |length: f64| ((length - 2.0 * HALF) / GRID).floor().max(0.0) as usize;
    let (n_u, n_v) = (count(now.width()), count(now.height()));
    let mut most: Option<(f64, [f64; 2], Curvature)> = None;
    let mut any_seen = false;
    for k in 0..=n_u * (n_v + 1) + n_v {
        let (i, j) = (k % (n_u + 1), k / (n_u + 1));
        let at = [HALF + GRID * i as f64, HALF + GRID * j as f64];
        let Some(missing) = missing(target, now, at) else { continue };
        any_seen = true;
        let lacks = missing.strongest() * target.side();
        if lacks > most.as_ref().map_or(LEAST, |most| most.0) {
            most = Some((lacks, at, missing));
        }
    }
    match most {
        Some((_, at, missing)) => {
            let [x, y] = missing.strongest_direction();
            let direction = x.atan2(-y).rem_euclid(std::f64::consts::PI);
            let says = vec![Sentence::new(STRETCHES, &[])];
            Advice { says, ..of(Step::Place { at, direction }) }
        }
        None if any_seen => cannot(CannotAdvise::BentTooFar),
        None => cannot(CannotAdvise::Unseen),
    }
}

/// Returns the mean curvature that is missing around a place; `None` where a fifth of it was not seen.
fn missing(target: &TargetSurface, now: &Surface, at: [f64; 2]) -> Option<Curvature> {
    const N: usize = 5;
    let (mut sum, mut seen) = ([0.0; 3], 0);
    for k in 0..N * N {
        let off = |k: usize| HALF * (2.0 * k as f64 / (N - 1) as f64 - 1.0);
        let (u, v) = (at[0] + off(k % N), at[1] + off(k / N));
        if now.mask().seen(u, v) {
            let lacks = target.curvature(u, v) - now.curvature(u, v);
            sum = [sum[0] + lacks.u, sum[1] + lacks.v, sum[2] + lacks.uv];
            seen += 1;
        }
    }
    let [u, v, uv] = sum.map(|sum| sum / seen as f64);
    (5 * seen >= 4 * N * N).then(|| Curvature::from_form(u, v, uv))
}
