//! Smoothing curves: cubic splines of one variable by penalised least squares (P-splines).
//!
//! The penalty is a Gaussian prior on the coefficients. In: weighted values. Out: the most likely spline and the
//! Cholesky factor of its precision. Source: Eilers and Marx, Stat. Sci. 11 (1996).

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::uniform_knots::UniformKnots;

/// A cubic spline of one variable.
#[derive(Debug, Clone)]
pub struct SplineCurve {
    knots: UniformKnots,
    coefficients: DVector<f64>,
}

impl SplineCurve {
    /// Builds the spline of `knots.n_coefficients()` coefficients.
    #[must_use]
    pub fn new(knots: UniformKnots, coefficients: DVector<f64>) -> Self {
        Self { knots, coefficients }
    }

    /// Returns a spline over the same knots.
    #[must_use]
    pub fn with(&self, coefficients: DVector<f64>) -> Self {
        Self { knots: self.knots, coefficients }
    }

    /// Returns the spline with its coefficients moved.
    #[must_use]
    pub fn moved(&self, by: &DVector<f64>) -> Self {
        self.with(&self.coefficients + by)
    }

    /// Returns the number of coefficients.
    #[must_use]
    pub fn n_coefficients(&self) -> usize {
        self.coefficients.len()
    }

    /// Returns the value at `x` as a linear functional of the coefficients.
    #[must_use]
    pub fn functional(&self, x: f64) -> DVector<f64> {
        let (first, values) = self.knots.values(x);
        let mut functional = DVector::zeros(self.knots.n_coefficients());
        for i in 0..4 {
            functional[first + i] = values[i];
        }
        functional
    }

    /// Returns the value at `x`.
    #[inline]
    #[must_use]
    pub fn at(&self, x: f64) -> f64 {
        let (first, values) = self.knots.values(x);
        (0..4).map(|i| values[i] * self.coefficients[first + i]).sum()
    }

    /// Returns an upper bound of the distance from a spline over the same knots: the largest between their
    /// coefficients.
    #[must_use]
    pub fn distance(&self, other: &Self) -> f64 {
        (&self.coefficients - &other.coefficients).amax()
    }
}

/// Normal equations of a smoothing curve: sums over data, and a Gaussian prior of its roughness. Further parameters
/// that enter observations linearly in addition to the curve follow its coefficients.
#[derive(Debug, Clone)]
pub struct CurveFit {
    knots: UniformKnots,
    matrix: DMatrix<f64>,
    right: DVector<f64>,
}

/// Derivative that the prior penalises, as a difference of neighbouring coefficients.
#[derive(Debug, Clone, Copy)]
pub enum Roughness {
    /// Second derivative.
    Curvature,
    /// Third derivative.
    CurvatureChange,
}

/// Second difference of neighbouring coefficients.
const SECOND_DIFFERENCE: [f64; 3] = [1.0, -2.0, 1.0];

impl CurveFit {
    /// Builds the equations without data: the derivative varies as white noise over `length` with the standard
    /// deviation `spread`.
    #[must_use]
    pub fn with_prior(knots: UniformKnots, roughness: Roughness, spread: f64, length: f64) -> Self {
        let n = knots.n_coefficients();
        let mut matrix = DMatrix::zeros(n, n);
        let (stencil, order): (&[f64], i32) = match roughness {
            Roughness::Curvature => (&SECOND_DIFFERENCE, 2),
            Roughness::CurvatureChange => (&[-1.0, 3.0, -3.0, 1.0], 3),
        };
        let scale = knots.step() / (length * spread * spread) * knots.step().powi(-2 * order);
        for start in 0..=n - stencil.len() {
            for (i, a) in stencil.iter().enumerate() {
                for (j, b) in stencil.iter().enumerate() {
                    matrix[(start + i, start + j)] += scale * a * b;
                }
            }
        }
        Self { knots, matrix, right: DVector::zeros(n) }
    }

    /// Adds an unknown amplitude times `profile` to the curvature of the prior, before any data are added. The amplitude is
    /// given by its mean and standard deviation.
    #[must_use]
    pub fn with_curvature(mut self, profile: impl Fn(f64) -> f64, [mean, amplitude]: [f64; 2]) -> Self {
        let step = self.knots.step();
        // Coefficients d with this curvature: their second differences are step^2 f with the profile f at the knots.
        let mut curved = DVector::zeros(self.knots.n_coefficients());
        for k in 0..=self.knots.n_spans() {
            let curvature = profile(self.knots.start() + k as f64 * step);
            curved[k + 2] = 2.0 * curved[k + 1] - curved[k] + step * step * curvature;
        }
        // The covariance P^-1 grows by a^2 d d^T, the mean by m d: P becomes P - (a^2 / t) P d (P d)^T with
        // t = 1 + a^2 d^T P d (Sherman-Morrison formula).
        let weighted = &self.matrix * &curved;
        let variance = amplitude * amplitude;
        let total = 1.0 + variance * curved.dot(&weighted);
        self.right += &weighted * ((mean - variance * curved.dot(&self.right)) / total);
        self.hold(&weighted, -variance / total);
        self
    }

    /// Appends one parameter for each normal prior, given by mean and standard deviation.
    #[must_use]
    pub fn with_parameters(mut self, priors: &[(f64, f64)]) -> Self {
        let from = self.right.len();
        let n = from + priors.len();
        self.matrix = self.matrix.resize(n, n, 0.0);
        self.right = self.right.resize_vertically(n, 0.0);
        for (k, (mean, spread)) in (from..).zip(priors) {
            let weight = spread.powi(-2);
            self.matrix[(k, k)] = weight;
            self.right[k] = weight * mean;
        }
        self
    }

    /// Adds a value `y` at `x` of the curve plus `factor` times the parameter of a number, with the weight `w`.
    pub fn add_with(&mut self, x: f64, y: f64, w: f64, (number, factor): (usize, f64)) {
        self.add(x, y, w);
        let (first, values) = self.knots.values(x);
        let at = self.knots.n_coefficients() + number;
        for (i, value) in values.iter().enumerate() {
            self.matrix[(at, first + i)] += w * factor * value;
        }
        self.matrix[(at, at)] += w * factor * factor;
        self.right[at] += w * factor * y;
    }

    /// Adds a value `y` at `x` with the weight `w` (one over its variance).
    pub fn add(&mut self, x: f64, y: f64, w: f64) {
        let (first, values) = self.knots.values(x);
        for i in 0..4 {
            // The factorisation reads the lower triangle.
            for j in 0..=i {
                self.matrix[(first + i, first + j)] += w * values[i] * values[j];
            }
            self.right[first + i] += w * values[i] * y;
        }
    }

    /// Returns the negative log density of a curve under the prior, up to a constant, before any data were added.
    #[must_use]
    pub fn roughness(&self, spline: &SplineCurve) -> f64 {
        let coefficients = &spline.coefficients;
        0.5 * coefficients.dot(&(&self.matrix * coefficients)) - self.right.dot(coefficients)
    }

    /// Adds the observation 0 of a functional with the weight `w` (one over its variance).
    pub fn hold(&mut self, functional: &DVector<f64>, w: f64) {
        self.matrix += functional * functional.transpose() * w;
    }

    /// Solves for the most likely curve. Also returns the Cholesky factor of its precision. `None` when the curve is
    /// undetermined.
    #[must_use]
    pub fn solve(self) -> Option<(SplineCurve, Cholesky<f64, Dyn>)> {
        let (curve, _, factor) = self.solve_with_parameters()?;
        Some((curve, factor))
    }

    /// Solves for the most likely curve and parameters. Also returns the Cholesky factor of the precision of both, with
    /// the curve's coefficients first.
    #[must_use]
    pub fn solve_with_parameters(self) -> Option<(SplineCurve, DVector<f64>, Cholesky<f64, Dyn>)> {
        let factor = Cholesky::new(self.matrix)?;
        let solution = factor.solve(&self.right);
        let n = self.knots.n_coefficients();
        let (curve, parameters) =
            (solution.rows(0, n).into_owned(), solution.rows(n, solution.len() - n).into_owned());
        Some((SplineCurve::new(self.knots, curve), parameters, factor))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of a parabola on its first half. With a constant curvature in the prior the curve follows the parabola
    /// beyond them, without one it goes on nearly straight.
    #[test]
    fn a_constant_curvature_goes_on_beyond_the_values() {
        const CURVATURE: f64 = 0.01;
        let knots = UniformKnots::new(0.0, 3.0, 12);
        let parabola = |x: f64| 0.5 * CURVATURE * x * x;
        let end = |constant: [f64; 2]| {
            let prior = CurveFit::with_prior(knots, Roughness::Curvature, 0.003, 0.3);
            let mut fit = prior.with_curvature(|_| 1.0, constant);
            (0..=150).map(|k| 0.01 * f64::from(k)).for_each(|x| fit.add(x, parabola(x), 1e10));
            let (curve, precision) = fit.solve().unwrap();
            let functional = curve.functional(3.0);
            (curve.at(3.0) - parabola(3.0), functional.dot(&precision.solve(&functional)).sqrt())
        };
        let (straight, seen, known) = (end([0.0, 0.0]), end([0.0, 0.02]), end([CURVATURE, 0.0]));
        assert!((-12e-3..-8e-3).contains(&straight.0), "{straight:?}");
        assert!(seen.0.abs() < 4e-4 && (1.5e-3..3e-3).contains(&seen.1), "{seen:?}");
        assert!(known.0.abs() < 1e-9 && (known.1 - straight.1).abs() < 1e-9, "{known:?}");
    }

    /// Two values on a line: the rest follows from the prior, a cubic of the mean amplitude and its standard deviation.
    #[test]
    fn without_values_the_curvature_is_that_of_the_prior() {
        let knots = UniformKnots::new(0.0, 3.0, 12);
        let prior = CurveFit::with_prior(knots, Roughness::Curvature, 0.0003, 0.3);
        let mut fit = prior.with_curvature(|x| 6.0 * x, [0.01, 0.02]);
        [0.0, 1.0].iter().for_each(|x| fit.add(*x, 0.0, 1e10));
        let (curve, precision) = fit.solve().unwrap();
        let functional = curve.functional(2.0);
        // x^3 - x = 6 at 2.
        assert!((curve.at(2.0) - 0.06).abs() < 1e-5, "{}", curve.at(2.0));
        let sigma = functional.dot(&precision.solve(&functional)).sqrt();
        assert!((sigma - 0.12).abs() < 1e-4, "{sigma}");
    }

    /// Values of a parabola, every other one off by three times a parameter: both are found, and the parameter has a
    /// high precision.
    #[test]
    fn a_shared_parameter_is_found_together_with_the_curve() {
        const OFF: f64 = 0.7;
        let knots = UniformKnots::new(0.0, 2.0, 8);
        let mut fit =
            CurveFit::with_prior(knots, Roughness::Curvature, 1e3, 1.0).with_parameters(&[(0.1, 10.0); 2]);
        for k in 0..=100 {
            let x = 0.02 * f64::from(k);
            if k % 2 == 0 {
                fit.add(x, x * x, 1e4);
            } else {
                fit.add_with(x, x * x + 3.0 * OFF, 1e4, (1, 3.0));
            }
        }
        let (curve, parameters, precision) = fit.solve_with_parameters().unwrap();
        assert!((curve.at(1.3) - 1.69).abs() < 1e-4, "{}", curve.at(1.3));
        assert!((parameters[1] - OFF).abs() < 1e-4 && (parameters[0] - 0.1).abs() < 1e-9, "{parameters}");
        let variance = precision.inverse().diagonal();
        let at = curve.n_coefficients();
        assert!((variance[at] - 100.0).abs() < 1e-6 && variance[at + 1].sqrt() < 1e-3, "{variance}");
    }
}
