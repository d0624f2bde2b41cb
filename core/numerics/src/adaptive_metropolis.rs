//! Mean and covariance of an unnormalised log density by robust adaptive Metropolis.
//!
//! The method is a random walk whose proposal covariance is adapted until the acceptance rate is optimal. In: the log
//! density as a function. Out: mean and covariance. Limit: a few dimensions. The chain starts at the origin and its
//! length is fixed, so that a seed always gives the same moments.
//!
//! Source: Vihola, Stat. Comput. 22 (2012), 997-1008, section 2.

use nalgebra::{Cholesky, SMatrix, SVector};

use crate::random::Random;

/// Acceptance rate of the fastest mixing (Roberts, Gelman and Gilks, Ann. Appl. Probab. 7 (1997)).
const ACCEPTANCE: f64 = 0.234;

/// Number of steps that only adapt the chain, and of steps that count. Means scatter between chains by a tenth of their
/// standard deviation; with two fifths of the steps some chains do not mix.
const BURN_IN: u32 = 2000;
const STEPS: u32 = 10_000;

/// Returns mean and covariance of the density exp(`log_density`), up to a constant factor.
///
/// `first_step` contains the standard deviations of the first proposals.
pub fn mean_and_covariance<const D: usize>(
    first_step: SVector<f64, D>,
    seed: u64,
    log_density: impl Fn(&SVector<f64, D>) -> f64,
) -> (SVector<f64, D>, SMatrix<f64, D, D>) {
    let mut random = Random::new(seed);
    let mut factor = SMatrix::from_diagonal(&first_step);
    let mut at = SVector::zeros();
    let mut here = log_density(&at);
    let (mut sum, mut squares) = (SVector::zeros(), SMatrix::zeros());
    for step in 1..=BURN_IN + STEPS {
        let direction = SVector::from_fn(|_, _| random.normal());
        let proposal = at + factor * direction;
        let there = log_density(&proposal);
        let probability = (there - here).exp().min(1.0);
        if random.above_zero() <= probability {
            (at, here) = (proposal, there);
        }
        let by = (probability - ACCEPTANCE) * f64::from(step).powf(-2.0 / 3.0) * D as f64;
        factor = adapted(&factor, &direction, by);
        if step > BURN_IN {
            sum += at;
            squares += at * at.transpose();
        }
    }
    let mean = sum / f64::from(STEPS);
    (mean, squares / f64::from(STEPS) - mean * mean.transpose())
}

/// Returns the Cholesky factor of the proposal covariance after a rank-one update along the last direction: S (I + by d
/// d' / |d|^2) S'.
fn adapted<const D: usize>(
    factor: &SMatrix<f64, D, D>,
    direction: &SVector<f64, D>,
    by: f64,
) -> SMatrix<f64, D, D> {
    let along = factor * direction / direction.norm();
    let square = factor * factor.transpose() + along * along.transpose() * by.clamp(-0.9, 1.0);
    Cholesky::new(square).map_or(*factor, |factor| factor.l())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};

    const SEED: u64 = 0x706c_6174_656c;

    #[test]
    fn a_tilted_normal_distribution_and_a_box() {
        let covariance = Matrix2::new(4.0, 1.9, 1.9, 1.0) * 1e-6;
        let precision = covariance.try_inverse().unwrap();
        let centre = Vector2::new(3e-3, -1e-3);
        let normal = |x: &Vector2<f64>| -0.5 * (x - centre).dot(&(precision * (x - centre)));
        let (mean, found) = mean_and_covariance(Vector2::repeat(1e-3), SEED, normal);
        println!("{mean} {found}");
        assert!((mean - centre).amax() < 4e-4 && (found - covariance).amax() < 6e-7);
        let within = |x: &Vector2<f64>| if x.x.abs() < 1.0 && (x.y - 5.0).abs() < 5.0 { 0.0 } else { -50.0 };
        let (mean, found) = mean_and_covariance(Vector2::repeat(0.1), SEED, within);
        println!("{mean} {found}");
        assert!(mean.x.abs() < 0.1 && (mean.y - 5.0).abs() < 0.5);
        assert!((found[(0, 0)] - 1.0 / 3.0).abs() < 0.04 && (found[(1, 1)] - 25.0 / 3.0).abs() < 1.0);
    }
}
