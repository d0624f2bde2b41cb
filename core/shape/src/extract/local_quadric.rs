//! Local quadric: quadratic function over the tangent plane of the face around a few cells, by least squares.
//!
//! In: the cells of the face in and around a tile, a square of [`TILE`] x [`TILE`] cells. Out: a function in space that
//! continues the face, its intersection with a beam by Newton's method, and the variance of the range there.
//!
//! - The function is fitted in space, not over the lattice. In space a bent plate is a quadratic however obliquely it
//!   is seen and however far apart its samples are; over the lattice the range along a row grows without bound towards
//!   the horizon of a bend.
//! - Noise along the beam times the cosine of the incidence is noise across the face, the same for all cells of a fit.
//! - The second order is regularised (ridge) by a normal prior of the curvature, since a crease is not part of a plate.

use nalgebra::{Cholesky, Matrix3, SMatrix, SVector};
use platen_numerics::simd::dispatch_simd;

use super::range_noise::Noise;
use super::window::Window;
use crate::Vec3;

/// Number of cells on a side of the square (tile) that shares one fit.
pub(super) const TILE: usize = 4;

/// Number of cells beyond the tile on each side that enter the fit: 16 x 16 cells at most.
const REACH: usize = 6;

/// Least number of cells for a fit of six coefficients.
const LEAST_CELLS: usize = 16;

/// Prior of the curvatures, 1/m, one standard deviation: that of a plate bent to R 2 m. Over a square of 5 mm cells the
/// crease of a bevel has twenty times this curvature. Under 1.5 mm of noise a fit without the prior bends with the
/// first rows of the bevel and then follows it.
const CURVATURE: f64 = 0.5;

/// Largest number of Newton steps to the intersection of a beam with the face; each squares a relative error of a few
/// parts in a hundred. A step shorter than `STILL`, metres, is the last.
const STEPS: usize = 4;
const STILL: f64 = 1e-8;

/// Height over the tangent plane: c0 + c1 x + c2 y + c3 x^2 + c4 x y + c5 y^2, all in metres, x and y in units of the
/// cells' own spacing along two axes of the plane.
#[derive(Debug, Clone)]
pub(super) struct LocalQuadric {
    centre: Vec3,
    /// Axes of the plane, each divided by its unit of length.
    along: [Vec3; 2],
    /// Unit normal of the plane, towards the scanner.
    up: Vec3,
    coefficients: SVector<f64, 6>,
    normal_matrix: Cholesky<f64, nalgebra::Const<6>>,
}

/// A place on the face or on its continuation.
#[derive(Debug, Clone, Copy)]
pub(super) struct OnFace {
    pub(super) range: f64,
    pub(super) point: Vec3,
    /// Unit normal towards the scanner.
    pub(super) normal: Vec3,
    /// Place in the fit's own coordinates.
    at: [f64; 2],
}

fn basis([x, y]: [f64; 2]) -> SVector<f64, 6> {
    SVector::from([1.0, x, y, x * x, x * y, y * y])
}

/// Index of the monomial that is the product of two functions of the basis, in the list 1, x, y, x^2, x y, y^2, x^3,
/// x^2 y, x y^2, y^3, x^4, x^3 y, x^2 y^2, x y^3, y^4.
const PRODUCTS: [[usize; 6]; 6] = [
    [0, 1, 2, 3, 4, 5],
    [1, 3, 4, 6, 7, 8],
    [2, 4, 5, 7, 8, 9],
    [3, 6, 7, 10, 11, 12],
    [4, 7, 8, 11, 12, 13],
    [5, 8, 9, 12, 13, 14],
];

/// Largest number of points of a fit.
const MOST: usize = (TILE + 2 * REACH) * (TILE + 2 * REACH);

/// Number of lanes of a sum, to fill vector registers.
const LANES: usize = 16;

/// Sums terms over two lists whose lengths are multiples of [`LANES`].
#[inline(always)]
fn sum(a: &[f64], b: &[f64], term: impl Fn(f64, f64) -> f64) -> f64 {
    let mut lanes = [0.0; LANES];
    for (a, b) in a.chunks_exact(LANES).zip(b.chunks_exact(LANES)) {
        for lane in 0..LANES {
            lanes[lane] += term(a[lane], b[lane]);
        }
    }
    let mut half = LANES / 2;
    while half > 0 {
        (0..half).for_each(|lane| lanes[lane] += lanes[lane + half]);
        half /= 2;
    }
    lanes[0]
}

#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    sum(a, b, |a, b| a * b)
}

/// The points of a fit, by coordinate, padded with zeros to a multiple of [`LANES`].
struct Points {
    n: usize,
    by_axis: [[f64; MOST]; 3],
}

impl Points {
    fn new() -> Self {
        Self { n: 0, by_axis: [[0.0; MOST]; 3] }
    }

    /// Adds the points flagged `wanted`. Every point is written, and a point that is not wanted is overwritten by the
    /// next one (no branch).
    #[inline(always)]
    fn extend<'p>(&mut self, points: impl Iterator<Item = (&'p [f64; 3], bool)>) {
        for (point, wanted) in points {
            (0..3).for_each(|d| self.by_axis[d][self.n] = point[d]);
            self.n += usize::from(wanted);
        }
        if self.n < MOST {
            (0..3).for_each(|d| self.by_axis[d][self.n] = 0.0);
        }
    }

    #[inline(always)]
    fn axes(&self) -> [&[f64]; 3] {
        let len = self.n.next_multiple_of(LANES).min(MOST);
        self.by_axis.each_ref().map(|numbers| &numbers[..len])
    }

    /// Moves the origin to the mean of the points and returns that mean.
    #[inline(always)]
    fn centre(&mut self) -> Vec3 {
        let n = self.n;
        let centre = Vec3::from(self.axes().map(|x| sum(x, x, |x, _| x) / n as f64));
        for (numbers, centre) in self.by_axis.iter_mut().zip(centre.iter()) {
            numbers[..n].iter_mut().for_each(|x| *x -= centre);
        }
        centre
    }

    /// Returns the coordinate of each point along an axis.
    #[inline(always)]
    fn along(&self, axis: &Vec3) -> [f64; MOST] {
        let mut along = [0.0; MOST];
        let [x, y, z] = self.axes();
        for (((along, x), y), z) in along.iter_mut().zip(x).zip(y).zip(z) {
            *along = axis.x * x + axis.y * y + axis.z * z;
        }
        along
    }
}

/// Returns the elementwise products of two lists.
#[inline(always)]
fn times(a: &[f64], b: &[f64]) -> [f64; MOST] {
    let mut product = [0.0; MOST];
    product.iter_mut().zip(a).zip(b).for_each(|((product, a), b)| *product = a * b);
    product
}

impl LocalQuadric {
    /// Returns the tile of the cell `index`, whose cells share one fit.
    pub(super) fn tile(window: &Window, index: usize) -> (usize, usize) {
        (index / window.n_rows / TILE, index % window.n_rows / TILE)
    }

    /// Fits the cells of `face` in and around a tile. `None` when they are too few or all on a line.
    pub(super) fn fit(window: &Window, noise: &Noise, face: &[bool], tile: (usize, usize)) -> Option<Self> {
        let span =
            |tile: usize, n: usize| (tile * TILE).saturating_sub(REACH)..(tile * TILE + TILE + REACH).min(n);
        let rows = span(tile.1, window.n_rows);
        let mut points = Points::new();
        for column in span(tile.0, window.n_columns) {
            let cells = column * window.n_rows + rows.start..column * window.n_rows + rows.end;
            points.extend(window.points[cells.clone()].iter().zip(face[cells].iter().copied()));
        }
        if points.n < LEAST_CELLS {
            return None;
        }
        dispatch_simd(
            #[inline(always)]
            || Self::through(&mut points, f64::from(noise.of(tile.0 * TILE, tile.1 * TILE))),
        )
    }

    /// Fits the points, whose ranges have the standard deviation `sigma`.
    #[inline(always)]
    fn through(points: &mut Points, sigma: f64) -> Option<Self> {
        let centre = points.centre();
        let (along, up) = plane(points, centre)?;
        let len = points.axes()[0].len();
        let [x, y, z] = [along[0], along[1], up].map(|axis| points.along(&axis));
        let [x, y, z] = [&x[..len], &y[..len], &z[..len]];
        let [xx, xy, yy] = [times(x, x), times(x, y), times(y, y)];
        let [xx, xy, yy] = [&xx[..len], &xy[..len], &yy[..len]];
        // The moments of first order vanish: the origin is the mean.
        let second = [dot(x, x), dot(x, y), dot(y, y)];
        let third = [dot(xx, x), dot(xx, y), dot(xy, y), dot(yy, y)];
        let fourth = [dot(xx, xx), dot(xx, xy), dot(xy, xy), dot(xy, yy), dot(yy, yy)];
        let mut moments = [0.0; 15];
        moments[0] = points.n as f64;
        moments[3..6].copy_from_slice(&second);
        moments[6..10].copy_from_slice(&third);
        moments[10..].copy_from_slice(&fourth);
        let b = SVector::from([0.0, dot(z, x), dot(z, y), dot(z, xx), dot(z, xy), dot(z, yy)]);
        let mut a = SMatrix::from_fn(|i, k| moments[PRODUCTS[i][k]]);
        // The 1 is a small ridge on the second order, so that the fit of a narrow strip becomes a plane; the rest is
        // the prior.
        let across = sigma * up.dot(&centre.normalize());
        let [by_x, by_y] = along.map(|axis| axis.norm());
        for (k, per_curvature) in [(3, 2.0 * by_x * by_x), (4, by_x * by_y), (5, 2.0 * by_y * by_y)] {
            a[(k, k)] += 1.0 + (across * per_curvature / CURVATURE).powi(2);
        }
        let normal_matrix = Cholesky::new(a)?;
        let coefficients = normal_matrix.solve(&b);
        Some(Self { centre, along, up, coefficients, normal_matrix })
    }

    /// Intersects the face, or its continuation, with the beam in the direction (`column`, `row`) in lattice
    /// coordinates of the window.
    ///
    /// `None` where the continuation does not meet the beam.
    pub(super) fn at(&self, window: &Window, column: f64, row: f64) -> Option<OnFace> {
        let beam = window.beam_at(column, row).unit();
        let c = &self.coefficients;
        let slopes = |[x, y]: [f64; 2]| [c[1] + 2.0 * c[3] * x + c[4] * y, c[2] + c[4] * x + 2.0 * c[5] * y];
        let mut range = self.up.dot(&self.centre) / self.up.dot(&beam);
        let mut at = [0.0; 2];
        for _ in 0..STEPS {
            let off = beam * range - self.centre;
            at = self.along.map(|axis| axis.dot(&off));
            let [by_x, by_y] = slopes(at);
            let above = self.up.dot(&off) - basis(at).dot(c);
            let approach =
                self.up.dot(&beam) - by_x * self.along[0].dot(&beam) - by_y * self.along[1].dot(&beam);
            let step = above / approach;
            range -= step;
            // Behind the horizon of a bend the beam passes above the face, or meets it from below.
            if approach.is_nan() || approach >= 0.0 || range.is_nan() || range <= 0.0 {
                return None;
            }
            if step.abs() < STILL {
                break;
            }
        }
        let [by_x, by_y] = slopes(at);
        let normal = self.up - self.along[0] * by_x - self.along[1] * by_y;
        Some(OnFace { range, point: beam * range, normal: normal.normalize(), at })
    }

    /// Returns the leverage at a place: the variance of the range there, in units of that of a sample.
    pub(super) fn leverage(&self, place: &OnFace) -> f64 {
        let f = basis(place.at);
        f.dot(&self.normal_matrix.solve(&f))
    }
}

/// Fits a plane through points whose origin is their mean, `centre`. Returns two axes at right angles, each divided by
/// the mean spacing of the points along it, and the unit normal towards the scanner. `None` when the points lie on a
/// line.
#[inline(always)]
fn plane(points: &Points, centre: Vec3) -> Option<([Vec3; 2], Vec3)> {
    let [x, y, z] = points.axes();
    let (xy, xz, yz) = (dot(x, y), dot(x, z), dot(y, z));
    let eigen = Matrix3::new(dot(x, x), xy, xz, xy, dot(y, y), yz, xz, yz, dot(z, z)).symmetric_eigen();
    let least = eigen.eigenvalues.imin();
    let up = eigen.eigenvectors.column(least).into_owned();
    let up = if up.dot(&centre) > 0.0 { -up } else { up };
    let axis = |k: usize| {
        let k = (least + k) % 3;
        // k even steps have a mean square of k^2 / 12; as many along one axis as along the other.
        let spacing = (12.0 * eigen.eigenvalues[k]).sqrt() / points.n as f64;
        (spacing > 0.0).then(|| eigen.eigenvectors.column(k) / spacing)
    };
    Some(([axis(1)?, axis(2)?], up))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of a bent plate, spaced as in a coarse lattice at grazing incidence.
    #[test]
    fn a_bend_is_continued_beyond_its_points() {
        let radius = 5.0;
        let point = |s: f64, y: f64| {
            let (sin, cos) = (s / radius).sin_cos();
            Vec3::new(6.0 + radius * sin, y, -3.6 - radius * (1.0 - cos))
        };
        let mut points = Points::new();
        let bend: Vec<[f64; 3]> = (0..160)
            .map(|i| point(0.8 + 0.04 * f64::from(i % 10), 0.02 * f64::from(i / 10)).into())
            .collect();
        points.extend(bend.iter().map(|point| (point, true)));
        let face = LocalQuadric::through(&mut points, 5e-4).expect("a face");
        let beyond = point(1.24, 0.1);
        let off = beyond - face.centre;
        let at = face.along.map(|axis| axis.dot(&off));
        let height = face.up.dot(&off) - basis(at).dot(&face.coefficients);
        // One sixth of the 0.5 mm of noise is noise across the face here.
        assert!(height.abs() < 1e-4, "{height}");
    }

    /// Six rows of a plane 5 mm apart and three of a bevel that falls by 50 degrees; the figure tested is the height of
    /// the fit above the next row.
    #[test]
    fn under_noise_a_fit_does_not_bend_into_a_bevel() {
        let point = |row: f64, column: f64| {
            let fall = (row.max(0.0) * 5e-3) * 50.0_f64.to_radians().tan();
            Vec3::new(row * 5e-3, column * 5e-3, -5.0 - fall)
        };
        let below = |sigma: f64| {
            let mut points = Points::new();
            let cells: Vec<[f64; 3]> =
                (0..9 * 16).map(|i| point(f64::from(i / 16 - 5), f64::from(i % 16)).into()).collect();
            points.extend(cells.iter().map(|point| (point, true)));
            let face = LocalQuadric::through(&mut points, sigma).expect("a face");
            let off = point(4.0, 8.0) - face.centre;
            let at = face.along.map(|axis| axis.dot(&off));
            basis(at).dot(&face.coefficients) - face.up.dot(&off)
        };
        // Without noise there is no prior, and the fit passes below the bevel.
        let (noisy, free) = (below(1.5e-3), below(0.0));
        assert!(noisy > 4.0 * 1.5e-3 && free < 0.0, "{noisy} {free}");
    }
}
