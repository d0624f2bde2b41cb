//! Fit of S(u, v) to all samples by robust penalised least squares, after the mesh is flattened (Masuda et al., 4.4).
//!
//! 1. A spline through the vertices' (u, v) extends the chart from the vertices to every place (a, b) of the smooth
//!    face.
//! 2. Each sample gets its (u, v), its mid-surface point (half the thickness below it along the face's normal) and its
//!    weight: one over its variance along the normal, less where it is an outlier from the smooth face.
//! 3. The fit determines the heights along the normal; the chart determines the places within the surface
//!    (`place_by_chart`).
//!
//! In: samples, smooth face, chart. Out: S with its covariance, the mask of seen parts and the [`Quality`] of the scan.

use platen_numerics::reml::Penalty;
use platen_numerics::spline_fit::{FittedSpline, SplineFit, Undetermined};
use platen_numerics::tensor_spline::TensorSpline;
use platen_numerics::uniform_knots::UniformKnots;

use crate::mesh::{Facets, SmoothFace};
use crate::outline::{biweight, per_sigma_across};
use crate::surface::place_by_chart::place_by_chart;
use crate::surface::{Mask, Surface};
use crate::{Chart, Patch, PlateSpec, Sample, Vec3};

/// Length of a span of S, metres: a fifth of the width of a narrow bend. A plate without a narrow bend gets spans of
/// twice the length.
const SPAN: f64 = 0.06;
/// Number of facets along a span of the smooth face: 25 mm each.
const FACETS: usize = 4;
/// Size of a cell of the mask, metres.
const MASK_CELL: f64 = 0.025;
/// Largest distance of neighbouring rows: a single dropout is not a hole.
const NEIGHBOUR_ROWS: u32 = 2;

/// Quality of the scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// Number of samples on the plate.
    pub n_samples: usize,
    /// Number of samples used, that is, not rejected as outliers.
    pub n_used: usize,
    /// Share of the plate that was seen.
    pub coverage: f64,
    /// Standard deviation of the range as observed about the smooth face, metres.
    pub noise: f64,
    /// Root mean square distance of the samples from S, metres, weighted as in the fit.
    pub rms: f64,
    /// Mean distance of neighbouring samples on the plate, metres.
    pub lattice_step: f64,
}

/// The fitted surface and the quality of its samples.
pub(crate) struct FitToSamples {
    pub(crate) surface: Surface,
    pub(crate) quality: Quality,
}

/// Fits S to all samples of `patch`; `places` are the vertices' coordinates (a, b) on the face.
pub(crate) fn fit_surface(
    patch: &Patch,
    face: &SmoothFace,
    places: &[[f64; 2]],
    chart: &Chart,
    spec: &PlateSpec,
) -> Result<FitToSamples, Undetermined> {
    let carried = carry(face, places, chart)?;
    // Relative to its middle the plate's coordinates are small, and so are the rounding errors of their squares.
    let middle = Vec3::from(face.mid.point(0.5 * spec.width, 0.5 * spec.height));
    // Even numbers of spans, so that the fit may join them in pairs.
    let [u, v] = [spec.width, spec.height].map(|length| {
        let n_spans = UniformKnots::of_length(length, SPAN).n_spans();
        UniformKnots::new(0.0, length, n_spans.next_multiple_of(2))
    });
    let mut fit = SplineFit::<3>::new(u, v);
    let mut seen = Seen::new(spec);
    let per_scale = 1.0 / face.noise_scale;
    let mut variance = 0.0;
    Facets::carrying(&face.face, FACETS, |[a, b]| carried.jet(a, b)).walk(
        patch.samples.iter(),
        #[inline(always)]
        |sample, foot| {
            let [u, v] = foot.value;
            let per_sigma = per_scale * per_sigma_across(sample, &foot.normal);
            let weight = biweight(foot.height * per_sigma) * per_sigma * per_sigma;
            let mid = sample.point - foot.normal * (0.5 * spec.thickness) - middle;
            fit.add(u, v, mid.into(), weight);
            seen.add(sample, [u, v]);
            variance += f64::from(sample.sigma).powi(2);
        },
    );
    let mut fitted = moved(fit.solve(direction(&face.mid).into())?, middle);
    place_by_chart(&mut fitted.spline, &face.mid, &carried);
    let n = patch.samples.len();
    let quality = Quality {
        n_samples: n,
        n_used: fitted.n_points,
        coverage: seen.mask.coverage(),
        noise: face.noise_scale * (variance / n.max(1) as f64).sqrt(),
        rms: (fitted.residual_square / fitted.weight).sqrt(),
        lattice_step: (spec.width * spec.height * seen.mask.coverage() / n.max(1) as f64).sqrt(),
    };
    let surface = Surface::new(fitted, spec.thickness, seen.mask);
    Ok(FitToSamples { surface, quality })
}

/// Fits the chart over (a, b), by least squares on the vertices, with a penalty that acts below three spans only.
fn carry(face: &SmoothFace, places: &[[f64; 2]], chart: &Chart) -> Result<TensorSpline<2>, Undetermined> {
    let (a, b) = (face.mid.u, face.mid.v);
    let mut fit = SplineFit::<2>::new(a, b);
    for ([x, y], uv) in places.iter().zip(&chart.uv) {
        fit.add(*x, *y, *uv, 1.0);
    }
    let density = places.len() as f64 / (a.end() * b.end());
    let weight = |step: f64| density * (3.0 * step / std::f64::consts::TAU).powi(6);
    Ok(fit.solve_with(Penalty { u: weight(a.step()), v: weight(b.step()) })?.spline)
}

/// Returns the mean normal of the plate: at right angles to both diagonals.
fn direction(mid: &TensorSpline<3>) -> Vec3 {
    let corner = |a: f64, b: f64| Vec3::from(mid.point(a, b));
    let (w, h) = (mid.u.end(), mid.v.end());
    (corner(w, h) - corner(0.0, 0.0)).cross(&(corner(0.0, h) - corner(w, 0.0))).normalize()
}

fn moved(mut fitted: FittedSpline<3>, by: Vec3) -> FittedSpline<3> {
    fitted.spline.control.iter_mut().for_each(|c| *c = (Vec3::from(*c) + by).into());
    fitted
}

/// Mask of the places at and between neighbouring samples, which at grazing incidence are farther apart than cells.
struct Seen {
    mask: Mask,
    column: u32,
    /// Rows and places of the last column and of this one.
    before: Vec<(u32, [f64; 2])>,
    current: Vec<(u32, [f64; 2])>,
    /// Place in the last column at which the search for a sample's neighbour continues.
    cursor: usize,
}

impl Seen {
    fn new(spec: &PlateSpec) -> Self {
        let mask = Mask::unseen(spec.width, spec.height, MASK_CELL);
        Self { mask, column: 0, before: Vec::new(), current: Vec::new(), cursor: 0 }
    }

    fn add(&mut self, sample: &Sample, at: [f64; 2]) {
        if sample.column != self.column {
            std::mem::swap(&mut self.before, &mut self.current);
            if sample.column != self.column + 1 {
                self.before.clear();
            }
            self.current.clear();
            (self.column, self.cursor) = (sample.column, 0);
        }
        self.mask.mark(at[0], at[1]);
        if let Some((row, above)) = self.current.last()
            && sample.row - row <= NEIGHBOUR_ROWS
        {
            self.mask.mark_between(*above, at);
        }
        while self.before.get(self.cursor).is_some_and(|(row, _)| *row < sample.row) {
            self.cursor += 1;
        }
        if let Some((row, beside)) = self.before.get(self.cursor)
            && row - sample.row < NEIGHBOUR_ROWS
        {
            self.mask.mark_between(*beside, at);
        }
        self.current.push((sample.row, at));
    }
}
