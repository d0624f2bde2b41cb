//! Mid-surface S(u, v) of the plate: a bicubic spline over the original rectangle with the covariance of its control
//! values.
//!
//! S is fitted by penalised least squares to all samples, moved by half the thickness away from the scanner
//! (`fit_surface`; Masuda et al., 4.4, fit the scanned face without penalty). This module evaluates positions, normals,
//! curvatures and their standard deviations at a place.
//!
//! Limits: the samples' noise acts along the normal, so that every standard deviation is that in the normal direction.
//! The uncertainty of material points within the surface follows from the edges and the flattening (`evaluate`).

#[cfg(feature = "measure")]
mod fit_surface;
mod height_draws;
mod mask;
mod parts;
#[cfg(feature = "measure")]
mod place_by_chart;

#[cfg(feature = "measure")]
pub use fit_surface::Quality;
#[cfg(feature = "measure")]
pub(crate) use fit_surface::{FitToSamples, fit_surface};
pub use height_draws::HeightDraws;
pub use mask::Mask;
pub use parts::{SurfaceError, SurfaceParts};
#[cfg(feature = "measure")]
pub use platen_numerics::spline_fit::{FittedSpline, SplineFit, Undetermined};
pub use platen_numerics::tensor_spline::TensorSpline;
pub use platen_numerics::uniform_knots::UniformKnots;

use crate::Vec3;
use platen_numerics::block_banded::BlockBandedFactor;
use platen_numerics::uniform_knots::LocalBasis;

/// The mid-surface S(u, v), (u, v) in `[0, W] x [0, H]`, metres, scanner frame.
///
/// Beyond the rectangle the outermost spans are continued: S is as accurate a few millimetres outside as at the edge.
#[derive(Debug, Clone, PartialEq)]
pub struct Surface {
    spline: TensorSpline<3>,
    thickness: f64,
    precision: BlockBandedFactor,
    covariance: Vec<[f64; 49]>,
    noise_share: f32,
    mask: Mask,
}

/// Position and derivatives of S at one place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Derivatives {
    /// Position, metres.
    pub p: Vec3,
    /// Derivative by u.
    pub u: Vec3,
    /// Derivative by v.
    pub v: Vec3,
    /// Second derivative by u, 1/m.
    pub uu: Vec3,
    /// Mixed derivative by u and v, 1/m.
    pub uv: Vec3,
    /// Second derivative by v, 1/m.
    pub vv: Vec3,
}

/// Curvature of the mid-surface, 1/m; positive when the centre lies on the scanner's side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Curvature {
    /// Normal curvature along u.
    pub u: f64,
    /// Normal curvature across u (along v where u and v are at right angles, as on every unstretched plate).
    pub v: f64,
    /// Twist: rate at which the normal turns towards v on the way along u.
    pub uv: f64,
    /// Larger principal curvature.
    pub max: f64,
    /// Smaller principal curvature.
    pub min: f64,
    /// Gaussian curvature, 1/m^2.
    pub gaussian: f64,
}

impl Surface {
    /// Builds the surface from a fit over the original rectangle, which starts at (0, 0).
    #[cfg(feature = "measure")]
    #[must_use]
    pub fn new(fitted: FittedSpline<3>, thickness: f64, mask: Mask) -> Self {
        let covariance = fitted.precision.local_inverse();
        let noise_share = fitted.noise_share as f32;
        Self { spline: fitted.spline, thickness, precision: fitted.precision, covariance, noise_share, mask }
    }

    /// Returns the extent along u, metres.
    #[must_use]
    pub fn width(&self) -> f64 {
        self.spline.u.end()
    }

    /// Returns the extent along v, metres.
    #[must_use]
    pub fn height(&self) -> f64 {
        self.spline.v.end()
    }

    /// Returns the thickness of the plate, metres.
    #[must_use]
    pub fn thickness(&self) -> f64 {
        self.thickness
    }

    /// Returns the spline: knots and control net.
    #[must_use]
    pub fn spline(&self) -> &TensorSpline<3> {
        &self.spline
    }

    /// Returns the mask of the parts that were seen.
    #[must_use]
    pub fn mask(&self) -> &Mask {
        &self.mask
    }

    /// Returns the position on the mid-surface.
    #[must_use]
    pub fn point(&self, u: f64, v: f64) -> Vec3 {
        self.spline.point(u, v).into()
    }

    /// Returns position and derivatives to second order.
    #[must_use]
    pub fn derivatives(&self, u: f64, v: f64) -> Derivatives {
        let jet = self.spline.jet(u, v);
        Derivatives {
            p: jet.p.into(),
            u: jet.u.into(),
            v: jet.v.into(),
            uu: jet.uu.into(),
            uv: jet.uv.into(),
            vv: jet.vv.into(),
        }
    }

    /// Returns the unit normal, towards the scanner.
    #[must_use]
    pub fn normal(&self, u: f64, v: f64) -> Vec3 {
        let [_, along_u, along_v] = self.spline.frame(u, v).map(Vec3::from);
        along_u.cross(&along_v).normalize()
    }

    /// Returns the position on the scanned face: half the thickness above the mid-surface.
    #[must_use]
    pub fn face(&self, u: f64, v: f64) -> Vec3 {
        let [p, along_u, along_v] = self.spline.frame(u, v).map(Vec3::from);
        p + along_u.cross(&along_v).normalize() * (0.5 * self.thickness)
    }

    /// Returns the curvature of the mid-surface.
    #[must_use]
    pub fn curvature(&self, u: f64, v: f64) -> Curvature {
        self.derivatives(u, v).curvature()
    }

    /// Returns the standard deviation of the position along the normal, metres.
    #[must_use]
    pub fn sigma_point(&self, u: f64, v: f64) -> f64 {
        let (su, sv) = (self.spline.u.local_basis(u), self.spline.v.local_basis(v));
        self.variance(&su, &sv, |i, k| su.value[i] * sv.value[k]).sqrt()
    }

    /// Returns the standard deviation of the position along the normal between scans of the same shape, metres.
    ///
    /// It is smaller than [`Self::sigma_point`], since the part of the shape that smoothing removes is the same in
    /// every scan. It holds for changes of a shape, not for the shape itself.
    #[must_use]
    pub fn sigma_repeat(&self, u: f64, v: f64) -> f64 {
        self.sigma_point(u, v) * f64::from(self.noise_share).sqrt()
    }

    /// Returns the standard deviations of the curvatures u, v and uv, 1/m.
    ///
    /// To first order: noise along the normal changes S_uu . n, while n and the lengths of S_u and S_v change by
    /// tangential parts only, whose products with the normal noise are of second order.
    #[must_use]
    pub fn sigma_curvature(&self, u: f64, v: f64) -> [f64; 3] {
        let (su, sv) = (self.spline.u.local_basis(u), self.spline.v.local_basis(v));
        let [_, along_u, along_v] = self.spline.frame(u, v).map(Vec3::from);
        let (e, g) = (along_u.norm_squared(), along_v.norm_squared());
        [
            self.variance(&su, &sv, |i, k| su.d2[i] * sv.value[k]).sqrt() / e,
            self.variance(&su, &sv, |i, k| su.value[i] * sv.d2[k]).sqrt() / g,
            self.variance(&su, &sv, |i, k| su.d1[i] * sv.d1[k]).sqrt() / (e * g).sqrt(),
        ]
    }

    /// Returns the standard deviation of a weighted sum of heights along the normal: terms ((u, v), weight), metres.
    ///
    /// Unlike the figures of one place this includes the correlation of errors at different places. Cost: one sweep
    /// over the factor (0.2 ms for 50 x 40 spans), whatever the number of terms.
    #[must_use]
    pub fn sigma_of_heights(&self, terms: &[([f64; 2], f64)]) -> f64 {
        let mut functional = vec![0.0; self.spline.control.len()];
        for ([u, v], weight) in terms {
            let ((i, bu), (k, bv)) = (self.spline.u.values(*u), self.spline.v.values(*v));
            for (row, fv) in bv.iter().enumerate() {
                for (column, fu) in bu.iter().enumerate() {
                    functional[(k + row) * self.spline.u.n_coefficients() + i + column] += weight * fv * fu;
                }
            }
        }
        self.precision.variance(&functional).sqrt()
    }

    /// Returns the variance of the sum of the 16 coefficients of a span, weighted by `weight(i, k)`.
    fn variance(&self, su: &LocalBasis, sv: &LocalBasis, weight: impl Fn(usize, usize) -> f64) -> f64 {
        let weights: [[f64; 4]; 4] = std::array::from_fn(|k| std::array::from_fn(|i| weight(i, k)));
        let mut sum = 0.0;
        for a in 0..16 {
            let (i, k) = (a % 4, a / 4);
            let row = &self.covariance[(sv.first + k) * self.spline.u.n_coefficients() + su.first + i];
            let slot = |b: usize| (b / 4 + 3 - k) * 7 + b % 4 + 3 - i;
            let inner: f64 = (0..16).map(|b| weights[b / 4][b % 4] * row[slot(b)]).sum();
            sum += weights[k][i] * inner;
        }
        sum.max(0.0)
    }
}

impl Derivatives {
    /// Returns the unit normal, towards the scanner.
    #[must_use]
    pub fn normal(&self) -> Vec3 {
        self.u.cross(&self.v).normalize()
    }

    /// Returns the curvature: second fundamental form in the orthonormal frame of S_u and its normal in the surface.
    #[must_use]
    pub fn curvature(&self) -> Curvature {
        let n = self.normal();
        let (e, f, g) = (self.u.norm_squared(), self.u.dot(&self.v), self.v.norm_squared());
        let area2 = e * g - f * f;
        let (l, m, k) = (self.uu.dot(&n), self.uv.dot(&n), self.vv.dot(&n));
        // S_v = (f / e) S_u + (sqrt(area2 / e)) e2, with e2 at a right angle to S_u.
        let along = l / e;
        let twist = (m - f * along) / area2.sqrt();
        let across = (k * e - 2.0 * f * m + f * f * along) / area2;
        Curvature::from_form(along, across, twist)
    }
}

impl Curvature {
    /// Builds the curvature from the second fundamental form in an orthonormal frame along u.
    #[must_use]
    pub fn from_form(along: f64, across: f64, twist: f64) -> Self {
        let mean = 0.5 * (along + across);
        let spread = (0.25 * (along - across).powi(2) + twist * twist).sqrt();
        Self {
            u: along,
            v: across,
            uv: twist,
            max: mean + spread,
            min: mean - spread,
            gaussian: along * across - twist * twist,
        }
    }

    /// Returns the normal curvature along a unit direction.
    #[must_use]
    pub fn along(&self, [x, y]: [f64; 2]) -> f64 {
        x * x * self.u + 2.0 * x * y * self.uv + y * y * self.v
    }

    /// Returns the principal curvature of larger absolute value.
    #[must_use]
    pub fn strongest(&self) -> f64 {
        if self.max.abs() >= self.min.abs() { self.max } else { self.min }
    }

    /// Returns the unit direction of [`Self::strongest`]; u where all directions are equal.
    #[must_use]
    pub fn strongest_direction(&self) -> [f64; 2] {
        let strongest = self.strongest();
        // Two expressions of one eigenvector: the longer one is the more accurate.
        let (a, b) = ([self.uv, strongest - self.u], [strongest - self.v, self.uv]);
        let [x, y] = if a[0].hypot(a[1]) > b[0].hypot(b[1]) { a } else { b };
        let length = x.hypot(y);
        if length > 0.0 { [x / length, y / length] } else { [1.0, 0.0] }
    }
}

/// Change from one curvature to another, in the same frame.
impl std::ops::Sub for Curvature {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::from_form(self.u - other.u, self.v - other.v, self.uv - other.uv)
    }
}

#[cfg(test)]
mod tests;
