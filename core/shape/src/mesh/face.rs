//! The scanned face and the mid-surface as smooth surfaces over one pair of coordinates.
//!
//! The edges span a Coons patch over the rectangle; its coordinates (a, b) are nearly those of the plate and never
//! fold, however strongly the plate is bent or from where it is seen, where a plane of projection would. Each
//! sample has a foot on the patch and a height over it. A penalised spline through the heights is the smooth face: one
//! noisy sample moves nothing, holes are bridged, and the edges' own noise across the surface drops out. Half
//! the thickness below it, along its normal, lies the mid-surface, right up to its edges: cuts are square to it.

use super::MeshError;
use super::edges::coons;
use super::facets::Facets;
use crate::surface::{Axis, Fit, Fitted, Net, Undetermined};
use crate::{Outline, Patch, PlateSpec, Sample, Vec3};

/// Length of a span of the smooth face, metres. Bends of a press are three and more times as wide; finer detail is left
/// to S, which is fitted to all samples.
const SPAN: f64 = 0.1;
/// Facets along a span of the first picture: 50 mm; it has no finer detail than its edges.
const FACETS: usize = 2;
/// Samples used for the smooth face, at least, where there are as many: every n-th of every n-th column.
const ENOUGH: usize = 30_000;
/// Residuals beyond this many standard deviations count for nothing (Tukey's biweight).
const CUT_OFF: f64 = 5.0;
/// The cosine of the incidence never counts below this one: beyond 87 degrees a sample tells nothing.
const LEAST_COSINE: f64 = 0.05;

/// The smooth scanned face and mid-surface over (a, b) in `[0, W] x [0, H]`.
#[derive(Debug, Clone)]
pub struct Face {
    /// The scanned face, metres, scanner frame.
    pub face: Net<3>,
    /// The mid-surface at the same (a, b): half the thickness below the face along its normal.
    pub mid: Net<3>,
    /// Feet (a, b) of the samples that were used, in lattice order.
    pub(crate) places: Vec<[f64; 2]>,
    /// Observed over stated standard deviation of the samples.
    pub(crate) noise_scale: f64,
}

impl Face {
    /// Fits the face to the samples.
    ///
    /// # Errors
    /// [`MeshError::Undetermined`] when too few samples lie on the plate.
    pub fn fit(patch: &Patch, outline: &Outline, spec: &PlateSpec) -> Result<Self, MeshError> {
        let axes = [spec.width, spec.height].map(|length| Axis::of_length(length, SPAN));
        let base = coons(outline, spec.width, spec.height, spec.face_inset, axes);
        let heights = Heights::over(&base, patch);
        let (fitted, noise_scale) = heights.smooth(axes)?;
        let face = Net::approximate(axes[0], axes[1], |a, b| {
            let [p, along_a, along_b] = base.frame(a, b).map(Vec3::from);
            (p + along_a.cross(&along_b).normalize() * fitted.net.point(a, b)[0]).into()
        });
        let mid = Net::approximate(axes[0], axes[1], |a, b| {
            let [p, along_a, along_b] = face.frame(a, b).map(Vec3::from);
            (p - along_a.cross(&along_b).normalize() * (0.5 * spec.thickness)).into()
        });
        Ok(Self { face, mid, places: heights.places, noise_scale })
    }
}

/// One over the standard deviation of a sample's distance from a surface with unit normal `normal`, from that of its range.
#[inline(always)]
pub(crate) fn per_sigma_across(sample: &Sample, normal: &Vec3) -> f64 {
    let range = sample.point.norm();
    let towards = sample.point.dot(normal).abs().max(LEAST_COSINE * range);
    range / (f64::from(sample.sigma) * towards)
}

/// Tukey's biweight of a residual, in standard deviations.
#[inline(always)]
pub(crate) fn biweight(residual: f64) -> f64 {
    let x = residual * (1.0 / CUT_OFF);
    (1.0 - x * x).max(0.0).powi(2)
}

/// Standard deviation of normally spread residuals with outliers, from the median of their sizes.
fn robust_scale(mut sizes: Vec<f64>) -> f64 {
    /// The median of |x| of the standard normal distribution.
    const MEDIAN: f64 = 0.674_489_750_196_081_7;
    if sizes.is_empty() {
        return 1.0;
    }
    let middle = sizes.len() / 2;
    let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    (*median / MEDIAN).max(1e-6)
}

/// The samples that suffice for a smooth face.
pub(crate) fn thinned(patch: &Patch) -> impl Iterator<Item = &Sample> {
    let every = ((patch.samples.len() / ENOUGH) as f64).sqrt().floor().max(1.0) as u32;
    let columns = patch.samples.chunk_by(|a, b| a.column == b.column);
    let columns = columns.filter(move |samples| samples[0].column.is_multiple_of(every));
    columns.flatten().filter(move |sample| sample.row.is_multiple_of(every))
}

/// Heights of samples over a surface.
#[derive(Debug, Default)]
pub(crate) struct Heights {
    places: Vec<[f64; 2]>,
    heights: Vec<f64>,
    /// One over their standard deviations.
    per_sigmas: Vec<f64>,
}

impl Heights {
    fn over(base: &Net<3>, patch: &Patch) -> Self {
        let mut out = Self::default();
        Facets::of(base, FACETS).walk(thinned(patch), |sample, foot| {
            out.add(foot.value, foot.height, per_sigma_across(sample, &foot.normal));
        });
        out
    }

    /// Adds a height, and one over its standard deviation.
    pub(crate) fn add(&mut self, place: [f64; 2], height: f64, per_sigma: f64) {
        self.places.push(place);
        self.heights.push(height);
        self.per_sigmas.push(per_sigma);
    }

    /// The spline through the heights, and how much larger than stated their noise is.
    pub(crate) fn smooth(&self, axes: [Axis; 2]) -> Result<(Fitted<1>, f64), Undetermined> {
        let gather = |weight: &dyn Fn(usize) -> f64| {
            let mut fit = Fit::new(axes[0], axes[1]);
            for (i, ([a, b], height)) in self.places.iter().zip(&self.heights).enumerate() {
                fit.add(*a, *b, [*height], weight(i));
            }
            fit
        };
        let all = gather(&|i| self.per_sigmas[i].powi(2));
        let penalty = all.choose_penalty([1.0]).penalty;
        let first = all.solve_with(penalty)?;
        let residuals: Vec<f64> = (0..self.places.len())
            .map(|i| {
                (self.heights[i] - first.net.point(self.places[i][0], self.places[i][1])[0])
                    * self.per_sigmas[i]
            })
            .collect();
        let scale = robust_scale(residuals.iter().map(|r| r.abs()).collect());
        // Weights relative to those of the first fit: the penalty chosen for it stays the right one.
        let robust =
            gather(&|i| biweight(residuals[i] / scale) * self.per_sigmas[i].powi(2)).solve_with(penalty)?;
        Ok((robust, scale))
    }
}
