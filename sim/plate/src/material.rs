//! Material map of a sheet on a surface that is not developable: minimum membrane energy by the Ritz method.
//!
//! With the Green strain e of the map from the rectangle to the surface, the energy is W = integral of
//! (e_uu + e_vv)^2 - 2 (1 - nu) (e_uu e_vv - e_uv^2) over the rectangle (plane stress, St. Venant-Kirchhoff material,
//! free edges). The map is the identity plus a series of Legendre polynomials in both parameters. W is a sum of
//! squares, integrated by Fejer's first rule and minimised by Gauss-Newton iteration. The rigid motions that the energy
//! of a sphere leaves free are fixed by a gauge: mean shift and mean rotation are zero.
//!
//! Limit: the series has degree 7, converged to a micrometre on a sphere of 11 m radius (3 m x 2.5 m).

use crate::swept_surface::SweptSurface;
use nalgebra::{DMatrix, DVector};

/// Poisson's ratio of steel.
const NU: f64 = 0.3;

/// Highest degree of the Legendre polynomials in each parameter. On a sphere of 11 m radius (3 m x 2.5 m) degree 7
/// is converged to a micrometre.
const DEGREE: usize = 7;

/// Number of coefficients of one of the two parameters.
const N_TABLE: usize = (DEGREE + 1) * (DEGREE + 1);

/// Quadrature nodes in each parameter.
const N_QUADRATURE: usize = 20;

/// Convergence limit of the iteration: largest change of a coefficient, metres.
const CONVERGED: f64 = 1e-12;

/// Weight of the gauge rows.
const GAUGE_WEIGHT: f64 = 1e3;

type Coefficients = [[f64; DEGREE + 1]; DEGREE + 1];

/// Displacement of the surface parameters (s, r) against those of the flat sheet.
#[derive(Debug, Clone)]
pub(crate) struct MaterialMap {
    /// Coefficients `[parameter][i][j]` of P_i(x) P_j(y), x and y in [-1, 1]; `None`: the identity.
    coefficients: Option<Box<[Coefficients; 2]>>,
}

/// Shift of (s, r) and its derivatives by the normalised x and y.
#[derive(Default)]
pub(crate) struct Shift {
    pub(crate) value: [f64; 2],
    pub(crate) slope: [[f64; 2]; 2],
}

/// Returns the Legendre polynomials of degree 0..=DEGREE and their derivatives at `x` (three-term recurrence).
fn legendre(x: f64) -> ([f64; DEGREE + 1], [f64; DEGREE + 1]) {
    let (mut p, mut d) = ([0.0; DEGREE + 1], [0.0; DEGREE + 1]);
    (p[0], p[1], d[1]) = (1.0, x, 1.0);
    for n in 1..DEGREE {
        let m = n as f64;
        p[n + 1] = ((2.0 * m + 1.0) * x * p[n] - m * p[n - 1]) / (m + 1.0);
        d[n + 1] = d[n - 1] + (2.0 * m + 1.0) * p[n];
    }
    (p, d)
}

/// Returns nodes and weights of Fejer's first rule: the midpoint rule after the substitution x = cos(t) of Clenshaw and
/// Curtis.
fn quadrature() -> Vec<(f64, f64)> {
    let t = |k: usize| std::f64::consts::PI * (k as f64 + 0.5) / N_QUADRATURE as f64;
    let weight = |k: usize| {
        let sum: f64 = (1..=N_QUADRATURE / 2)
            .map(|j| (2.0 * j as f64 * t(k)).cos() / (4.0 * (j * j) as f64 - 1.0))
            .sum();
        2.0 / N_QUADRATURE as f64 * (1.0 - 2.0 * sum)
    };
    (0..N_QUADRATURE).map(|k| (t(k).cos(), weight(k))).collect()
}

impl MaterialMap {
    /// Creates the identity: material points have the surface's own parameters.
    pub(crate) fn identity() -> Self {
        Self { coefficients: None }
    }

    /// Returns the shift at the normalised point (x, y) in [-1, 1]^2; `None` for the identity.
    pub(crate) fn shift(&self, x: f64, y: f64) -> Option<Shift> {
        self.coefficients.as_deref().map(|tables| shift(tables, x, y))
    }

    /// Computes the map of minimum membrane energy onto `surface`. `axis` is the direction of r in (u, v), a unit
    /// vector; `size` contains width and height, metres.
    pub(crate) fn least_energy(surface: &SweptSurface, axis: [f64; 2], size: [f64; 2]) -> Self {
        let sheet = Sheet { surface, axis, half: size.map(|length| length / 2.0) };
        let mut tables = Box::new([[[0.0; DEGREE + 1]; DEGREE + 1]; 2]);
        for _ in 0..20 {
            let Some(step) = sheet.step(&tables) else { break };
            for (column, change) in step.iter().enumerate() {
                let (k, i, j) = place(column);
                tables[k][i][j] += change;
            }
            if step.amax() < CONVERGED {
                break;
            }
        }
        Self { coefficients: Some(tables) }
    }
}

/// Returns the parameter and the two degrees of an unknown.
fn place(column: usize) -> (usize, usize, usize) {
    (column / N_TABLE, column % N_TABLE / (DEGREE + 1), column % (DEGREE + 1))
}

fn shift(tables: &[Coefficients; 2], x: f64, y: f64) -> Shift {
    let ((px, dx), (py, dy)) = (legendre(x), legendre(y));
    let mut shift = Shift::default();
    for (k, table) in tables.iter().enumerate() {
        for (i, row) in table.iter().enumerate() {
            let along: f64 = row.iter().zip(py).map(|(c, p)| c * p).sum();
            let slope: f64 = row.iter().zip(dy).map(|(c, d)| c * d).sum();
            shift.value[k] += px[i] * along;
            shift.slope[k][0] += dx[i] * along;
            shift.slope[k][1] += px[i] * slope;
        }
    }
    shift
}

/// Green strain (uu, vv, uv), or its change.
type Strain = [f64; 3];

/// Returns the components whose sum of squares is the density of W.
fn components([a, b, c]: Strain) -> [f64; 3] {
    [((1.0 + NU) / 2.0).sqrt() * (a + b), ((1.0 - NU) / 2.0).sqrt() * (a - b), (2.0 * (1.0 - NU)).sqrt() * c]
}

/// Least-squares problem of a flat sheet on a surface.
struct Sheet<'a> {
    surface: &'a SweptSurface,
    axis: [f64; 2],
    half: [f64; 2],
}

impl Sheet<'_> {
    /// Returns one Gauss-Newton step of all coefficients; `None` when the normal matrix is not positive definite.
    fn step(&self, tables: &[Coefficients; 2]) -> Option<DVector<f64>> {
        let nodes = quadrature();
        let n_rows = 3 * nodes.len() * nodes.len() + 3;
        let mut rows = DMatrix::<f64>::zeros(n_rows, 2 * N_TABLE);
        let mut residual = DVector::<f64>::zeros(n_rows);
        let mut first = 0;
        for &(x, weight_x) in &nodes {
            for &(y, weight_y) in &nodes {
                self.strain_rows(
                    tables,
                    [x, y],
                    (weight_x * weight_y).sqrt(),
                    first,
                    &mut rows,
                    &mut residual,
                );
                first += 3;
            }
        }
        self.gauge_rows(first, &mut rows);
        let gradient = rows.tr_mul(&residual);
        let normal = rows.tr_mul(&rows);
        normal.cholesky().map(|factor| -factor.solve(&gradient))
    }

    /// Fills in the three residuals of one quadrature node and their derivatives by all coefficients.
    ///
    /// The metric of a swept surface is diag(g, 1), so that the strain of a map (s, r) of (u, v) is
    /// e_ab = (g s_a s_b + r_a r_b - delta_ab) / 2.
    fn strain_rows(
        &self,
        tables: &[Coefficients; 2],
        [x, y]: [f64; 2],
        weight: f64,
        first: usize,
        rows: &mut DMatrix<f64>,
        residual: &mut DVector<f64>,
    ) {
        let ([ax, ay], [hu, hv]) = (self.axis, self.half);
        let (u, v) = (x * hu, y * hv);
        let shift = shift(tables, x, y);
        let (s, r) = (ay * u - ax * v + shift.value[0], ax * u + ay * v + shift.value[1]);
        let slope = |k: usize| [shift.slope[k][0] / hu, shift.slope[k][1] / hv];
        let (shift_s, shift_r) = (slope(0), slope(1));
        let ds = [ay + shift_s[0], -ax + shift_s[1]];
        let dr = [ax + shift_r[0], ay + shift_r[1]];
        let (g, g_slope) = self.surface.metric(s, r);
        let strain = [
            (g * ds[0] * ds[0] + dr[0] * dr[0] - 1.0) / 2.0,
            (g * ds[1] * ds[1] + dr[1] * dr[1] - 1.0) / 2.0,
            (g * ds[0] * ds[1] + dr[0] * dr[1]) / 2.0,
        ];
        for (k, component) in components(strain).into_iter().enumerate() {
            residual[first + k] = component * weight;
        }
        let ((px, dx), (py, dy)) = (legendre(x), legendre(y));
        for column in 0..2 * N_TABLE {
            let (k, i, j) = place(column);
            let change = [dx[i] * py[j] / hu, px[i] * dy[j] / hv];
            let g_change = g_slope[k] * px[i] * py[j];
            let (d, factor) = if k == 0 { (ds, g) } else { (dr, 1.0) };
            let strain_change = [
                g_change * ds[0] * ds[0] / 2.0 + factor * d[0] * change[0],
                g_change * ds[1] * ds[1] / 2.0 + factor * d[1] * change[1],
                (g_change * ds[0] * ds[1] + factor * (d[0] * change[1] + d[1] * change[0])) / 2.0,
            ];
            for (row, component) in components(strain_change).into_iter().enumerate() {
                rows[(first + row, column)] = component * weight;
            }
        }
    }

    /// Fills in the rows of the gauge: two mean shifts and the mean rotation (coefficients of a small rotation of the
    /// sheet).
    fn gauge_rows(&self, first: usize, rows: &mut DMatrix<f64>) {
        let ([ax, ay], [hu, hv]) = (self.axis, self.half);
        rows[(first, 0)] = GAUGE_WEIGHT;
        rows[(first + 1, N_TABLE)] = GAUGE_WEIGHT;
        let turn = [(0, 1, 0, -ax * hu), (0, 0, 1, -ay * hv), (1, 1, 0, ay * hu), (1, 0, 1, -ax * hv)];
        for (k, i, j, value) in turn {
            rows[(first + 2, k * N_TABLE + i * (DEGREE + 1) + j)] = GAUGE_WEIGHT * value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quadrature_is_exact_for_polynomials() {
        for degree in [0, 2, 6, 18] {
            let sum: f64 = quadrature().iter().map(|(x, w)| w * x.powi(degree)).sum();
            assert!((sum - 2.0 / f64::from(degree + 1)).abs() < 1e-13, "degree {degree}: {sum}");
        }
    }

    #[test]
    fn legendre_slopes_agree_with_differences() {
        let (_, slopes) = legendre(0.3);
        let (above, below) = (legendre(0.3 + 1e-6).0, legendre(0.3 - 1e-6).0);
        for k in 0..=DEGREE {
            assert!((slopes[k] - (above[k] - below[k]) / 2e-6).abs() < 1e-8);
        }
    }
}
