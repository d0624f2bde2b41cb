//! The face around a few cells as a quadratic function of the lattice coordinates.

use nalgebra::{Cholesky, SMatrix, SVector};

use super::window::Window;
use crate::Vec3;

/// Cells on a side of the square that shares one fit.
pub(super) const TILE: usize = 4;

/// Cells beyond the square on each side that enter the fit: 16 x 16 at most.
const REACH: usize = 6;

/// Fewest cells that carry a fit of six coefficients.
const LEAST_CELLS: usize = 16;

/// Inverse range over the lattice, relative to that of the middle: c0 + c1 x + c2 y + c3 x^2 + c4 x y + c5 y^2.
///
/// x and y are true directions in units of the lattice step, so that beams off their nominal direction do no harm.
#[derive(Debug, Clone)]
pub(super) struct LocalFace {
    column: f64,
    row: f64,
    scale: f64,
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
}

fn basis(x: f64, y: f64) -> SVector<f64, 6> {
    SVector::from([1.0, x, y, x * x, x * y, y * y])
}

/// x^p y^q up to the fourth order: the products of two functions of the basis.
fn monomials(x: f64, y: f64) -> [f64; 15] {
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
        let middle = |tile: usize| (tile * TILE) as f64 + 0.5 * (TILE as f64 - 1.0);
        let (column, row) = (middle(tile.0), middle(tile.1));
        let rows = span(tile.1, window.n_rows);
        let mut moments = [0.0; 15];
        let mut b = SVector::<f64, 6>::zeros();
        let (mut n, mut scale, mut per_scale) = (0, 0.0, 0.0);
        for c in span(tile.0, window.n_columns) {
            for r in rows.clone().filter(|r| face[c * window.n_rows + r]) {
                let (x, y) = window.place(c, r);
                let q = f64::from(window.inverse[c * window.n_rows + r]);
                if n == 0 {
                    (scale, per_scale) = (q, 1.0 / q);
                }
                n += 1;
                let (x, y) = (x - column, y - row);
                moments.iter_mut().zip(monomials(x, y)).for_each(|(sum, m)| *sum += m);
                b.axpy(q * per_scale, &basis(x, y), 1.0);
            }
        }
        if n < LEAST_CELLS {
            return None;
        }
        let mut a = SMatrix::from_fn(|i, k| moments[PRODUCTS[i][k]]);
        // A trace of ridge on the second order alone lets a narrow strip fall back to a plane.
        for k in 3..6 {
            a[(k, k)] += 1.0;
        }
        let normal_matrix = Cholesky::new(a)?;
        let coefficients = normal_matrix.solve(&b);
        Some(Self { column, row, scale, coefficients, normal_matrix })
    }

    /// The face, or its continuation, in the direction (`x`, `y`) in lattice coordinates of the window.
    ///
    /// `None` where the continuation does not meet the beam.
    pub(super) fn at(&self, window: &Window, x: f64, y: f64) -> Option<OnFace> {
        let (dx, dy) = (x - self.column, y - self.row);
        let f = basis(dx, dy);
        let c = &self.coefficients;
        let q = f.dot(c) * self.scale;
        if q <= 0.0 || q.is_nan() {
            return None;
        }
        let sight = window.sight(x, y);
        let by_azimuth = self.scale * (c[1] + 2.0 * c[3] * dx + c[4] * dy) / window.header.azimuth_step;
        let by_elevation = -self.scale * (c[2] + c[4] * dx + 2.0 * c[5] * dy) / window.header.elevation_step;
        Some(OnFace {
            range: 1.0 / q,
            point: sight.unit() / q,
            normal: sight.normal(q, by_azimuth, by_elevation)?,
        })
    }

    /// Variance of the range there, in units of that of a sample.
    pub(super) fn leverage(&self, x: f64, y: f64) -> f64 {
        let f = basis(x - self.column, y - self.row);
        f.dot(&self.normal_matrix.solve(&f))
    }
}
