//! Height field: the scanned face as one bicubic spline over the plate's mean plane, by robust penalised least squares.
//!
//! In: the samples of the patch. Out: [`HeightField`], used by the outline and the mesh. The penalty is selected by
//! REML; then the samples are reweighted once by Tukey's biweight. Single outliers have no effect, and holes are
//! bridged.
//!
//! An edge is located by directions: between two beams, or across a mixed one. Its position in space follows from the
//! range of the face in that direction. The range from the few cells about a crossing has half the noise of a single
//! beam, which at 60 degrees of incidence is nearly doubled across the edge; the range of the height field has a
//! thirtieth. Own; Masuda et al. use the raw samples.

use nalgebra::Vector2;
use platen_numerics::median::robust_deviation;
use platen_numerics::simd::dispatch_simd;
use platen_numerics::spline_fit::{FittedSpline, SplineFit, Undetermined};
use platen_numerics::tensor_spline::{Jet, TensorSpline};
use platen_numerics::uniform_knots::UniformKnots;

use super::plane::Plane;
use crate::{Patch, Sample, Vec3};

/// Length of a span, metres. Bends of a press are at least three times as wide. Finer detail is left to the surface S,
/// which is fitted to all samples.
pub(crate) const SPAN: f64 = 0.1;

/// Least number of samples used, where there are as many: every n-th sample of every n-th column.
const ENOUGH: usize = 30_000;

/// Residuals beyond this many standard deviations have no weight (Tukey's biweight).
const CUT_OFF: f64 = 5.0;

/// Least cosine of the incidence in weights: that of 87 degrees.
pub(super) const LEAST_COSINE: f64 = 0.05;

/// Largest number of Newton steps from a point near the face; each squares a relative error of a few parts in a
/// hundred. A step shorter than `STILL`, metres, is the last.
const STEPS: usize = 4;
const STILL: f64 = 1e-8;

/// A point that would move by more than this, metres, does not belong to the face.
const REACH: f64 = 0.5;

/// The smoothed scanned face, as a height over a plane.
#[derive(Debug, Clone, PartialEq)]
pub struct HeightField {
    plane: Plane,
    /// Height over the plane, metres.
    height: TensorSpline<1>,
    /// Observed over stated standard deviation of the samples.
    pub(crate) noise_scale: f64,
}

/// Samples as heights over the plane.
#[derive(Debug, Default)]
struct Heights {
    places: Vec<[f64; 2]>,
    heights: Vec<f64>,
    /// One over their standard deviations.
    per_sigmas: Vec<f64>,
}

impl HeightField {
    /// Fits the samples over `plane`, whose axes run along the plate's edges.
    ///
    /// # Errors
    /// [`Undetermined`] when they are too few.
    pub(crate) fn fit(patch: &Patch, plane: Plane) -> Result<Self, Undetermined> {
        let mut heights = Heights::default();
        let (mut low, mut high) = (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY));
        for sample in thinned(patch) {
            let place = plane.project(sample.point);
            (low, high) = (low.inf(&place), high.sup(&place));
            heights.places.push(place.into());
            heights.heights.push(plane.height(sample.point));
            heights.per_sigmas.push(per_sigma_across(sample, &plane.normal()));
        }
        if !low.iter().zip(&high).all(|(low, high)| low < high) {
            return Err(Undetermined { n_points: patch.samples.len() });
        }
        let axis = |k: usize| {
            let n_spans = UniformKnots::of_length(high[k] - low[k], SPAN).n_spans();
            UniformKnots::new(low[k], high[k], n_spans)
        };
        let (fitted, noise_scale) = heights.smooth([axis(0), axis(1)])?;
        Ok(Self { plane, height: fitted.spline, noise_scale })
    }

    /// Fits the samples of a plate given by its corners.
    #[cfg(test)]
    pub(crate) fn between(corners: [Vec3; 4], patch: &Patch) -> Result<Self, Undetermined> {
        let (along, across) = (corners[1] - corners[0], corners[3] - corners[0]);
        let plane = Plane::new(corners.iter().sum::<Vec3>() / 4.0, along.cross(&across));
        Self::fit(patch, plane.along(plane.direction(along)))
    }

    /// Returns the mean Gaussian curvature of the face between four corners, 1/m^2.
    pub(super) fn gaussian_curvature(&self, corners: &[Vec3; 4]) -> f64 {
        /// Places along and across.
        const PLACES: usize = 16;
        let [a, b, c, d] = corners.map(|corner| self.plane.project(corner));
        let at = |k: usize| (k as f64 + 0.5) / PLACES as f64;
        let place = |k: usize| a.lerp(&b, at(k % PLACES)).lerp(&d.lerp(&c, at(k % PLACES)), at(k / PLACES));
        let curvature = |place: Vector2<f64>| {
            let Jet { u: [u], v: [v], uu: [uu], uv: [uv], vv: [vv], .. } = self.height.jet(place.x, place.y);
            (uu * vv - uv * uv) / (1.0 + u * u + v * v).powi(2)
        };
        let n = PLACES * PLACES;
        (0..n).map(|k| curvature(place(k))).sum::<f64>() / n as f64
    }

    /// Intersects the beam through `point` with the face. Also returns the unit normal there, towards the scanner.
    /// `None` where they do not meet.
    pub(crate) fn meet(&self, point: Vec3) -> Option<(Vec3, Vec3)> {
        self.along(point, point.normalize())
    }

    /// Intersects the line through `point` along a unit direction away from the scanner with the face, by Newton's
    /// method. Also returns the unit normal there. `None` where they do not meet.
    pub(crate) fn along(&self, point: Vec3, direction: Vec3) -> Option<(Vec3, Vec3)> {
        let mut at = point;
        let mut normal = self.plane.normal();
        for _ in 0..STEPS {
            let place = self.plane.project(at);
            let [[height], [by_x], [by_y]] = self.height.frame(place.x, place.y);
            normal = self.plane.normal() - self.plane.lift_direction(Vector2::new(by_x, by_y));
            // The line approaches the face against the normal: the product is negative.
            let approach = normal.dot(&direction);
            if approach.is_nan() || approach >= 0.0 {
                return None;
            }
            let step = (height - self.plane.height(at)) / approach;
            at += direction * step;
            if step.abs() < STILL {
                break;
            }
        }
        ((at - point).norm() < REACH).then(|| (at, normal.normalize()))
    }
}

impl Heights {
    /// Fits the heights; also returns the ratio of their observed to their stated noise.
    fn smooth(&self, axes: [UniformKnots; 2]) -> Result<(FittedSpline<1>, f64), Undetermined> {
        let all = self.weighted(axes, |i| self.per_sigmas[i].powi(2));
        let penalty = all.select_penalty([1.0]).penalty;
        let first = all.solve_with(penalty)?;
        let residuals: Vec<f64> = (0..self.places.len())
            .map(|i| {
                (self.heights[i] - first.spline.point(self.places[i][0], self.places[i][1])[0])
                    * self.per_sigmas[i]
            })
            .collect();
        let scale = robust_deviation(residuals.iter().map(|r| r.abs()).collect())
            .map_or(1.0, |scale| scale.max(1e-6));
        // Weights relative to those of the first fit: the penalty selected for it remains valid.
        let robust = self.weighted(axes, |i| biweight(residuals[i] / scale) * self.per_sigmas[i].powi(2));
        Ok((robust.solve_with(penalty)?, scale))
    }

    /// Returns the fit of the heights, each with its weight.
    fn weighted(&self, axes: [UniformKnots; 2], weight: impl Fn(usize) -> f64) -> SplineFit<1> {
        let mut fit = SplineFit::new(axes[0], axes[1]);
        dispatch_simd(
            #[inline(always)]
            || {
                for (i, ([a, b], height)) in self.places.iter().zip(&self.heights).enumerate() {
                    fit.add(*a, *b, [*height], weight(i));
                }
            },
        );
        fit
    }
}

/// Returns the reciprocal standard deviation of a sample's distance from a surface with unit normal `normal`, from the
/// standard deviation of its range.
#[inline(always)]
pub(crate) fn per_sigma_across(sample: &Sample, normal: &Vec3) -> f64 {
    let range = sample.point.norm();
    let towards = sample.point.dot(normal).abs().max(LEAST_COSINE * range);
    range / (f64::from(sample.sigma) * towards)
}

/// Returns Tukey's biweight of a residual, in standard deviations.
#[inline(always)]
pub(crate) fn biweight(residual: f64) -> f64 {
    let x = residual * (1.0 / CUT_OFF);
    (1.0 - x * x).max(0.0).powi(2)
}

/// Thins the samples to the number that a smooth face requires.
pub(crate) fn thinned(patch: &Patch) -> impl Iterator<Item = &Sample> {
    let every = ((patch.samples.len() / ENOUGH) as f64).sqrt().floor().max(1.0) as u32;
    let columns = patch.samples.chunk_by(|a, b| a.column == b.column);
    let columns = columns.filter(move |samples| samples[0].column.is_multiple_of(every));
    columns.flatten().filter(move |sample| sample.row.is_multiple_of(every))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gaussian_curvature_is_that_of_a_sphere() {
        let radius = 8.0;
        let at = |x: f64, y: f64| Vec3::new(x, y, -6.0 - radius + (radius * radius - x * x - y * y).sqrt());
        let sample = |k: u32| {
            let (column, row) = (k / 120, k % 120);
            let point = at(0.03 * f64::from(column) - 1.8, 0.025 * f64::from(row) - 1.5);
            Sample { point, column, row, sigma: 1e-4, intensity: 0 }
        };
        let patch = Patch { samples: (0..120 * 120).map(sample).collect(), ..Patch::default() };
        let corners = [at(-1.8, -1.5), at(1.75, -1.5), at(1.75, 1.45), at(-1.8, 1.45)];
        let found = HeightField::between(corners, &patch).unwrap().gaussian_curvature(&corners);
        assert!((found * radius * radius - 1.0).abs() < 0.005, "{found}");
    }
}
