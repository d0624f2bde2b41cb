//! Reference solution for the least membrane energy of a sphere, found without a mesh.
//!
//! It is a polynomial map from the rectangle into the sphere with free edges. Its energy is integrated by Gauss's rule,
//! its coefficients are found by the method of Gauss and Newton.

use nalgebra::{DMatrix, DVector};
use platen_shape::flatten::closed_form::sphere_of_fibres;

/// Highest sum of the exponents of a term's squares.
const DEGREE: i32 = 4;
/// Abscissae and weights of Gauss's rule on 8 points, the positive half.
const GAUSS: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_47),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
];

/// Returns the map of least energy from material coordinates to space.
pub(super) fn sphere_of_least_energy(
    radius: f64,
    size: [f64; 2],
    poisson: f64,
) -> impl Fn([f64; 2]) -> [f64; 3] {
    let map = PolynomialMap::new(radius, size);
    let mut c = DVector::zeros(2 * map.terms.len());
    for _ in 0..8 {
        let r = map.residuals(&c, poisson);
        let h = 1e-6;
        let columns: Vec<_> = (0..c.len())
            .map(|k| {
                let mut moved = c.clone();
                moved[k] += h;
                (map.residuals(&moved, poisson) - &r) / h
            })
            .collect();
        let jacobian = DMatrix::from_columns(&columns);
        let step = (jacobian.transpose() * &jacobian).cholesky().unwrap().solve(&(jacobian.transpose() * r));
        c -= step;
    }
    let surface = sphere_of_fibres(radius, size);
    move |p| {
        let (shift, _) = map.shift(&c, map.normalised(p));
        surface([p[0] + shift[0], p[1] + shift[1]])
    }
}

/// Sphere of fibres with its material shifted by polynomials: odd along the shift, even across.
struct PolynomialMap {
    radius: f64,
    half: [f64; 2],
    terms: Vec<(i32, i32)>,
}

impl PolynomialMap {
    fn new(radius: f64, size: [f64; 2]) -> Self {
        let terms = (0..=DEGREE).flat_map(|i| (0..=DEGREE - i).map(move |j| (2 * i + 1, 2 * j))).collect();
        Self { radius, half: size.map(|s| s / 2.0), terms }
    }

    fn normalised(&self, p: [f64; 2]) -> [f64; 2] {
        [p[0] / self.half[0] - 1.0, p[1] / self.half[1] - 1.0]
    }

    /// Returns the shift at a normalised position, and its derivatives by u and v.
    fn shift(&self, c: &DVector<f64>, [a, b]: [f64; 2]) -> ([f64; 2], [[f64; 2]; 2]) {
        let (mut shift, mut slope) = ([0.0; 2], [[0.0; 2]; 2]);
        let power = |x: f64, n: i32| if n < 0 { 0.0 } else { x.powi(n) };
        for (k, &(odd, even)) in self.terms.iter().enumerate() {
            for (axis, along, across) in [(0, a, b), (1, b, a)] {
                let coefficient = c[axis * self.terms.len() + k];
                shift[axis] += coefficient * along.powi(odd) * across.powi(even);
                let along_slope =
                    f64::from(odd) * power(along, odd - 1) * across.powi(even) / self.half[axis];
                let across_slope =
                    f64::from(even) * along.powi(odd) * power(across, even - 1) / self.half[1 - axis];
                slope[axis][axis] += coefficient * along_slope;
                slope[axis][1 - axis] += coefficient * across_slope;
            }
        }
        (shift, slope)
    }

    /// Returns the strain at Gauss's points, scaled so that half the sum of squares is the energy of a quarter of the
    /// plate.
    fn residuals(&self, c: &DVector<f64>, poisson: f64) -> DVector<f64> {
        let young = 1.0 / (1.0 - poisson * poisson);
        let mut residuals = Vec::new();
        for (a, wa) in GAUSS.iter().flat_map(halves) {
            for (b, wb) in GAUSS.iter().flat_map(halves) {
                let (shift, slope) = self.shift(c, [a, b]);
                // The sphere of fibres has the metric 1 along them and cos^2 across.
                let cos = ((a * self.half[0] + shift[0]) / self.radius).cos();
                let f = [[1.0 + slope[0][0], slope[0][1]], [cos * slope[1][0], cos * (1.0 + slope[1][1])]];
                let e = |i: usize, j: usize| {
                    0.5 * (f[0][i] * f[0][j] + f[1][i] * f[1][j] - if i == j { 1.0 } else { 0.0 })
                };
                let weight = (wa * wb * young).sqrt();
                // (1 - nu) E:E + nu (tr E)^2
                residuals.extend([e(0, 0), e(1, 1)].map(|e| weight * (1.0 - poisson).sqrt() * e));
                residuals.push(weight * (2.0 * (1.0 - poisson)).sqrt() * e(0, 1));
                residuals.push(weight * poisson.sqrt() * (e(0, 0) + e(1, 1)));
            }
        }
        DVector::from_vec(residuals)
    }
}

/// Returns Gauss's rule on [0, 1], since the plate is symmetric.
fn halves(&(x, w): &(f64, f64)) -> [(f64, f64); 2] {
    [(0.5 - 0.5 * x, 0.5 * w), (0.5 + 0.5 * x, 0.5 * w)]
}
