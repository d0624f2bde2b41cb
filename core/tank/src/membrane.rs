//! Airy stress function of a shallow, doubly curved plate, by Galerkin's method.
//!
//! In: the extents of a rectangular blank, metres, and the Gaussian curvature K of the surface to which it is bent,
//! 1/m^2. Out: the strains, and the displacements of the material between blank and formed plate, for the least
//! membrane energy.
//!
//! The membrane stresses follow from an Airy stress function X (over Young's modulus) with del^4 X = -K and X = dX/dn =
//! 0 at the free edges (Foeppl; Timoshenko and Woinowsky-Krieger, Theory of Plates and Shells, section 98). The basis
//! of Galerkin's method is (1 - x^2)^2 (1 - y^2)^2 times even powers. In the middle of a long strip of width W the
//! strain along it is K (W^2 / 24 - x^2 / 2): the middle line is stretched, the edges are shortened.
//!
//! Limits: the plate is shallow, that is, K is constant and K times the area small.

use nalgebra::{DMatrix, DVector};

/// Poisson's ratio of steel.
const POISSON: f64 = 0.3;
/// Number of even powers along each side. With 5 the displacement of the corner of a square differs by 2 % from that
/// with 4.
const POWERS: usize = 5;
/// Number of Gauss-Legendre points on an interval: exact to degree 31.
const POINTS: usize = 16;

/// Membrane state of one blank.
#[derive(Debug, Clone)]
pub struct Membrane {
    /// Half the extents of the blank along u and v.
    half: [f64; 2],
    curvature: f64,
    /// Coefficients of X, v outer.
    coefficients: DMatrix<f64>,
    rule: Vec<(f64, f64)>,
}

impl Membrane {
    /// Solves a blank of these extents along u and v, metres, on a surface of this Gaussian curvature, 1/m^2.
    #[must_use]
    pub fn new(blank: [f64; 2], curvature: f64) -> Self {
        let rule = gauss_legendre();
        let half = blank.map(|side| 0.5 * side);
        // Integrals over -1..1 of products of the basis and its second derivatives.
        let table = |d: usize, e: usize| {
            DMatrix::from_fn(POWERS, POWERS, |i, j| {
                rule.iter().map(|(x, w)| w * basis(i, *x)[d] * basis(j, *x)[e]).sum::<f64>()
            })
        };
        let (mass, mixed, stiff) = (table(0, 0), table(0, 2), table(2, 2));
        let [a, b] = half.map(|half| half.powi(-2));
        let n = POWERS * POWERS;
        let matrix = DMatrix::from_fn(n, n, |p, q| {
            let ((i, j), (k, l)) = ((p % POWERS, p / POWERS), (q % POWERS, q / POWERS));
            a * a * stiff[(i, k)] * mass[(j, l)]
                + b * b * mass[(i, k)] * stiff[(j, l)]
                + a * b * (mixed[(k, i)] * mixed[(j, l)] + mixed[(i, k)] * mixed[(l, j)])
        });
        let mean = |i: usize| rule.iter().map(|(x, w)| w * basis(i, *x)[0]).sum::<f64>();
        let right = DVector::from_fn(n, |p, _| -curvature * mean(p % POWERS) * mean(p / POWERS));
        // The form is positive definite, except for a blank without extent.
        let solution = matrix.cholesky().map_or_else(|| DVector::zeros(n), |matrix| matrix.solve(&right));
        Self {
            half,
            curvature,
            coefficients: DMatrix::from_column_slice(POWERS, POWERS, solution.as_slice()),
            rule,
        }
    }

    /// Returns the strains along u and v at a place from the middle of the blank, metres.
    #[must_use]
    pub fn strain(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [a, b] = self.half;
        let (mut xx, mut yy) = (0.0, 0.0);
        for i in 0..POWERS {
            let [f, _, f2] = basis(i, x / a);
            for j in 0..POWERS {
                let [g, _, g2] = basis(j, y / b);
                let c = self.coefficients[(i, j)];
                xx += c * f2 * g / (a * a);
                yy += c * f * g2 / (b * b);
            }
        }
        [yy - POISSON * xx, xx - POISSON * yy]
    }

    /// Returns the place on the formed plate of a place on the blank, both from the middle: u across the middle
    /// meridian along great circles, v along the meridian.
    #[must_use]
    pub fn formed(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        // The middle lines stay straight, so that the strains alone move the material along each line from them.
        let from_middle = |end: f64, strain: &dyn Fn(f64) -> f64| {
            self.rule.iter().map(|(s, w)| 0.5 * end * w * strain(0.5 * end * (1.0 + s))).sum::<f64>()
        };
        // Across the meridian at the distance x, a length along v is shorter by K x^2 / 2.
        let along = |s: f64| self.strain([x, s])[1] + 0.5 * self.curvature * x * x;
        [x + from_middle(x, &|s| self.strain([s, y])[0]), y + from_middle(y, &along)]
    }

    /// Returns the place on the blank whose material is at a place on the formed plate.
    #[must_use]
    pub fn blank(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let mut place = [u, v];
        // Strains are below a percent: each step gains two digits.
        for _ in 0..8 {
            let [x, y] = self.formed(place);
            place = [place[0] + u - x, place[1] + v - y];
        }
        place
    }
}

/// Returns (1 - x^2)^2 x^(2 k), its first and its second derivative.
fn basis(k: usize, x: f64) -> [f64; 3] {
    // Coefficients of x^(2k), x^(2k + 2), x^(2k + 4).
    let mut sums = [0.0; 3];
    for (n, c) in [(2 * k, 1.0), (2 * k + 2, -2.0), (2 * k + 4, 1.0)] {
        let power = |down: usize| if n >= down { x.powi((n - down) as i32) } else { 0.0 };
        let n = n as f64;
        sums = [sums[0] + c * power(0), sums[1] + c * n * power(1), sums[2] + c * n * (n - 1.0) * power(2)];
    }
    sums
}

/// Returns places and weights on -1..1, by Newton's method on the Legendre polynomial.
fn gauss_legendre() -> Vec<(f64, f64)> {
    let n = POINTS as f64;
    let root = |k: usize| {
        let mut x = (std::f64::consts::PI * (k as f64 + 0.75) / (n + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..20 {
            let (mut p, mut before) = (x, 1.0);
            for m in 2..=POINTS {
                let m = m as f64;
                (p, before) = (((2.0 * m - 1.0) * x * p - (m - 1.0) * before) / m, p);
            }
            slope = n * (x * p - before) / (x * x - 1.0);
            x -= p / slope;
        }
        (x, 2.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..POINTS).map(root).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In the middle of a long strip: K (W^2 / 24 - x^2 / 2).
    #[test]
    fn strip_has_the_closed_form() {
        let membrane = Membrane::new([2.5, 10.0], 0.01);
        for x in [0.0, 0.5, 1.0, 1.25] {
            let wanted = 0.01 * (2.5_f64.powi(2) / 24.0 - 0.5 * x * x);
            let [across, along] = membrane.strain([x, 0.0]);
            println!("{x}: {along} {wanted} {across}");
            assert!((along - wanted).abs() < 3e-5, "{x}: {along} {wanted}");
            assert!((across + POISSON * wanted).abs() < 3e-5, "{x}: {across}");
        }
    }

    #[test]
    fn blank_and_formed_plate_are_each_other_s_inverse() {
        let membrane = Membrane::new([2.4, 5.6], 1.0 / 81.0);
        for place in [[0.0, 0.0], [1.2, 2.8], [-0.7, 1.1], [1.2, -2.8]] {
            let back = membrane.blank(membrane.formed(place));
            assert!((back[0] - place[0]).hypot(back[1] - place[1]) < 1e-9, "{place:?} {back:?}");
        }
    }

    /// A square is drawn in equally along both sides, and is symmetric under a quarter turn.
    #[test]
    fn square_is_symmetric() {
        let membrane = Membrane::new([3.0, 3.0], 0.01);
        let ([a, b], [c, d]) = (membrane.strain([0.4, 1.1]), membrane.strain([1.1, 0.4]));
        assert!((a - d).abs() < 1e-12 && (b - c).abs() < 1e-12);
    }
}
