//! Non-negative least squares on normal equations, by an active-set method.
//!
//! Source: Lawson and Hanson, "Solving Least Squares Problems", 1974, chapter 23; on the normal equations as Bro and de
//! Jong, "A fast non-negativity-constrained least squares algorithm", J. Chemometrics 11, 1997.

use nalgebra::{DMatrix, DVector};

/// Ridge in parts of the mean diagonal: neighbouring columns are nearly equal.
const RIDGE: f64 = 1e-9;

/// Returns the x >= 0 that minimises x' G x / 2 - c' x over the columns `of`, in their order.
pub(crate) fn solve(gram: &DMatrix<f64>, right: &DVector<f64>, of: &[usize]) -> Vec<f64> {
    let n = of.len();
    let ridge = RIDGE * of.iter().map(|&i| gram[(i, i)]).sum::<f64>() / n.max(1) as f64;
    let scale = of.iter().map(|&i| right[i].abs()).fold(0.0, f64::max);
    let mut x = vec![0.0; n];
    let mut passive: Vec<usize> = Vec::new();
    // Each round adds a column. Cycling is impossible in exact arithmetic; the bound covers rounding.
    for _ in 0..4 * n {
        let gradient = |k: usize| {
            let taken: f64 = passive.iter().map(|&j| gram[(of[k], of[j])] * x[j]).sum();
            right[of[k]] - taken
        };
        let steepest = (0..n).filter(|k| !passive.contains(k)).map(|k| (gradient(k), k));
        let Some((slope, add)) = steepest.reduce(|a, b| if b.0 > a.0 { b } else { a }) else { break };
        if slope <= 1e-10 * scale {
            break;
        }
        passive.push(add);
        loop {
            let Some(free) = least_squares(gram, right, of, &passive, ridge) else { return x };
            let blocked = passive.iter().zip(&free).filter(|(_, value)| **value <= 0.0);
            let share = blocked.map(|(&k, value)| x[k] / (x[k] - value)).fold(1.0, f64::min);
            for (&k, value) in passive.iter().zip(&free) {
                x[k] += share * (value - x[k]);
            }
            if share >= 1.0 {
                break;
            }
            passive.retain(|&k| x[k] > 1e-15);
            for (k, value) in x.iter_mut().enumerate() {
                if !passive.contains(&k) {
                    *value = 0.0;
                }
            }
            if passive.is_empty() {
                break;
            }
        }
    }
    x
}

/// Returns the unconstrained solution over the passive columns.
fn least_squares(
    gram: &DMatrix<f64>,
    right: &DVector<f64>,
    of: &[usize],
    passive: &[usize],
    ridge: f64,
) -> Option<Vec<f64>> {
    let n = passive.len();
    let normal = DMatrix::from_fn(n, n, |i, j| {
        gram[(of[passive[i]], of[passive[j]])] + if i == j { ridge } else { 0.0 }
    });
    let right = DVector::from_fn(n, |i, _| right[of[passive[i]]]);
    normal.cholesky().map(|factor| factor.solve(&right).iter().copied().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Karush-Kuhn-Tucker conditions: no gradient points into the feasible side, and it vanishes where x > 0.
    #[test]
    fn the_solution_is_optimal() {
        let mut random = fastrand::Rng::with_seed(3);
        for round in 0..200 {
            let (rows, columns) = (30, 12);
            let a = DMatrix::from_fn(rows, columns, |_, _| random.f64() - 0.3);
            let b = DVector::from_fn(rows, |_, _| random.f64() - 0.5);
            let (gram, right) = (a.tr_mul(&a), a.tr_mul(&b));
            let of: Vec<usize> = (0..columns).collect();
            let x = DVector::from_vec(solve(&gram, &right, &of));
            let gradient = &right - &gram * &x;
            for k in 0..columns {
                assert!(x[k] >= 0.0, "round {round}");
                assert!(gradient[k] < 1e-6, "round {round}: {}", gradient[k]);
                assert!(x[k] == 0.0 || gradient[k].abs() < 1e-6, "round {round}: {} {}", x[k], gradient[k]);
            }
        }
    }

    #[test]
    fn a_subset_leaves_the_other_columns_alone() {
        let gram = DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, 2.0, 4.0]));
        let right = DVector::from_vec(vec![1.0, -1.0, 2.0]);
        assert_eq!(solve(&gram, &right, &[2, 1]).len(), 2);
        assert!((solve(&gram, &right, &[2])[0] - 0.5).abs() < 1e-8);
    }
}
