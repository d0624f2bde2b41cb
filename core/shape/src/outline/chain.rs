//! Mean and covariance of a distribution of a few dimensions of which only the logarithm is known.

use nalgebra::{Cholesky, SMatrix, SVector};

use super::random::Random;

/// Part of the steps that are taken: the best in a few dimensions (Roberts, Gelman and Gilks, Ann. Appl. Probab. 7 (1997)).
const TAKEN: f64 = 0.234;

/// Steps of a chain while it finds its stride, and then. Places of an edge scatter by a tenth of their standard
/// deviation between chains; with two fifths of the steps some are stuck.
const STRIDE: u32 = 2000;
const STEPS: u32 = 10_000;

/// Mean and covariance by a Metropolis chain from the origin, whose steps learn their shape (robust adaptive
/// Metropolis: Vihola, Stat. Comput. 22 (2012), 997-1008, section 2). `step` is about the size of the first ones.
pub(super) fn moments<const D: usize>(
    step: SVector<f64, D>,
    logarithm: impl Fn(&SVector<f64, D>) -> f64,
) -> (SVector<f64, D>, SMatrix<f64, D, D>) {
    let mut random = Random::new(D as u64);
    let mut stride = SMatrix::from_diagonal(&step);
    let mut at = SVector::zeros();
    let mut here = logarithm(&at);
    let (mut sum, mut squares) = (SVector::zeros(), SMatrix::zeros());
    for round in 1..=STRIDE + STEPS {
        let direction = SVector::from_fn(|_, _| random.normal());
        let next = at + stride * direction;
        let there = logarithm(&next);
        let chance = (there - here).exp().min(1.0);
        if random.uniform() <= chance {
            (at, here) = (next, there);
        }
        let by = (chance - TAKEN) * f64::from(round).powf(-2.0 / 3.0) * D as f64;
        stride = lengthened(&stride, &direction, by);
        if round > STRIDE {
            sum += at;
            squares += at * at.transpose();
        }
    }
    let mean = sum / f64::from(STEPS);
    (mean, squares / f64::from(STEPS) - mean * mean.transpose())
}

/// The factor of steps that are longer along one that was too often taken.
fn lengthened<const D: usize>(
    stride: &SMatrix<f64, D, D>,
    direction: &SVector<f64, D>,
    by: f64,
) -> SMatrix<f64, D, D> {
    let along = stride * direction / direction.norm();
    let square = stride * stride.transpose() + along * along.transpose() * by.clamp(-0.9, 1.0);
    Cholesky::new(square).map_or(*stride, |factor| factor.l())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};

    #[test]
    fn a_tilted_normal_distribution_and_a_box() {
        let covariance = Matrix2::new(4.0, 1.9, 1.9, 1.0) * 1e-6;
        let precision = covariance.try_inverse().unwrap();
        let centre = Vector2::new(3e-3, -1e-3);
        let normal = |x: &Vector2<f64>| -0.5 * (x - centre).dot(&(precision * (x - centre)));
        let (mean, found) = moments(Vector2::repeat(1e-3), normal);
        println!("{mean} {found}");
        assert!((mean - centre).amax() < 4e-4 && (found - covariance).amax() < 6e-7);
        let within = |x: &Vector2<f64>| if x.x.abs() < 1.0 && (x.y - 5.0).abs() < 5.0 { 0.0 } else { -50.0 };
        let (mean, found) = moments(Vector2::repeat(0.1), within);
        println!("{mean} {found}");
        assert!(mean.x.abs() < 0.1 && (mean.y - 5.0).abs() < 0.5);
        assert!((found[(0, 0)] - 1.0 / 3.0).abs() < 0.04 && (found[(1, 1)] - 25.0 / 3.0).abs() < 1.0);
    }
}
