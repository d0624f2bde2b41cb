//! The face around a few cells as a quadratic function over its tangent plane.
//!
//! In space, not over the lattice: a bent plate is a quadratic there however obliquely it is seen and however far apart
//! its samples are, while the range along a row grows without bound towards the horizon of a bend. Noise along the
//! beam is noise across the face by the cosine of the incidence, the same for all cells of a fit.

use nalgebra::{Cholesky, Matrix3, SMatrix, SVector};

use super::window::Window;
use crate::Vec3;

/// Cells on a side of the square that shares one fit.
pub(super) const TILE: usize = 4;

/// Cells beyond the square on each side that enter the fit: 16 x 16 at most.
const REACH: usize = 6;

/// Fewest cells that carry a fit of six coefficients.
const LEAST_CELLS: usize = 16;

/// Newton steps to where a beam meets the face; each squares an error of a few parts in a hundred.
const STEPS: usize = 4;

/// Height over the tangent plane: c0 + c1 x + c2 y + c3 x^2 + c4 x y + c5 y^2, all in metres, x and y in units of the
/// cells' own spacing along two axes of the plane.
#[derive(Debug, Clone)]
pub(super) struct LocalFace {
    centre: Vec3,
    /// Axes of the plane, each over its unit.
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

/// x^p y^q up to the fourth order: the products of two functions of the basis.
fn monomials([x, y]: [f64; 2]) -> [f64; 15] {
    let (xx, xy, yy) = (x * x, x * y, y * y);
    [1.0, x, y, xx, xy, yy, xx * x, xx * y, x * yy, yy * y, xx * xx, xx * xy, xx * yy, xy * yy, yy * yy]
}

/// Which monomial is the product of two functions of the basis.
const PRODUCTS: [[usize; 6]; 6] = [
    [0, 1, 2, 3, 4, 5],
    [1, 3, 4, 6, 7, 8],
    [2, 4, 5, 7, 8, 9],
    [3, 6, 7, 10, 11, 12],
    [4, 7, 8, 11, 12, 13],
    [5, 8, 9, 12, 13, 14],
];

impl LocalFace {
    /// The square of cells that shares a fit with `index`.
    pub(super) fn tile(window: &Window, index: usize) -> (usize, usize) {
        (index / window.n_rows / TILE, index % window.n_rows / TILE)
    }

    /// Fits the cells of `face` in and around a tile. `None` when they are too few or all on a line.
    pub(super) fn fit(window: &Window, face: &[bool], tile: (usize, usize)) -> Option<Self> {
        let span =
            |tile: usize, n: usize| (tile * TILE).saturating_sub(REACH)..(tile * TILE + TILE + REACH).min(n);
        let rows = span(tile.1, window.n_rows);
        let mut points = Vec::with_capacity((TILE + 2 * REACH) * (TILE + 2 * REACH));
        for column in span(tile.0, window.n_columns) {
            let cells = column * window.n_rows + rows.start..column * window.n_rows + rows.end;
            let on_face = face[cells.clone()].iter().zip(&window.points[cells]);
            points.extend(on_face.filter(|(on_face, _)| **on_face).map(|(_, point)| *point));
        }
        if points.len() < LEAST_CELLS {
            return None;
        }
        Self::through(&points)
    }

    fn through(points: &[Vec3]) -> Option<Self> {
        let n = points.len() as f64;
        let centre = points.iter().sum::<Vec3>() / n;
        let (along, up) = plane(points, centre)?;
        let mut moments = [0.0; 15];
        let mut b = SVector::<f64, 6>::zeros();
        for point in points {
            let off = point - centre;
            let at = along.map(|axis| axis.dot(&off));
            moments.iter_mut().zip(monomials(at)).for_each(|(sum, m)| *sum += m);
            b.axpy(up.dot(&off), &basis(at), 1.0);
        }
        let mut a = SMatrix::from_fn(|i, k| moments[PRODUCTS[i][k]]);
        // A trace of ridge on the second order alone lets a narrow strip fall back to a plane.
        for k in 3..6 {
            a[(k, k)] += 1.0;
        }
        let normal_matrix = Cholesky::new(a)?;
        let coefficients = normal_matrix.solve(&b);
        Some(Self { centre, along, up, coefficients, normal_matrix })
    }

    /// The face, or its continuation, in the direction (`column`, `row`) in lattice coordinates of the window.
    ///
    /// `None` where the continuation does not meet the beam.
    pub(super) fn at(&self, window: &Window, column: f64, row: f64) -> Option<OnFace> {
        let beam = window.sight(column, row).unit();
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
            range -= above / approach;
            // Behind the horizon of a bend the beam passes above the face or meets it from below.
            if approach.is_nan() || approach >= 0.0 || range.is_nan() || range <= 0.0 {
                return None;
            }
        }
        let [by_x, by_y] = slopes(at);
        let normal = self.up - self.along[0] * by_x - self.along[1] * by_y;
        Some(OnFace { range, point: beam * range, normal: normal.normalize(), at })
    }

    /// Variance of the range there, in units of that of a sample.
    pub(super) fn leverage(&self, place: &OnFace) -> f64 {
        let f = basis(place.at);
        f.dot(&self.normal_matrix.solve(&f))
    }
}

/// The plane through points about their centre: two axes at right angles, each over the mean spacing of points
/// along it, and the unit normal towards the scanner. `None` when the points lie on a line.
fn plane(points: &[Vec3], centre: Vec3) -> Option<([Vec3; 2], Vec3)> {
    let mut sums = [0.0; 6];
    for point in points {
        let [x, y, z]: [f64; 3] = (point - centre).into();
        let products = [x * x, x * y, x * z, y * y, y * z, z * z];
        sums.iter_mut().zip(products).for_each(|(sum, product)| *sum += product);
    }
    let [xx, xy, xz, yy, yz, zz] = sums;
    let eigen = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz).symmetric_eigen();
    let least = eigen.eigenvalues.imin();
    let up = eigen.eigenvectors.column(least).into_owned();
    let up = if up.dot(&centre) > 0.0 { -up } else { up };
    let axis = |k: usize| {
        let k = (least + k) % 3;
        // k even steps have a mean square of k^2 / 12; as many along one axis as along the other.
        let spacing = (12.0 * eigen.eigenvalues[k]).sqrt() / points.len() as f64;
        (spacing > 0.0).then(|| eigen.eigenvectors.column(k) / spacing)
    };
    Some(([axis(1)?, axis(2)?], up))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bent plate's points as far apart as a coarse lattice has them at a grazing sight.
    #[test]
    fn a_bend_is_continued_beyond_its_points() {
        let radius = 5.0;
        let point = |s: f64, y: f64| {
            let (sin, cos) = (s / radius).sin_cos();
            Vec3::new(6.0 + radius * sin, y, -3.6 - radius * (1.0 - cos))
        };
        let points: Vec<Vec3> =
            (0..160).map(|i| point(0.8 + 0.04 * f64::from(i % 10), 0.02 * f64::from(i / 10))).collect();
        let face = LocalFace::through(&points).expect("a face");
        let beyond = point(1.24, 0.1);
        let off = beyond - face.centre;
        let at = face.along.map(|axis| axis.dot(&off));
        let height = face.up.dot(&off) - basis(at).dot(&face.coefficients);
        // Of 0.5 mm of noise one part in six is noise across the face here.
        assert!(height.abs() < 1e-4, "{height}");
    }
}
