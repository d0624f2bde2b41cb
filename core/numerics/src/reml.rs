//! Restricted maximum likelihood (REML) of the two penalty weights of a spline fit.
//!
//! A fit minimises sum w |y - S|^2 + m_u int |S_uuu|^2 + m_v int |S_vvv|^2. A penalty on third derivatives does not
//! change a shape of constant curvature. With one weight per direction a narrow bend stays narrow across and is
//! smoothed along the bend. The weights m_u and m_v are those of largest likelihood if the third derivatives are random
//! with unknown variance (REML: Wood, *J. R. Stat. Soc. B* 73 (2011); P-splines: Eilers and Marx, *Stat. Sci.* 11
//! (1996)).
//!
//! The criterion is evaluated on a regular grid of four values per cell, taken from the cells' moments. On this grid
//! the normal matrix and the penalty are Kronecker products, and one eigenvalue problem per axis makes them diagonal. A
//! pair of weights then costs one pass over the coefficients instead of a factorisation. Limit: the selection of the
//! weights treats points of unequal density and holes approximately; the fit itself does not.

use nalgebra::{DMatrix, DVector, SMatrix, SVector, SymmetricEigen};

use crate::uniform_knots::UniformKnots;

/// Weights of the penalty of a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Penalty {
    /// Weight of the squared third derivative by u, integrated over the rectangle.
    pub u: f64,
    /// Weight of the squared third derivative by v.
    pub v: f64,
}

/// Penalty of the largest restricted likelihood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SelectedPenalty {
    /// The weights.
    pub penalty: Penalty,
    /// Share of the covariance that is scatter: see
    /// [`FittedSpline::noise_share`](crate::spline_fit::FittedSpline::noise_share).
    pub noise_share: f64,
    /// Along u and along v: true when the smoothed shape can be represented by spans of twice the length.
    pub coarse: [bool; 2],
}

/// The two Gauss places of a span, from its middle. A function of degree 1 fitted to evenly distributed noise has
/// independent noise of equal size there.
pub(crate) const GAUSS: [f64; 2] = [-0.288_675_134_594_812_9, 0.288_675_134_594_812_9];

/// Returns the place of the `k`-th value of a row, in spans from the start.
fn place_in_spans(k: usize) -> f64 {
    (k / 2) as f64 + 0.5 + GAUSS[k % 2]
}

/// Values at the Gauss places of all spans; `None` where no points were seen.
#[derive(Debug, Clone)]
pub(crate) struct GridValues {
    pub(crate) u: UniformKnots,
    pub(crate) v: UniformKnots,
    /// The values, v outer, u inner.
    pub(crate) values: Vec<Option<f64>>,
    /// Mean variance of a value according to the points' weights.
    pub(crate) stated: f64,
}

/// Nullity of the third-difference penalty along an axis: quadratics.
const NULLITY: usize = 3;
/// Range of the exponents x of the search, in which the penalty's largest eigenvalue is 10^x times that of the data.
/// Beyond the upper end rounding would bend the shapes that the penalty does not affect; beyond the lower end the fit
/// interpolates.
const EXPONENTS: (f64, f64) = (-1.0, 10.0);
/// Exponents of the stiff spline for the first fill of gaps: it follows waves over ten spans and damps those over four,
/// such as the kinks of a crude fill.
const STIFF: [f64; 2] = [6.0, 6.0];
/// Exponent from which spans of twice the length suffice: a wave over four spans is damped to 1/240, and it is the
/// shortest that they follow to a hundredth.
const COARSE: f64 = 6.0;
/// Rounds of filling gaps with the smoothed values; each reduces the remaining effect of the gaps' values on the
/// spline.
const ROUNDS: usize = 5;
/// Least variance of the values, in parts of that by the weights: data without noise would require a penalty against
/// which the points vanish in rounding.
const LEAST_NOISE: f64 = 0.01;
/// Width of the last step of the search, in decades. The criterion is flat: a tenth of a decade changes nothing.
const LAST_STEP: f64 = 0.2;

impl GridValues {
    /// Selects the penalty of the largest restricted likelihood.
    pub(crate) fn select_penalty(&self) -> SelectedPenalty {
        let (along_u, along_v) = (AxisSpectrum::new(&self.u), AxisSpectrum::new(&self.v));
        let (mut filled, gaps) = self.filled();
        let mut criterion = RestrictedLikelihood::new(&along_u, &along_v, &filled);
        let mut best = STIFF;
        if !gaps.is_empty() {
            // A crude fill has kinks that would be taken for shape, and so has one that does not follow the shape: the
            // gaps are filled by a stiff spline first, then by the selected one.
            criterion.refill(&mut filled, &gaps, best);
            best = criterion.minimise();
            criterion.refill(&mut filled, &gaps, best);
        }
        best = criterion.minimise();
        let [scale_u, scale_v] = criterion.scales(best);
        let noise = criterion.noise(best).max(LEAST_NOISE * self.stated);
        let penalty = Penalty {
            u: scale_u / (noise * 0.5 * self.v.step()),
            v: scale_v / (noise * 0.5 * self.u.step()),
        };
        SelectedPenalty {
            penalty,
            noise_share: criterion.noise_share(best),
            coarse: best.map(|exponent| exponent >= COARSE),
        }
    }

    /// Returns the values with gaps filled, and the gaps.
    ///
    /// Where there are gaps the values are replaced by their departures from their biquadratic trend, and a gap is
    /// filled by the nearest values around it, weighted by distance. The trend is in the null space of the penalty and
    /// does not change the likelihood. Without it a gap at the border of an inclined plate would be filled far off the
    /// plate.
    fn filled(&self) -> (DMatrix<f64>, Vec<(usize, usize)>) {
        let (n_u, n_v) = (2 * self.u.n_spans(), 2 * self.v.n_spans());
        let trend = if self.values.contains(&None) { self.trend() } else { Trend::zeros() };
        let off = |index: usize| Some(self.values[index]? - trend.dot(&biquadratic(index, [n_u, n_v])));
        let departures: Vec<Option<f64>> = (0..self.values.len()).map(off).collect();
        let at = |i: usize, k: usize| departures[k * n_u + i];
        let mut missing = Vec::new();
        let filled = DMatrix::from_fn(n_u, n_v, |i, k| {
            at(i, k).unwrap_or_else(|| {
                missing.push((i, k));
                let nearest = [
                    (1..=i).find_map(|d| at(i - d, k).map(|y| (d, y))),
                    (1..n_u - i).find_map(|d| at(i + d, k).map(|y| (d, y))),
                    (1..=k).find_map(|d| at(i, k - d).map(|y| (d, y))),
                    (1..n_v - k).find_map(|d| at(i, k + d).map(|y| (d, y))),
                ];
                let (sum, weight) = nearest
                    .into_iter()
                    .flatten()
                    .fold((0.0, 0.0), |(s, w), (d, y)| (s + y / d as f64, w + 1.0 / d as f64));
                if weight > 0.0 { sum / weight } else { 0.0 }
            })
        });
        (filled, missing)
    }

    /// Returns the coefficients of the biquadratic function nearest to the values; 0 where they do not determine it.
    fn trend(&self) -> Trend {
        let size = [2 * self.u.n_spans(), 2 * self.v.n_spans()];
        let (mut gram, mut rhs) = (SMatrix::<f64, TREND, TREND>::zeros(), Trend::zeros());
        for (index, value) in self.values.iter().enumerate().filter_map(|(index, y)| Some((index, (*y)?))) {
            let terms = biquadratic(index, size);
            gram += terms * terms.transpose();
            rhs += terms * value;
        }
        gram.cholesky().map_or_else(Trend::zeros, |factor| factor.solve(&rhs))
    }
}

/// Terms of the null space of the penalty.
const TREND: usize = NULLITY * NULLITY;
type Trend = SVector<f64, TREND>;

/// Returns the terms x^p y^q, p and q up to 2, of a value of a grid; x and y run from -1 to 1.
fn biquadratic(index: usize, [n_u, n_v]: [usize; 2]) -> Trend {
    let place = |k: usize, n: usize| 2.0 * place_in_spans(k) / (n / 2) as f64 - 1.0;
    let (x, y) = (place(index % n_u, n_u), place(index / n_u, n_v));
    let powers = |x: f64| [1.0, x, x * x];
    Trend::from_fn(|term, _| powers(x)[term % NULLITY] * powers(y)[term / NULLITY])
}

/// Basis of an axis in which data and penalty are diagonal.
struct AxisSpectrum {
    /// Transform from grid values to coordinates.
    transform: DMatrix<f64>,
    /// The penalty's eigenvalues relative to those of the data; exactly 0 in the null space.
    roughness: DVector<f64>,
}

impl AxisSpectrum {
    fn new(axis: &UniformKnots) -> Self {
        let n = axis.n_coefficients();
        let mut basis = DMatrix::zeros(2 * axis.n_spans(), n);
        for j in 0..2 * axis.n_spans() {
            let (first, values) = axis.values(axis.start() + axis.step() * place_in_spans(j));
            (0..4).for_each(|i| basis[(j, first + i)] = values[i]);
        }
        // Two places per span do not fully determine a spline of few spans; a small multiple of the identity is added.
        let gram = basis.transpose() * &basis + DMatrix::identity(n, n) * 1e-9;
        let rough = axis.roughness();
        let penalty = DMatrix::from_fn(n, n, |i, j| {
            let (low, high) = (i.min(j), i.max(j));
            if high - low > 3 { 0.0 } else { rough[low][high - low] }
        });
        let lower = gram.cholesky().map_or_else(|| DMatrix::identity(n, n), |c| c.unpack());
        let solve = |m: &DMatrix<f64>| lower.solve_lower_triangular(m).unwrap_or_else(|| m.clone());
        let whitened = solve(&solve(&penalty).transpose());
        let eigen = SymmetricEigen::new((&whitened + whitened.transpose()) * 0.5);
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
        let vectors = DMatrix::from_fn(n, n, |i, j| eigen.eigenvectors[(i, order[j])]);
        let roughness =
            DVector::from_fn(n, |j, _| if j < NULLITY { 0.0 } else { eigen.eigenvalues[order[j]].max(0.0) });
        Self { transform: vectors.transpose() * solve(&basis.transpose()), roughness }
    }
}

/// Restricted likelihood of one grid of values.
struct RestrictedLikelihood<'a> {
    u: &'a AxisSpectrum,
    v: &'a AxisSpectrum,
    /// Coordinates of the values, u down, v across.
    coordinates: DMatrix<f64>,
    /// Squares of the coordinates.
    squares: DMatrix<f64>,
    /// Sum of squares that no spline of this net can represent.
    outside: f64,
    n_values: usize,
}

impl<'a> RestrictedLikelihood<'a> {
    fn new(u: &'a AxisSpectrum, v: &'a AxisSpectrum, values: &DMatrix<f64>) -> Self {
        let coordinates = &u.transform * values * v.transform.transpose();
        let squares = coordinates.map(|z| z * z);
        let outside = (values.norm_squared() - squares.sum()).max(0.0);
        Self { u, v, coordinates, squares, outside, n_values: values.len() }
    }

    /// Fills the gaps of the values with the spline at exponents `x`, repeatedly, so that the gaps finally have no
    /// effect on it.
    fn refill(&mut self, values: &mut DMatrix<f64>, gaps: &[(usize, usize)], x: [f64; 2]) {
        for _ in 0..ROUNDS {
            let smooth = self.smoothed(x);
            gaps.iter().for_each(|&cell| values[cell] = smooth[cell]);
            *self = Self::new(self.u, self.v, values);
        }
    }

    /// Returns the penalty's factors at exponents `x`.
    fn scales(&self, x: [f64; 2]) -> [f64; 2] {
        let largest = |s: &AxisSpectrum| s.roughness.max().max(f64::MIN_POSITIVE);
        [10f64.powf(x[0]) / largest(self.u), 10f64.powf(x[1]) / largest(self.v)]
    }

    /// Returns the penalised sum of squares, and ln det of data + penalty over penalty, without the null space.
    fn terms(&self, x: [f64; 2]) -> (f64, f64) {
        let [su, sv] = self.scales(x);
        let (mut square, mut log_det) = (self.outside, 0.0);
        for (column, rv) in self.squares.column_iter().zip(self.v.roughness.iter()) {
            let mut product = 1.0;
            for (j, (z2, ru)) in column.iter().zip(self.u.roughness.iter()).enumerate() {
                let d = su * ru + sv * rv;
                square += z2 * d / (1.0 + d);
                if d > 0.0 {
                    product *= (1.0 + d) / d;
                }
                if j % 8 == 7 {
                    log_det += product.ln();
                    product = 1.0;
                }
            }
            log_det += product.ln();
        }
        (square, log_det)
    }

    /// Returns the share of the spline's posterior variance that is scatter due to noise, both summed over the
    /// coordinates: a coordinate shrunk by the factor f scatters by f^2 of its noise and has a posterior variance of f
    /// of it.
    fn noise_share(&self, x: [f64; 2]) -> f64 {
        let [su, sv] = self.scales(x);
        let kept = |ru: &f64, rv: &f64| 1.0 / (1.0 + su * ru + sv * rv);
        let all =
            || self.v.roughness.iter().flat_map(|rv| self.u.roughness.iter().map(move |ru| kept(ru, rv)));
        all().map(|f| f * f).sum::<f64>() / all().sum::<f64>()
    }

    /// Returns the variance of a grid value at exponents `x`.
    fn noise(&self, x: [f64; 2]) -> f64 {
        (self.terms(x).0 / (self.n_values - NULLITY * NULLITY) as f64).max(f64::MIN_POSITIVE)
    }

    /// Returns -2 ln of the restricted likelihood, up to a constant.
    fn value(&self, x: [f64; 2]) -> f64 {
        let (square, log_det) = self.terms(x);
        (self.n_values - NULLITY * NULLITY) as f64 * square.max(f64::MIN_POSITIVE).ln() + log_det
    }

    /// Finds the exponents of the largest likelihood by a coarse grid, then a search with halved steps.
    fn minimise(&self) -> [f64; 2] {
        let (low, high) = EXPONENTS;
        let coarse = |k: usize| low + (high - low) * k as f64 / 5.0;
        let mut best = ([low, low], f64::INFINITY);
        for x in (0..36).map(|k| [coarse(k % 6), coarse(k / 6)]) {
            let value = self.value(x);
            if value < best.1 {
                best = (x, value);
            }
        }
        let mut step = (high - low) / 10.0;
        while step > 0.5 * LAST_STEP {
            let from = best;
            for [du, dv] in [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]] {
                let x = [from.0[0] + du * step, from.0[1] + dv * step].map(|e: f64| e.clamp(low, high));
                let value = self.value(x);
                if value < best.1 {
                    best = (x, value);
                }
            }
            if best.0 == from.0 {
                step *= 0.5;
            }
        }
        best.0
    }

    /// Returns the grid values of the spline at exponents `x`.
    fn smoothed(&self, x: [f64; 2]) -> DMatrix<f64> {
        let [su, sv] = self.scales(x);
        let shrunk = DMatrix::from_fn(self.coordinates.nrows(), self.coordinates.ncols(), |i, k| {
            self.coordinates[(i, k)] / (1.0 + su * self.u.roughness[i] + sv * self.v.roughness[k])
        });
        self.u.transform.transpose() * shrunk * &self.v.transform
    }
}
