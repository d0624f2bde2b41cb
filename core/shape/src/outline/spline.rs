//! Penalised cubic splines of one variable.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::surface::Axis;

/// A cubic spline over an axis.
#[derive(Debug, Clone)]
pub(super) struct Spline {
    axis: Axis,
    coefficients: DVector<f64>,
}

impl Spline {
    pub(super) fn new(axis: Axis, coefficients: DVector<f64>) -> Self {
        Self { axis, coefficients }
    }

    /// A spline over the same axis.
    pub(super) fn with(&self, coefficients: DVector<f64>) -> Self {
        Self { axis: self.axis, coefficients }
    }

    /// The spline with its coefficients moved.
    pub(super) fn moved(&self, by: &DVector<f64>) -> Self {
        self.with(&self.coefficients + by)
    }

    /// The value at `x` as a linear functional of the coefficients.
    pub(super) fn functional(&self, x: f64) -> DVector<f64> {
        let (first, values) = self.axis.values(x);
        let mut functional = DVector::zeros(self.axis.n_coefficients());
        for i in 0..4 {
            functional[first + i] = values[i];
        }
        functional
    }

    pub(super) fn at(&self, x: f64) -> f64 {
        let (first, values) = self.axis.values(x);
        (0..4).map(|i| values[i] * self.coefficients[first + i]).sum()
    }

    /// An upper bound of the distance from a spline over the same axis: the largest between their coefficients.
    pub(super) fn distance(&self, other: &Self) -> f64 {
        (&self.coefficients - &other.coefficients).amax()
    }
}

/// Normal equations of a spline: sums over data, and what is known of the curve before any.
#[derive(Debug, Clone)]
pub(super) struct Normal {
    axis: Axis,
    matrix: DMatrix<f64>,
    right: DVector<f64>,
}

/// A difference of neighbouring coefficients that estimates a derivative.
#[derive(Debug, Clone, Copy)]
pub(super) enum Roughness {
    /// Second derivative.
    Curvature,
    /// Third derivative.
    CurvatureChange,
}

impl Normal {
    /// Without data: a derivative that varies as white noise over `length` with the standard deviation `spread`.
    pub(super) fn with_prior(axis: Axis, roughness: Roughness, spread: f64, length: f64) -> Self {
        let n = axis.n_coefficients();
        let mut matrix = DMatrix::zeros(n, n);
        let (stencil, order): (&[f64], i32) = match roughness {
            Roughness::Curvature => (&[1.0, -2.0, 1.0], 2),
            Roughness::CurvatureChange => (&[-1.0, 3.0, -3.0, 1.0], 3),
        };
        let scale = axis.step() / (length * spread * spread) * axis.step().powi(-2 * order);
        for start in 0..=n - stencil.len() {
            for (i, a) in stencil.iter().enumerate() {
                for (j, b) in stencil.iter().enumerate() {
                    matrix[(start + i, start + j)] += scale * a * b;
                }
            }
        }
        Self { axis, matrix, right: DVector::zeros(n) }
    }

    /// Adds a value `y` at `x` with the weight `w` (one over its variance).
    pub(super) fn add(&mut self, x: f64, y: f64, w: f64) {
        let (first, values) = self.axis.values(x);
        for i in 0..4 {
            // The factorisation reads the lower triangle.
            for j in 0..=i {
                self.matrix[(first + i, first + j)] += w * values[i] * values[j];
            }
            self.right[first + i] += w * values[i] * y;
        }
    }

    /// Half the square of a spline's distance from what is known, in standard deviations, without data.
    pub(super) fn roughness(&self, spline: &Spline) -> f64 {
        0.5 * spline.coefficients.dot(&(&self.matrix * &spline.coefficients))
    }

    /// Adds the value 0 of a functional with the weight `w` (one over its variance).
    pub(super) fn hold(&mut self, functional: &DVector<f64>, w: f64) {
        self.matrix += functional * functional.transpose() * w;
    }

    /// The spline, and the factor of its precision. `None` when the data leave it open.
    pub(super) fn solve(self) -> Option<(Spline, Cholesky<f64, Dyn>)> {
        let factor = Cholesky::new(self.matrix)?;
        let coefficients = factor.solve(&self.right);
        Some((Spline::new(self.axis, coefficients), factor))
    }
}
