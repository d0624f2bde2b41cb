//! Smooth scanned face and mid-surface as bicubic splines over one pair of coordinates (a, b).
//!
//! 1. The edges span a Coons patch over the rectangle; its coordinates (a, b) are nearly those of the plate.
//! 2. The face is the intersection of the patch's normals with the height field of the outline. The edges' own noise
//!    across the surface is thereby eliminated.
//! 3. The mid-surface lies half the thickness below the face along its normal, up to the edges, since cuts are square
//!    to it.
//!
//! In: patch and outline. Out: both splines, metres, scanner frame.

use platen_numerics::tensor_spline::TensorSpline;
use platen_numerics::uniform_knots::UniformKnots;

use super::coons_patch::coons_patch;
use super::facets::Facets;
use crate::outline::{SPAN, thinned};
use crate::{Outline, Patch, PlateSpec, Vec3};

/// Number of facets along a span of the Coons patch: 50 mm each; the patch has no finer detail than its edges.
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
