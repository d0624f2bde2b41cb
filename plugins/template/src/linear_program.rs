//! Linear program in three unknowns by the dual simplex method, for the one-sided seat of a rigid surface.
//!
//! It minimises c . q over q in R^3, c_1 = 1, subject to r_i . q >= d_i for all i. Three constraints form the basis and
//! hold as equalities. In each round the most violated constraint enters, and the one leaves that keeps the multipliers
//! non-negative (ratio test). The objective increases in every round, so the method ends. The solution is exact; 10,000
//! constraints take tens of rounds.

use nalgebra::Matrix3;
use platen_shape::Vec3;

/// Optimal vertex.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Vertex {
    /// The unknowns.
    pub(crate) q: Vec3,
    /// Active constraints.
    pub(crate) active: [usize; 3],
}

/// Violations below this count as rounding, metres.
const ROUNDING: f64 = 1e-12;

/// The objective is shifted by this, metres. If a constraint lies exactly under the middle, as a contact in the middle
/// of the plate does, two multipliers would be 0, the objective would not increase, and the method would cycle
/// (perturbation against degeneracy; Charnes, Econometrica 20, 1952).
const PERTURBATION: [f64; 2] = [1e-7, 0.618e-7];

/// Largest number of rounds, far more than needed.
const ROUNDS: usize = 1000;

/// Returns the minimum; `None` when the program is unbounded (all constraints on one side of the middle) or has fewer
/// than three constraints.
///
/// `reach` is a length much larger than the lever arms of the constraints and of the objective. The active constraints
/// of a similar program are a good `start`; it is used if it is dual feasible.
pub(crate) fn minimum(
    objective: Vec3,
    rows: &[Vec3],
    d: &[f64],
    reach: f64,
    start: Option<[usize; 3]>,
) -> Option<Vertex> {
    // Without a start, three artificial constraints far outside and far below are used. A bounded program drops all of
    // them.
    let deep = -reach;
    let artificial = [0.0, 2.0, 4.0].map(|k: f64| {
        let (sin, cos) = (k * std::f64::consts::PI / 3.0).sin_cos();
        Vec3::new(1.0, reach * cos, reach * sin)
    });
    let row = |i: usize| if i < rows.len() { rows[i] } else { artificial[i - rows.len()] };
    let height = |i: usize| if i < rows.len() { d[i] } else { deep };
    let objective = objective + Vec3::new(0.0, PERTURBATION[0], PERTURBATION[1]);
    let is_feasible = |start: &[usize; 3]| {
        let inverse = Matrix3::from_rows(&start.map(|i| row(i).transpose())).try_inverse();
        inverse.is_some_and(|inverse| (inverse.transpose() * objective).min() >= 0.0)
    };
    let mut basis = start.filter(is_feasible).unwrap_or([rows.len(), rows.len() + 1, rows.len() + 2]);
    for _ in 0..ROUNDS {
        let inverse = Matrix3::from_rows(&basis.map(|i| row(i).transpose())).try_inverse()?;
        let q = inverse * Vec3::from(basis.map(height));
        let (entering, violation) = (0..rows.len())
            .map(|i| (i, d[i] - rows[i].dot(&q)))
            .fold((0, ROUNDING), |most, next| if next.1 > most.1 { next } else { most });
        if violation <= ROUNDING {
            return basis.iter().all(|i| *i < rows.len()).then_some(Vertex { q, active: basis });
        }
        // Multipliers of the objective and of the entering row in terms of the basis.
        let multipliers = inverse.transpose() * objective;
        let shares = inverse.transpose() * rows[entering];
        let leaving = (0..3)
            .filter(|&k| shares[k] > 1e-12)
            .min_by(|&a, &b| (multipliers[a] / shares[a]).total_cmp(&(multipliers[b] / shares[b])))?;
        basis[leaving] = entering;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns rows (1, x, y) over a grid with heights f.
    fn over_grid(n: usize, f: impl Fn(f64, f64) -> f64) -> (Vec<Vec3>, Vec<f64>) {
        let at = |k: usize| 2.0 * k as f64 / (n - 1) as f64 - 1.0;
        let places = (0..n * n).map(|k| (at(k % n), at(k / n)));
        places.map(|(x, y)| (Vec3::new(1.0, x, y), f(x, y))).unzip()
    }

    #[test]
    fn a_hollow_is_spanned_by_its_corners() {
        let (rows, d) = over_grid(41, |x, y| 0.01 * (x * x + y * y) + 0.003 * x);
        let vertex = minimum(Vec3::x(), &rows, &d, 1e3, None).expect("bounded");
        assert!((vertex.q - Vec3::new(0.02, 0.003, 0.0)).norm() < 1e-12, "{vertex:?}");
        assert!(vertex.active.iter().all(|&i| rows[i].y.abs() == 1.0 && rows[i].z.abs() == 1.0));
    }

    #[test]
    fn a_hill_is_touched_at_its_top() {
        let (rows, d) = over_grid(41, |x, y| -0.01 * (x * x + y * y));
        assert!(minimum(Vec3::x(), &rows, &d, 1e3, None).expect("bounded").q.x.abs() < 1e-12);
    }

    #[test]
    fn no_plane_above_all_places_is_lower_in_the_middle() {
        // Comparison with all triples of points that surround the middle: the highest of their planes there.
        let f = |x: f64, y: f64| 0.02 * (3.0 * x + 1.0).sin() * (2.0 * y).cos() + 0.005 * x * y;
        let (rows, d) = over_grid(7, f);
        let mut highest = f64::NEG_INFINITY;
        for i in 0..49 {
            for j in 0..i {
                for k in 0..j {
                    let basis = Matrix3::from_columns(&[rows[i], rows[j], rows[k]]);
                    let Some(inverse) = basis.try_inverse() else { continue };
                    let shares = inverse * Vec3::x();
                    if shares.iter().all(|s| *s >= -1e-12) {
                        highest = highest.max(shares.dot(&Vec3::new(d[i], d[j], d[k])));
                    }
                }
            }
        }
        let vertex = minimum(Vec3::x(), &rows, &d, 1e3, None).expect("bounded");
        assert!((vertex.q.x - highest).abs() < 1e-10, "{} {highest}", vertex.q.x);
    }

    #[test]
    fn the_start_changes_the_way_and_not_the_minimum() {
        let f = |x: f64, y: f64| 0.02 * (3.0 * x + 1.0).sin() * (2.0 * y).cos() + 0.005 * x * y;
        let (rows, d) = over_grid(41, f);
        let start = minimum(Vec3::x(), &rows, &d, 1e3, None).expect("bounded").active;
        let (_, moved) = over_grid(41, |x, y| f(x, y) + 0.004 * (5.0 * x - 3.0 * y).sin());
        let (cold, warm) =
            [None, Some(start)].map(|start| minimum(Vec3::x(), &rows, &moved, 1e3, start)).into();
        let [cold, warm] = [cold, warm].map(|vertex: Option<Vertex>| vertex.expect("bounded").q);
        assert!((cold - warm).norm() < 1e-12, "{cold} {warm}");
    }

    /// A shallow hill is touched exactly under the middle, where the program is dual degenerate: without the
    /// perturbation it cycles.
    #[test]
    fn a_shallow_hill_has_a_minimum() {
        let mut random = fastrand::Rng::with_seed(64);
        for round in 0..200 {
            let waves: Vec<[f64; 4]> = (0..3).map(|_| std::array::from_fn(|_| random.f64())).collect();
            let wave = |[a, b, c, size]: &[f64; 4], x: f64, y: f64| {
                1e-5 * size * (4.0 * (a * x + b * y) + 6.0 * c).sin()
            };
            let height = |x: f64, y: f64| {
                1.0 - 0.02 * (x * x + y * y) + waves.iter().map(|it| wave(it, x, y)).sum::<f64>()
            };
            let (rows, d) = over_grid(101, height);
            let vertex = minimum(Vec3::x(), &rows, &d, 8e3, None);
            assert!(vertex.is_some_and(|it| (it.q.x - 1.0).abs() < 5e-5), "{round}: {vertex:?}");
        }
    }

    #[test]
    fn places_on_one_side_of_the_middle_hold_nothing() {
        let (rows, d) = over_grid(5, |_, _| 0.0);
        let (rows, d): (Vec<Vec3>, Vec<f64>) = rows.into_iter().zip(d).filter(|(r, _)| r.y > 0.1).unzip();
        assert_eq!(minimum(Vec3::x(), &rows, &d, 1e3, None), None);
    }
}
