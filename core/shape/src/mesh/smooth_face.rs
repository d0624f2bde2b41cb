//! The scanned face and the mid-surface as bicubic splines over one pair of coordinates.
//!
//! The edges span a Coons patch over the rectangle; its coordinates (a, b) are nearly those of the plate. From each place of
//! it the height field of the outline is met along the patch's normal: the edges' own noise across the surface drops out. Half the thickness
//! below the face, along its normal, lies the mid-surface, right up to its edges: cuts are square to it.

use platen_numerics::tensor_spline::TensorSpline;
use platen_numerics::uniform_knots::UniformKnots;

use super::coons_patch::coons_patch;
use super::facets::Facets;
use crate::outline::{SPAN, thinned};
use crate::{Outline, Patch, PlateSpec, Vec3};

/// Facets along a span of the Coons patch: 50 mm; it has no finer detail than its edges.
const FACETS: usize = 2;

/// The smooth scanned face and mid-surface over (a, b) in `[0, W] x [0, H]`.
#[derive(Debug, Clone)]
pub struct SmoothFace {
    /// The scanned face, metres, scanner frame.
    pub face: TensorSpline<3>,
    /// The mid-surface at the same (a, b): half the thickness below the face along its normal.
    pub mid: TensorSpline<3>,
    /// Foot points (a, b) of some of the samples, in lattice order.
    pub(crate) places: Vec<[f64; 2]>,
    /// Observed over stated standard deviation of the samples.
    pub(crate) noise_scale: f64,
}

impl SmoothFace {
    /// Fits the face that `outline` encloses.
    #[must_use]
    pub fn of(patch: &Patch, outline: &Outline, spec: &PlateSpec) -> Self {
        let axes = [spec.width, spec.height].map(|length| UniformKnots::of_length(length, SPAN));
        let base = coons_patch(outline, spec.width, spec.height, spec.face_inset, axes);
        let mut places = Vec::new();
        Facets::of(&base, FACETS).walk(thinned(patch), |_, foot| places.push(foot.value));
        let face = TensorSpline::approximate(axes[0], axes[1], |a, b| {
            let [p, along_a, along_b] = base.frame(a, b).map(Vec3::from);
            let met = outline.height_field.along(p, along_b.cross(&along_a).normalize());
            met.map_or(p, |(point, _)| point).into()
        });
        let mid = TensorSpline::approximate(axes[0], axes[1], |a, b| {
            let [p, along_a, along_b] = face.frame(a, b).map(Vec3::from);
            (p - along_a.cross(&along_b).normalize() * (0.5 * spec.thickness)).into()
        });
        Self { face, mid, places, noise_scale: outline.height_field.noise_scale }
    }
}
