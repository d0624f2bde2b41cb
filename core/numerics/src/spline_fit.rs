//! Penalised weighted least squares of a bicubic spline S on scattered points.
//!
//! The fit minimises sum w |y - S|^2 + m_u int |S_uuu|^2 + m_v int |S_vvv|^2. In: points with weights. Out:
//! [`FittedSpline`], with the precision of its coefficients.

use crate::block_banded::BlockBandedFactor;
use crate::normal_equations::CellMoments;
use crate::reml::{Penalty, SelectedPenalty};
use crate::tensor_spline::TensorSpline;
use crate::uniform_knots::UniformKnots;

/// Least number of spans of a coarsened spline.
const LEAST_SPANS: usize = 8;

/// Sums over the points of a fit of `D` components over two axes.
#[derive(Debug, Clone)]
pub struct SplineFit<const D: usize> {
    moments: CellMoments<D>,
}

/// A fitted spline with the precision of its coefficients.
#[derive(Debug, Clone, PartialEq)]
pub struct FittedSpline<const D: usize> {
    /// The spline.
    pub spline: TensorSpline<D>,
    /// Cholesky factor of the coefficients' precision, the same for every component.
    pub precision: BlockBandedFactor,
    /// Share of the covariance that is scatter of the points, mean over the axes' rectangle: the part that remains when
    /// two fits to the same shape are compared. The rest is the error due to the penalty, which is the same in both
    /// fits. 1 under a given penalty.
    pub noise_share: f64,
    /// Weighted sum of squared residuals over the points and components.
    pub residual_square: f64,
    /// Sum of the weights.
    pub weight: f64,
    /// Number of points with a positive weight.
    pub n_points: usize,
}

/// Error: the points do not determine the spline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{n_points} points do not determine the surface")]
pub struct Undetermined {
    /// Number of points that were given.
    pub n_points: usize,
}

impl<const D: usize> FittedSpline<D> {
    /// Returns the variances of `N` weighted sums of values of the spline, for points whose weights are one over their
    /// variance. Each term is a place (u, v) and its weight in every sum.
    #[must_use]
    pub fn variances<const N: usize>(&self, terms: impl Iterator<Item = ([f64; 2], [f64; N])>) -> [f64; N] {
        let n_u = self.spline.u.n_coefficients();
        let mut functionals = vec![[0.0; N]; n_u * self.spline.v.n_coefficients()];
        for ([u, v], weights) in terms {
            let (su, sv) = (self.spline.u.local_basis(u), self.spline.v.local_basis(v));
            for (k, by_v) in sv.value.iter().enumerate() {
                let row = (sv.first + k) * n_u + su.first;
                for (functional, by_u) in functionals[row..row + 4].iter_mut().zip(&su.value) {
                    functional
                        .iter_mut()
                        .zip(&weights)
                        .for_each(|(sum, weight)| *sum += weight * by_u * by_v);
                }
            }
        }
        let mut solved = functionals.clone();
        self.precision.solve(&mut solved);
        std::array::from_fn(|sum| {
            let products = functionals.iter().zip(&solved).map(|(one, other)| one[sum] * other[sum]);
            products.sum::<f64>().max(0.0)
        })
    }
}

impl<const D: usize> SplineFit<D> {
    /// Starts a fit over two axes.
    #[must_use]
    pub fn new(u: UniformKnots, v: UniformKnots) -> Self {
        Self { moments: CellMoments::empty(u, v) }
    }

    /// Adds the point `y` at (u, v) with weight `w`, one over its variance. Points slightly outside are assigned to the
    /// outermost span.
    #[inline(always)]
    pub fn add(&mut self, u: f64, v: f64, y: [f64; D], w: f64) {
        self.moments.add(u, v, y, w);
    }

    /// Solves with the penalty selected by REML from the component along `direction`.
    ///
    /// Along an axis where the penalty smooths over many spans, and their number is even, the spline gets spans of
    /// twice the length: the same surface at a fraction of the cost, which grows with the fourth power of the number of
    /// spans.
    ///
    /// # Errors
    /// [`Undetermined`] when there are too few points, or all in one place.
    pub fn solve(&self, direction: [f64; D]) -> Result<FittedSpline<D>, Undetermined> {
        let SelectedPenalty { penalty, noise_share, coarse } = self.select_penalty(direction);
        let fitted = match self.coarser(coarse) {
            Some(fit) => fit.solve_with(penalty)?,
            None => self.solve_with(penalty)?,
        };
        Ok(FittedSpline { noise_share, ..fitted })
    }

    /// Returns the fit with spans of twice the length along those of (u, v) that are `wanted` and have at least twice
    /// the least number of spans; `None` when there is no such axis.
    fn coarser(&self, wanted: [bool; 2]) -> Option<Self> {
        let can = |axis: &UniformKnots| axis.n_spans().is_multiple_of(2) && axis.n_spans() >= 2 * LEAST_SPANS;
        let coarser = [wanted[0] && can(&self.moments.u), wanted[1] && can(&self.moments.v)];
        coarser.contains(&true).then(|| Self { moments: self.moments.joined(coarser) })
    }

    /// Selects the penalty by REML from the component along `direction`.
    #[must_use]
    pub fn select_penalty(&self, direction: [f64; D]) -> SelectedPenalty {
        self.moments.grid_values(direction).select_penalty()
    }

    /// Solves with the given penalty.
    ///
    /// # Errors
    /// [`Undetermined`].
    pub fn solve_with(&self, penalty: Penalty) -> Result<FittedSpline<D>, Undetermined> {
        let CellMoments { u, v, n_points, .. } = self.moments;
        let (mut matrix, mut control) = self.moments.normal_equations();
        matrix.add_kronecker(&u.roughness(), &v.gram(), penalty.u);
        matrix.add_kronecker(&u.gram(), &v.roughness(), penalty.v);
        let precision = matrix.factor().map_err(|_| Undetermined { n_points })?;
        precision.solve(&mut control);
        let spline = TensorSpline { u, v, control };
        let residual_square = self.moments.residual_square(&spline);
        Ok(FittedSpline {
            spline,
            precision,
            noise_share: 1.0,
            residual_square,
            weight: self.moments.weight,
            n_points,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Fits scattered points of f with noise sigma on n x m spans.
    fn fit(n_points: usize, spans: [usize; 2], sigma: f64, f: impl Fn(f64, f64) -> f64) -> FittedSpline<1> {
        let mut noise = Random::new(7);
        let mut fit =
            SplineFit::new(UniformKnots::new(0.0, 3.0, spans[0]), UniformKnots::new(0.0, 2.0, spans[1]));
        for _ in 0..n_points {
            let (u, v) = (3.0 * noise.unit(), 2.0 * noise.unit());
            fit.add(u, v, [f(u, v) + sigma * noise.normal()], sigma.max(1e-6).powi(-2));
        }
        fit.solve([1.0]).expect("determined")
    }

    fn rms(spline: &TensorSpline<1>, f: impl Fn(f64, f64) -> f64) -> f64 {
        let n = 41;
        let sum: f64 = (0..n * n)
            .map(|k| (3.0 * (k % n) as f64 / (n - 1) as f64, 2.0 * (k / n) as f64 / (n - 1) as f64))
            .map(|(u, v)| (spline.point(u, v)[0] - f(u, v)).powi(2))
            .sum();
        (sum / (n * n) as f64).sqrt()
    }

    #[test]
    fn a_quadratic_is_smoothed_without_bias() {
        let f = |u: f64, v: f64| 0.1 * u * u - 0.05 * u * v + 0.02 * v * v + 0.3;
        let fitted = fit(20_000, [40, 28], 5e-4, f);
        // Nine free coefficients from 20,000 points: 0.5 mm / sqrt(20,000 / 9) = 0.011 mm.
        let error = rms(&fitted.spline, f);
        assert!(error < 2.5e-5, "rms error {error}");
        let per_point = fitted.residual_square / fitted.n_points as f64;
        assert!((per_point - 1.0).abs() < 0.05, "{per_point}");
    }

    #[test]
    fn a_narrow_bend_is_kept() {
        // A bend of 0.15 1/m over 0.3 m, flat on both sides: its slope grows by 0.0225 rad.
        let bend = |u: f64| {
            let x = ((u - 1.5) / 0.3 + 0.5).clamp(0.0, 1.0);
            let pi = std::f64::consts::PI;
            // Twice integrated 0.15 (1 - cos 2 pi x) / 2 over x.
            let inside = 0.15 * 0.5 * 0.09 * (0.5 * x * x - (1.0 - (2.0 * pi * x).cos()) / (4.0 * pi * pi));
            inside + 0.15 * 0.5 * 0.3 * (u - 1.65).max(0.0)
        };
        let fitted = fit(120_000, [48, 32], 5e-4, |u, _| bend(u));
        assert!(rms(&fitted.spline, |u, _| bend(u)) < 3e-5);
        let peak = fitted.spline.jet(1.5, 1.0).uu[0];
        assert!((peak - 0.15).abs() < 0.01, "peak curvature {peak}");
    }

    #[test]
    fn a_narrow_bend_across_both_axes_is_kept() {
        // The same bend at 35 degrees to u. Neither penalty alone can be small, as it can along an axis: a seventh of
        // the peak is lost, a fifth is allowed.
        let (sin, cos) = 35.0_f64.to_radians().sin_cos();
        let bend = |u: f64, v: f64| {
            let x = (((u - 1.5) * cos + (v - 1.0) * sin) / 0.3 + 0.5).clamp(0.0, 1.0);
            let behind = ((u - 1.5) * cos + (v - 1.0) * sin - 0.15).max(0.0);
            let pi = std::f64::consts::PI;
            0.15 * 0.5 * 0.09 * (0.5 * x * x - (1.0 - (2.0 * pi * x).cos()) / (4.0 * pi * pi))
                + 0.15 * 0.5 * 0.3 * behind
        };
        let fitted = fit(120_000, [48, 32], 5e-4, bend);
        assert!(rms(&fitted.spline, bend) < 4e-5, "{}", rms(&fitted.spline, bend));
        let jet = fitted.spline.jet(1.5, 1.0);
        let peak = cos * cos * jet.uu[0] + 2.0 * cos * sin * jet.uv[0] + sin * sin * jet.vv[0];
        assert!((peak - 0.15).abs() < 0.03, "peak curvature {peak}");
    }

    /// Rows 38 mm apart under spans of 62 mm leave a third of the cells without a value, up to the border. A fill that
    /// does not follow the inclined plate would be taken for shape, with hardly any smoothing: 0.07 mm with a fill by
    /// the neighbours, 0.17 mm with a fill by a quadratic.
    #[test]
    fn an_inclined_cylinder_of_sparse_rows_is_smooth() {
        const SIGMA: f64 = 1e-3;
        let f = |u: f64, v: f64| 0.6 * u + 0.5 * v + 0.05 * u * u + 3.0 * (1.0 - (v / 3.0).cos());
        let mut noise = Random::new(3);
        let mut fit = SplineFit::new(UniformKnots::new(0.0, 3.0, 48), UniformKnots::new(0.0, 2.0, 32));
        for k in 0..(2.0 / 0.038) as usize {
            let v = 0.038 * (k as f64 + 0.5);
            for j in 0..375 {
                let u = 0.008 * (f64::from(j) + 0.5);
                fit.add(u, v, [f(u, v) + SIGMA * noise.normal()], SIGMA.powi(-2));
            }
        }
        let error = rms(&fit.solve([1.0]).expect("determined").spline, f);
        println!("rms error {:.4} mm", 1e3 * error);
        assert!(error < 6e-5, "{error}");
    }

    #[test]
    fn the_stated_deviation_is_the_observed_one() {
        // The scatter of independent repeats at one place is compared with the posterior's figure.
        let f = |u: f64, v: f64| 0.05 * (2.0 * u).sin() + 0.1 * v * v;
        let (mut square, mut stated) = (0.0, 0.0);
        for seed in 0..40 {
            let mut noise = Random::new(1000 + seed);
            let mut fit = SplineFit::new(UniformKnots::new(0.0, 3.0, 20), UniformKnots::new(0.0, 2.0, 14));
            for _ in 0..3000 {
                let (u, v) = (3.0 * noise.unit(), 2.0 * noise.unit());
                fit.add(u, v, [f(u, v) + 1e-3 * noise.normal()], 1e6);
            }
            let fitted = fit.solve([1.0]).expect("determined");
            square += (fitted.spline.point(1.3, 0.8)[0] - f(1.3, 0.8)).powi(2) / 40.0;
            let ((i, bu), (k, bv)) = (fitted.spline.u.values(1.3), fitted.spline.v.values(0.8));
            let mut functional = vec![0.0; fitted.spline.control.len()];
            let n_u = fitted.spline.u.n_coefficients();
            (0..16).for_each(|s| functional[(k + s / 4) * n_u + i + s % 4] = bv[s / 4] * bu[s % 4]);
            stated += fitted.precision.variance(&functional) / 40.0;
        }
        let ratio = (square / stated).sqrt();
        assert!((0.6..1.4).contains(&ratio), "observed over stated deviation {ratio}");
    }

    #[test]
    fn coarser_spans_hold_the_same_points() {
        let mut noise = Random::new(11);
        let axis = |n_spans: usize| UniformKnots::new(-1.0, 2.0, n_spans);
        let (mut fine, mut coarse) = (SplineFit::new(axis(24), axis(16)), SplineFit::new(axis(12), axis(8)));
        for _ in 0..4000 {
            let (u, v, w) = (3.0 * noise.unit() - 1.0, 3.0 * noise.unit() - 1.0, noise.unit());
            let y = [(3.0 * u).sin() + noise.normal(), v * u];
            fine.add(u, v, y, w);
            coarse.add(u, v, y, w);
        }
        let penalty = Penalty { u: 1e-4, v: 1e-3 };
        let solved = |fit: &SplineFit<2>| fit.solve_with(penalty).expect("determined");
        let (joined, direct) = (solved(&fine.coarser([true; 2]).expect("even")), solved(&coarse));
        let apart = joined
            .spline
            .control
            .iter()
            .flatten()
            .zip(direct.spline.control.iter().flatten())
            .map(|(a, b)| a - b);
        assert!(apart.map(f64::abs).fold(0.0, f64::max) < 1e-10);
        assert!((joined.residual_square / direct.residual_square - 1.0).abs() < 1e-10);
        assert_eq!((joined.n_points, joined.spline.u.n_spans(), joined.spline.v.n_spans()), (4000, 12, 8));
        // Axes that would get fewer than eight spans, or have an odd number, are not changed.
        assert!(fine.coarser([false, false]).is_none() && coarse.coarser([false, true]).is_none());
    }

    #[test]
    fn spans_grow_where_nothing_narrow_is_and_only_there() {
        let bend = |u: f64| 0.5 * 0.3 * (u - 1.5).max(0.0).powi(2);
        let fine = fit(120_000, [48, 32], 5e-4, |u, _| bend(u));
        assert_eq!((fine.spline.u.n_spans(), fine.spline.v.n_spans()), (48, 16));
        let smooth = |u: f64, v: f64| 0.04 * u * u + 0.03 * u * v;
        let coarse = fit(120_000, [48, 32], 5e-4, smooth);
        assert_eq!((coarse.spline.u.n_spans(), coarse.spline.v.n_spans()), (24, 16));
        assert!(rms(&coarse.spline, smooth) < 1e-5);
    }

    #[test]
    fn too_few_points_are_refused() {
        let mut fit = SplineFit::new(UniformKnots::new(0.0, 1.0, 4), UniformKnots::new(0.0, 1.0, 4));
        fit.add(0.5, 0.5, [1.0], 1.0);
        assert_eq!(fit.solve([1.0]).err(), Some(Undetermined { n_points: 1 }));
    }

    #[test]
    fn variances_of_sums_are_those_of_the_inverse() {
        let fitted = fit(4_000, [9, 7], 0.1, |u, v| (2.0 * u).sin() * v);
        let (n_u, places) = (fitted.spline.u.n_coefficients(), [[0.02, 1.97], [1.31, 0.4]]);
        let local = fitted.precision.local_inverse();
        // Values at one place have a covariance within its 16 coefficients.
        let known = places.map(|[u, v]| {
            let (su, sv) = (fitted.spline.u.local_basis(u), fitted.spline.v.local_basis(v));
            let weight = |k: usize| su.value[k % 4] * sv.value[k / 4];
            let covariance = |a: usize, b: usize| {
                let row = &local[(sv.first + a / 4) * n_u + su.first + a % 4];
                row[(b / 4 + 3 - a / 4) * 7 + b % 4 + 3 - a % 4]
            };
            let pairs = (0..256).map(|k| (k / 16, k % 16));
            pairs.map(|(a, b)| weight(a) * weight(b) * covariance(a, b)).sum::<f64>()
        });
        let terms = [(places[0], [1.0, 0.0, 1.0, 1.0]), (places[1], [0.0, 1.0, 1.0, -1.0])];
        let [first, second, sum, difference] = fitted.variances(terms.into_iter());
        assert!((first / known[0] - 1.0).abs() < 1e-9, "{first} {}", known[0]);
        assert!((second / known[1] - 1.0).abs() < 1e-9, "{second} {}", known[1]);
        assert!(((sum + difference) / (2.0 * (first + second)) - 1.0).abs() < 1e-9, "{sum} {difference}");
        assert!(sum != difference);
    }
}
