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
    /// Variance of the range in units of that of a sample.
    pub(super) leverage: f64,
}

fn basis(x: f64, y: f64) -> SVector<f64, 6> {
    SVector::from([1.0, x, y, x * x, x * y, y * y])
}

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
        let mut a = SMatrix::<f64, 6, 6>::zeros();
        let mut b = SVector::<f64, 6>::zeros();
        let (mut n, mut scale) = (0, 0.0);
        for c in span(tile.0, window.n_columns) {
            for r in rows.clone() {
                let index = c * window.n_rows + r;
                if face[index] {
                    let (x, y) = window.place(index);
                    let (f, q) = (basis(x - column, y - row), f64::from(window.inverse[index]));
                    if n == 0 {
                        scale = q;
                    }
                    n += 1;
                    a.syger(1.0, &f, &f, 1.0);
                    b.axpy(q / scale, &f, 1.0);
                }
            }
        }
        if n < LEAST_CELLS {
            return None;
        }
        a.fill_upper_triangle_with_lower_triangle();
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
        let direction = window.nominal(x, y);
        let (sin_az, cos_az) = direction.azimuth.sin_cos();
        let (sin_el, cos_el) = direction.elevation.sin_cos();
        let header = &window.header;
        let q_az = self.scale * (c[1] + 2.0 * c[3] * dx + c[4] * dy) / (header.azimuth_step * cos_el);
        let q_el = -self.scale * (c[2] + c[4] * dx + 2.0 * c[5] * dy) / header.elevation_step;
        let outward = q * cos_el - q_el * sin_el;
        let gradient = Vec3::new(
            outward * cos_az - q_az * sin_az,
            outward * sin_az + q_az * cos_az,
            q * sin_el + q_el * cos_el,
        );
        Some(OnFace {
            range: 1.0 / q,
            point: Vec3::from(direction.unit()) / q,
            normal: -gradient.normalize(),
            leverage: f.dot(&self.normal_matrix.solve(&f)),
        })
    }
}
