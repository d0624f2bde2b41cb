//! Uniform cubic B-splines: basis over an interval divided into equal spans, with its Gram and roughness matrices.

/// The cubic B-splines in one span as polynomials in t = s - 1/2: `BASIS[i][p]` is the coefficient of t^p.
/// s in [0, 1] is the place in the span; centred powers keep moments well conditioned.
pub(crate) const BASIS: [[f64; 4]; 4] = [
    [1.0 / 48.0, -1.0 / 8.0, 1.0 / 4.0, -1.0 / 6.0],
    [23.0 / 48.0, -5.0 / 8.0, -1.0 / 4.0, 1.0 / 2.0],
    [23.0 / 48.0, 5.0 / 8.0, -1.0 / 4.0, -1.0 / 2.0],
    [1.0 / 48.0, 1.0 / 8.0, 1.0 / 4.0, 1.0 / 6.0],
];

/// Uniform knots over an interval, three beyond each end, and the cubic B-splines on them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UniformKnots {
    start: f64,
    step: f64,
    /// One over the step.
    per_step: f64,
    n_spans: usize,
}

/// Values of the four B-splines of one span, and of their derivatives by the parameter.
#[derive(Debug, Clone, Copy)]
pub struct LocalBasis {
    /// Index of the first of the four coefficients, which is also that of the span.
    pub first: usize,
    /// Values.
    pub value: [f64; 4],
    /// First derivatives.
    pub d1: [f64; 4],
    /// Second derivatives.
    pub d2: [f64; 4],
}

impl UniformKnots {
    /// Divides the interval from `start` to `end` (start < end) into `n_spans` (at least 1) equal spans.
    #[must_use]
    pub fn new(start: f64, end: f64, n_spans: usize) -> Self {
        let n_spans = n_spans.max(1);
        let step = (end - start) / n_spans as f64;
        Self { start, step, per_step: 1.0 / step, n_spans }
    }

    /// Divides the interval from 0 to `length` into spans of about `span`: at least 8, at most 128 spans.
    #[must_use]
    pub fn of_length(length: f64, span: f64) -> Self {
        Self::new(0.0, length, ((length / span).round() as usize).clamp(8, 128))
    }

    /// Returns the number of spans.
    #[inline]
    #[must_use]
    pub fn n_spans(&self) -> usize {
        self.n_spans
    }

    /// Returns the number of B-splines, which is that of coefficients: spans + 3.
    #[inline]
    #[must_use]
    pub fn n_coefficients(&self) -> usize {
        self.n_spans + 3
    }

    /// Returns the same interval in half as many spans.
    #[must_use]
    pub fn coarser(&self) -> Self {
        Self::new(self.start, self.end(), self.n_spans / 2)
    }

    /// Returns the start of the interval.
    #[inline]
    #[must_use]
    pub fn start(&self) -> f64 {
        self.start
    }

    /// Returns the end of the interval.
    #[inline]
    #[must_use]
    pub fn end(&self) -> f64 {
        self.start + self.step * self.n_spans as f64
    }

    /// Returns the width of a span.
    #[inline]
    #[must_use]
    pub fn step(&self) -> f64 {
        self.step
    }

    /// Returns the knots: uniform, three beyond each end.
    #[must_use]
    pub fn knots(&self) -> Vec<f64> {
        (0..self.n_spans + 7).map(|k| self.start + (k as f64 - 3.0) * self.step).collect()
    }

    /// Returns the Greville abscissa of a coefficient: the place where a spline of linear coefficients has the value of
    /// this coefficient.
    #[must_use]
    pub fn abscissa(&self, coefficient: usize) -> f64 {
        self.start + (coefficient as f64 - 1.0) * self.step
    }

    /// Reads a knot vector as [`UniformKnots::knots`] returns it; `None` when it is not uniform to a billionth.
    #[must_use]
    pub fn from_knots(knots: &[f64]) -> Option<Self> {
        let n_spans = knots.len().checked_sub(7).filter(|n| *n > 0)?;
        let candidate = Self::new(knots[3], knots[3 + n_spans], n_spans);
        let uniform =
            candidate.knots().iter().zip(knots).all(|(a, b)| (a - b).abs() <= 1e-9 * candidate.step);
        (candidate.step > 0.0 && candidate.step.is_finite() && uniform).then_some(candidate)
    }

    /// Returns the span of `x` and its place t in [-1/2, 1/2] there; beyond the ends the last span is continued.
    #[inline(always)]
    #[must_use]
    pub fn locate(&self, x: f64) -> (usize, f64) {
        let s = (x - self.start) * self.per_step;
        let span = (s.max(0.0) as usize).min(self.n_spans - 1);
        (span, s - span as f64 - 0.5)
    }

    /// Returns the first coefficient and the values of the four B-splines at `x`.
    #[inline]
    #[must_use]
    pub fn values(&self, x: f64) -> (usize, [f64; 4]) {
        let (first, t) = self.locate(x);
        (first, BASIS.map(|[a, b, c, d]| a + t * (b + t * (c + t * d))))
    }

    /// Returns values and two derivatives at `x`.
    #[inline(always)]
    #[must_use]
    pub fn local_basis(&self, x: f64) -> LocalBasis {
        let (first, t) = self.locate(x);
        let (h1, h2) = (self.per_step, self.per_step * self.per_step);
        LocalBasis {
            first,
            value: BASIS.map(|[a, b, c, d]| a + t * (b + t * (c + t * d))),
            d1: BASIS.map(|[_, b, c, d]| h1 * (b + t * (2.0 * c + t * 3.0 * d))),
            d2: BASIS.map(|[_, _, c, d]| h2 * (2.0 * c + t * 6.0 * d)),
        }
    }

    /// Returns the Gram matrix of the B-splines over the interval, by diagonals: `[i][k]` = integral of `B_i B_(i+k)`.
    #[must_use]
    pub fn gram(&self) -> Vec<[f64; 4]> {
        let mut gram = vec![[0.0; 4]; self.n_coefficients()];
        for span in 0..self.n_spans {
            for (i, j) in pairs() {
                // Integral of t^p over [-1/2, 1/2]: 0 for odd p, 2^-p / (p + 1) for even p.
                let product = multiply(&BASIS[i], &BASIS[j]);
                let integral = product[0] + product[2] / 12.0 + product[4] / 80.0 + product[6] / 448.0;
                gram[span + i][j - i] += self.step * integral;
            }
        }
        gram
    }

    /// Returns the integrals of the products of third derivatives, laid out as [`UniformKnots::gram`]: third
    /// differences of the coefficients.
    #[must_use]
    pub fn roughness(&self) -> Vec<[f64; 4]> {
        const THIRD: [f64; 4] = [-1.0, 3.0, -3.0, 1.0];
        let mut roughness = vec![[0.0; 4]; self.n_coefficients()];
        for span in 0..self.n_spans {
            for (i, j) in pairs() {
                roughness[span + i][j - i] += THIRD[i] * THIRD[j] * self.step.powi(-5);
            }
        }
        roughness
    }
}

/// Returns the pairs i <= j of the four B-splines of a span.
pub(crate) fn pairs() -> impl Iterator<Item = (usize, usize)> {
    (0..4).flat_map(|i| (i..4).map(move |j| (i, j)))
}

/// Returns the product of two cubic polynomials.
pub(crate) fn multiply(a: &[f64; 4], b: &[f64; 4]) -> [f64; 7] {
    let mut product = [0.0; 7];
    for (p, x) in a.iter().enumerate() {
        for (q, y) in b.iter().enumerate() {
            product[p + q] += x * y;
        }
    }
    product
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_splines_add_up_to_one_and_reproduce_the_parameter() {
        let knots = UniformKnots::new(-1.0, 2.0, 7);
        for k in 0..=30 {
            let x = -1.0 + 0.1 * f64::from(k);
            let s = knots.local_basis(x);
            assert!((s.value.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            // A coefficient equal to its Greville abscissa gives the parameter itself.
            let x_again: f64 = (0..4).map(|i| s.value[i] * knots.abscissa(s.first + i)).sum();
            let slope: f64 = (0..4).map(|i| s.d1[i] * knots.knots()[s.first + i + 2]).sum();
            let bend: f64 = (0..4).map(|i| s.d2[i] * knots.knots()[s.first + i + 2]).sum();
            assert!((x_again - x).abs() < 1e-13 && (slope - 1.0).abs() < 1e-12 && bend.abs() < 1e-10);
        }
    }

    #[test]
    fn the_gram_matrix_holds_the_textbook_values() {
        // Interior diagonals of the uniform cubic B-spline's Gram matrix: 151/315, 397/1680, 1/42, 1/5040.
        let knots = UniformKnots::new(0.0, 10.0, 10);
        let row = knots.gram()[5];
        for (got, want) in row.iter().zip([151.0 / 315.0, 397.0 / 1680.0, 1.0 / 42.0, 1.0 / 5040.0]) {
            assert!((got - want).abs() < 1e-14, "{got} {want}");
        }
        assert_eq!(knots.roughness()[5], [20.0, -15.0, 6.0, -1.0]);
    }

    #[test]
    fn knots_give_the_axis_back() {
        let knots = UniformKnots::new(0.3, 4.7, 31);
        let again = UniformKnots::from_knots(&knots.knots()).expect("uniform");
        assert_eq!(again.n_spans(), 31);
        assert!((again.end() - 4.7).abs() < 1e-12);
        let mut bent = knots.knots();
        bent[9] += 0.01;
        assert_eq!(UniformKnots::from_knots(&bent), None);
        assert_eq!(UniformKnots::from_knots(&[0.0; 7]), None);
    }
}
