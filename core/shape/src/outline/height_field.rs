//! Height field: the scanned face as one bicubic spline over the plate's mean plane, by robust penalised least squares.
//!
//! In: the samples of the patch. Out: [`HeightField`], used by the outline and the mesh. Means of blocks of neighbouring
//! samples are fitted, and the penalty is selected by REML; then the means are reweighted once by Tukey's biweight.
//! Single outliers have no effect, and holes are bridged.
//!
//! An edge is located by directions: between two beams, or across a mixed one. Its position in space follows from the
//! range of the face in that direction. The range from the few cells about a crossing has half the noise of a single
//! beam, which at 60 degrees of incidence is nearly doubled across the edge; the range of the height field has a
//! thirtieth. Own; Masuda et al. use the raw samples.

use std::borrow::Cow;

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

/// Least number of means of n x n neighbouring samples that are fitted, where there are as many samples.
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
    height: FittedSpline<1>,
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
        let heights = Heights::of(block_means(patch).iter(), &plane);
        let (mut low, mut high) = (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY));
        for place in &heights.places {
            (low, high) = (low.inf(&(*place).into()), high.sup(&(*place).into()));
        }
        if !low.iter().zip(&high).all(|(low, high)| low < high) {
            return Err(Undetermined { n_points: patch.samples.len() });
        }
        let axis = |k: usize| {
            let n_spans = UniformKnots::of_length(high[k] - low[k], SPAN).n_spans();
            UniformKnots::new(low[k], high[k], n_spans)
        };
        let height = heights.smooth([axis(0), axis(1)])?;
        let singles = (block_side(patch) > 1).then(|| Heights::of(thinned(patch), &plane));
        let residuals = singles.as_ref().unwrap_or(&heights).residuals(&height.spline);
        Ok(Self { plane, height, noise_scale: spread(&residuals) })
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
            let Jet { u: [u], v: [v], uu: [uu], uv: [uv], vv: [vv], .. } =
                self.height.spline.jet(place.x, place.y);
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
            let [[height], [by_x], [by_y]] = self.height.spline.frame(place.x, place.y);
            normal = self.upwards(by_x, by_y);
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

    /// Returns the standard deviations of `N` weighted sums of the ranges at which the beams to points near the face
    /// meet it, metres. Each term is a point and its weight in every sum.
    pub(super) fn range_sigmas<const N: usize>(
        &self,
        terms: impl Iterator<Item = (Vec3, [f64; N])>,
    ) -> [f64; N] {
        let heights = terms.map(|(point, weights)| {
            let place = self.plane.project(point);
            let [_, [by_x], [by_y]] = self.height.spline.frame(place.x, place.y);
            let normal = self.upwards(by_x, by_y);
            let approach = (-normal.dot(&point.normalize())).max(LEAST_COSINE * normal.norm());
            (place.into(), weights.map(|weight| weight / approach))
        });
        self.height.variances(heights).map(|variance| self.noise_scale * variance.sqrt())
    }

    /// Returns the normal of a face with this gradient; its component along the plane's normal is 1.
    fn upwards(&self, by_x: f64, by_y: f64) -> Vec3 {
        self.plane.normal() - self.plane.lift_direction(Vector2::new(by_x, by_y))
    }
}

impl Heights {
    /// Computes the heights of samples over a plane.
    fn of<'a>(samples: impl Iterator<Item = &'a Sample>, plane: &Plane) -> Self {
        let (normal, mut heights) = (plane.normal(), Self::default());
        for sample in samples {
            heights.places.push(plane.project(sample.point).into());
            heights.heights.push(plane.height(sample.point));
            heights.per_sigmas.push(per_sigma_across(sample, &normal));
        }
        heights
    }

    /// Fits the heights.
    fn smooth(&self, axes: [UniformKnots; 2]) -> Result<FittedSpline<1>, Undetermined> {
        let all = self.weighted(axes, |i| self.per_sigmas[i].powi(2));
        let penalty = all.select_penalty([1.0]).penalty;
        let residuals = self.residuals(&all.solve_with(penalty)?.spline);
        let scale = spread(&residuals);
        // Weights relative to those of the first fit: the penalty selected for it remains valid.
        let robust = self.weighted(axes, |i| biweight(residuals[i] / scale) * self.per_sigmas[i].powi(2));
        robust.solve_with(penalty)
    }

    /// Returns the distances from a spline in standard deviations.
    fn residuals(&self, spline: &TensorSpline<1>) -> Vec<f64> {
        let heights = self.places.iter().zip(&self.heights).zip(&self.per_sigmas);
        heights.map(|(([a, b], height), per_sigma)| (height - spline.point(*a, *b)[0]) * per_sigma).collect()
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

/// Returns the ratio of the observed to the stated standard deviation.
fn spread(residuals: &[f64]) -> f64 {
    robust_deviation(residuals.iter().map(|r| r.abs()).collect()).map_or(1.0, |scale| scale.max(1e-6))
}

/// Returns n for which blocks of n x n samples are as many as a smooth face requires.
fn block_side(patch: &Patch) -> u32 {
    ((patch.samples.len() / ENOUGH) as f64).sqrt().floor().max(1.0) as u32
}

/// Returns the means of blocks of n x n neighbouring samples, with their standard deviations.
fn block_means(patch: &Patch) -> Cow<'_, [Sample]> {
    let side = block_side(patch);
    if side == 1 {
        return Cow::Borrowed(&patch.samples);
    }
    let rows = patch.samples.iter().map(|sample| sample.row / side + 1).max().unwrap_or(0);
    let mut sums = vec![(Vec3::zeros(), 0.0, 0.0); rows as usize];
    let mut means = Vec::new();
    for block in patch.samples.chunk_by(|a, b| a.column / side == b.column / side) {
        for sample in block {
            let (point, sigma, n) = &mut sums[(sample.row / side) as usize];
            (*point, *sigma, *n) = (*point + sample.point, *sigma + f64::from(sample.sigma), *n + 1.0);
        }
        for (row, sum) in sums.iter_mut().enumerate() {
            let (point, sigma, n) = std::mem::take(sum);
            if n > 0.0 {
                let sigma = (sigma / (n * f64::sqrt(n))) as f32;
                let (column, row) = (block[0].column / side, row as u32);
                means.push(Sample { point: point / n, column, row, sigma, intensity: 0 });
            }
        }
    }
    Cow::Owned(means)
}

/// Thins the samples to the number that a smooth face requires.
pub(crate) fn thinned(patch: &Patch) -> impl Iterator<Item = &Sample> {
    let every = block_side(patch);
    let columns = patch.samples.chunk_by(|a, b| a.column == b.column);
    let columns = columns.filter(move |samples| samples[0].column.is_multiple_of(every));
    columns.flatten().filter(move |sample| sample.row.is_multiple_of(every))
}

#[cfg(test)]
mod tests {
    use platen_numerics::random::Random;

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

    /// Ranges at the middle of an edge seen under 60 degrees, of 40 flat plates with noise; their blocks are 2 x 2
    /// samples.
    #[test]
    fn ranges_scatter_by_their_standard_deviation() {
        const SIGMA: f64 = 1e-3;
        let corners = [[-1.5, 4.2], [1.5, 4.2], [1.5, 6.2], [-1.5, 6.2]].map(|[x, y]| Vec3::new(x, y, -3.0));
        let place = Vec3::new(0.0, 6.2, -3.0);
        let mut random = Random::new(5);
        let (mut ratios, mut scales) = (0.0, 0.0);
        const PLATES: usize = 40;
        for _ in 0..PLATES {
            let samples = (0..400 * 400).map(|k: u32| {
                let (column, row) = (k / 400, k % 400);
                let at = Vec3::new(0.0075 * f64::from(column) - 1.5, 0.005 * f64::from(row) + 4.2, -3.0);
                let point = at + at.normalize() * (SIGMA * random.normal());
                Sample { point, column, row, sigma: SIGMA as f32, intensity: 0 }
            });
            let patch = Patch { samples: samples.collect(), ..Patch::default() };
            let field = HeightField::between(corners, &patch).unwrap();
            let off = field.meet(place).unwrap().0.norm() - place.norm();
            let [sigma] = field.range_sigmas([(place, [1.0])].into_iter());
            ratios += (off / sigma).powi(2) / PLATES as f64;
            scales += field.noise_scale / PLATES as f64;
        }
        assert!((0.7..1.3).contains(&ratios.sqrt()), "{}", ratios.sqrt());
        assert!((scales - 1.0).abs() < 2e-3, "{scales}");
    }
}
