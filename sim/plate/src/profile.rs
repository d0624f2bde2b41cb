//! Plane curve of given curvature: its intrinsic equation integrated by Chebyshev series.
//!
//! The tangent angle is the exact integral of a piecewise quintic curvature; positions are integrals of its cosine and
//! sine, taken as Chebyshev series that are exact to rounding (tested against arcs and Simpson's rule to 1e-12 m).

/// Smooth change of curvature by `change` (1/m) about `at`, over `width` (m): the quintic 6 x^5 - 15 x^4 + 10 x^3.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Step {
    pub(crate) at: f64,
    pub(crate) width: f64,
    pub(crate) change: f64,
}

impl Step {
    /// Returns the curvature added at `s` and its antiderivative (zero before the step).
    fn curvature_and_angle(&self, s: f64) -> (f64, f64) {
        let x = (s - self.at) / self.width + 0.5;
        if x <= 0.0 {
            (0.0, 0.0)
        } else if x >= 1.0 {
            (self.change, self.change * (s - self.at))
        } else {
            let x3 = x * x * x;
            let rise = x3 * (10.0 - 15.0 * x + 6.0 * x * x);
            let area = x3 * x * (2.5 - 3.0 * x + x * x);
            (self.change * rise, self.change * area * self.width)
        }
    }

    /// Returns the derivative of the curvature added at `s`, 1/m^2.
    fn curvature_slope(&self, s: f64) -> f64 {
        let x = ((s - self.at) / self.width + 0.5).clamp(0.0, 1.0);
        30.0 * (x * (1.0 - x)).powi(2) * self.change / self.width
    }
}

/// Number of Chebyshev coefficients per interval.
const N: usize = 12;

/// Longest interval, metres. With 12 coefficients the series of the sharpest bend of a press (radius 0.2 m) is
/// exact to rounding.
const LONGEST: f64 = 0.05;

/// Chebyshev series on one interval of arc length.
#[derive(Debug, Clone)]
struct Interval {
    middle: f64,
    half: f64,
    /// Coefficients of x, z, tangent angle and curvature side by side: their recurrences run together. For speed only:
    /// `platen demo`.
    series: [[f64; 4]; N],
}

/// Point of a profile: position, tangent angle and curvature at an arc length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Place {
    pub(crate) x: f64,
    pub(crate) z: f64,
    pub(crate) angle: f64,
    pub(crate) curvature: f64,
}

/// Plane curve of unit speed through the origin at s = 0, where its tangent is +x; it bends towards +z where
/// its curvature is positive.
#[derive(Debug, Clone)]
pub(crate) struct Profile {
    initial: f64,
    steps: Vec<Step>,
    starts: Vec<f64>,
    intervals: Vec<Interval>,
}

impl Profile {
    /// Creates the curve with curvature `initial` (1/m) before all `steps`, prepared for |s| <= `reach` (m).
    pub(crate) fn new(initial: f64, mut steps: Vec<Step>, reach: f64) -> Self {
        steps.sort_by(|a, b| a.at.total_cmp(&b.at));
        let mut profile = Self { initial, steps, starts: Vec::new(), intervals: Vec::new() };
        let angle_at_origin = profile.raw_angle(0.0);
        for (from, to) in profile.cuts(reach) {
            let interval = profile.interval(from, to, angle_at_origin);
            profile.starts.push(from);
            profile.intervals.push(interval);
        }
        profile.join();
        profile
    }

    /// Returns true when the curve is a straight line.
    pub(crate) fn is_straight(&self) -> bool {
        self.initial == 0.0 && self.steps.iter().all(|s| s.change == 0.0)
    }

    fn curvature(&self, s: f64) -> f64 {
        self.steps.iter().fold(self.initial, |sum, step| sum + step.curvature_and_angle(s).0)
    }

    /// Returns the derivative of the curvature, 1/m^2.
    pub(crate) fn curvature_slope(&self, s: f64) -> f64 {
        self.steps.iter().map(|step| step.curvature_slope(s)).sum()
    }

    fn raw_angle(&self, s: f64) -> f64 {
        self.steps.iter().fold(self.initial * s, |sum, step| sum + step.curvature_and_angle(s).1)
    }

    /// Returns intervals that end where a step starts or ends, none longer than [`LONGEST`]; one starts at 0.
    fn cuts(&self, reach: f64) -> Vec<(f64, f64)> {
        let ends = self.steps.iter().flat_map(|s| [s.at - s.width / 2.0, s.at + s.width / 2.0]);
        let mut cuts: Vec<f64> = ends.filter(|s| s.abs() < reach).chain([-reach, 0.0, reach]).collect();
        cuts.sort_by(f64::total_cmp);
        cuts.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
        let mut intervals = Vec::new();
        for pair in cuts.windows(2) {
            let n = ((pair[1] - pair[0]) / LONGEST).ceil().max(1.0);
            let at = |i: f64| pair[0] + (pair[1] - pair[0]) * i / n;
            intervals.extend((0..n as usize).map(|i| (at(i as f64), at(i as f64 + 1.0))));
        }
        intervals
    }

    fn interval(&self, from: f64, to: f64, angle_at_origin: f64) -> Interval {
        let (middle, half) = ((from + to) / 2.0, (to - from) / 2.0);
        let at = |t: f64| self.raw_angle(middle + half * t) - angle_at_origin;
        let x = integral(&series(|t| at(t).cos()), half);
        let z = integral(&series(|t| at(t).sin()), half);
        let (angle, curvature) = (series(at), series(|t| self.curvature(middle + half * t)));
        Interval { middle, half, series: std::array::from_fn(|k| [x[k], z[k], angle[k], curvature[k]]) }
    }

    /// Shifts the positions of the intervals so that the curve is continuous and passes through the origin at 0.
    fn join(&mut self) {
        let origin = self.index(0.0);
        let (before, after) = self.intervals.split_at_mut(origin);
        join_in_turn(after.iter_mut(), 1.0);
        join_in_turn(before.iter_mut().rev(), -1.0);
    }

    fn index(&self, s: f64) -> usize {
        self.starts.partition_point(|start| *start <= s).clamp(1, self.starts.len()) - 1
    }

    /// Returns the point at arc length `s`. Beyond the reach the curve continues along its end tangents.
    pub(crate) fn at(&self, s: f64) -> Place {
        let interval = &self.intervals[self.index(s)];
        let t = (s - interval.middle) / interval.half;
        let inside = t.clamp(-1.0, 1.0);
        let [x, z, angle, curvature] = values(&interval.series, inside);
        let beyond = (t - inside) * interval.half;
        if beyond == 0.0 {
            return Place { x, z, angle, curvature };
        }
        let (sin, cos) = angle.sin_cos();
        Place { x: x + beyond * cos, z: z + beyond * sin, angle, curvature: 0.0 }
    }
}

/// Returns the Chebyshev coefficients of `f` on [-1, 1] by interpolation in the Chebyshev points; coefficient 0 is not
/// halved.
fn series(f: impl Fn(f64) -> f64) -> [f64; N] {
    let angle = |j: usize| std::f64::consts::PI * (j as f64 + 0.5) / N as f64;
    let values: [f64; N] = std::array::from_fn(|j| f(angle(j).cos()));
    std::array::from_fn(|k| {
        let sum: f64 = (0..N).map(|j| values[j] * (k as f64 * angle(j)).cos()).sum();
        sum * if k == 0 { 1.0 } else { 2.0 } / N as f64
    })
}

/// Returns the antiderivative of a series with respect to arc length (`half` is half the interval), zero constant.
fn integral(c: &[f64; N], half: f64) -> [f64; N] {
    let coefficient = |k: usize| if k < N { c[k] } else { 0.0 };
    std::array::from_fn(|k| match k {
        0 => 0.0,
        1 => half * (c[0] - coefficient(2) / 2.0),
        _ => half * (coefficient(k - 1) - coefficient(k + 1)) / (2.0 * k as f64),
    })
}

/// Shifts the positions of intervals that follow each other from the origin on, towards arc length of this sign.
fn join_in_turn<'a>(intervals: impl Iterator<Item = &'a mut Interval>, sign: f64) {
    let mut joint = [0.0; 2];
    for Interval { series, .. } in intervals {
        let [x, z, ..] = values(series, -sign);
        series[0][0] += joint[0] - x;
        series[0][1] += joint[1] - z;
        let [x, z, ..] = values(series, sign);
        joint = [x, z];
    }
}

/// Evaluates series at `t` by Clenshaw's recurrence.
fn values(series: &[[f64; 4]; N], t: f64) -> [f64; 4] {
    let (mut b1, mut b2) = ([0.0; 4], [0.0; 4]);
    for c in series[1..].iter().rev() {
        (b1, b2) = (std::array::from_fn(|m| 2.0 * t * b1[m] - b2[m] + c[m]), b1);
    }
    std::array::from_fn(|m| t * b1[m] - b2[m] + series[0][m])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constant_curvature_is_an_arc() {
        let profile = Profile::new(0.2, Vec::new(), 3.0);
        for s in [-2.9_f64, -0.3, 0.0, 1.0, 2.999] {
            let place = profile.at(s);
            assert!((place.x - 5.0 * (s / 5.0).sin()).abs() < 1e-14);
            assert!((place.z - 5.0 * (1.0 - (s / 5.0).cos())).abs() < 1e-14);
            assert!((place.angle - 0.2 * s).abs() < 1e-15);
        }
    }

    #[test]
    fn bands_agree_with_simpsons_rule() {
        let steps = vec![
            Step { at: -0.2, width: 0.1, change: 1.5 },
            Step { at: -0.1, width: 0.1, change: -1.5 },
            Step { at: 0.6, width: 0.05, change: -5.0 },
            Step { at: 0.65, width: 0.05, change: 5.0 },
        ];
        let profile = Profile::new(0.1, steps, 1.5);
        for end in [-1.4, 1.4] {
            let n = 200_000;
            let h = end / f64::from(n);
            let (mut x, mut z) = (0.0, 0.0);
            let angle = |i: f64| profile.raw_angle(i * h) - profile.raw_angle(0.0);
            for i in 0..n {
                let a = [angle(f64::from(i)), angle(f64::from(i) + 0.5), angle(f64::from(i) + 1.0)];
                x += h / 6.0 * (a[0].cos() + 4.0 * a[1].cos() + a[2].cos());
                z += h / 6.0 * (a[0].sin() + 4.0 * a[1].sin() + a[2].sin());
            }
            let place = profile.at(end);
            assert!((place.x - x).abs() < 1e-12 && (place.z - z).abs() < 1e-12, "{place:?} {x} {z}");
        }
    }

    #[test]
    fn angle_is_the_integral_of_the_curvature() {
        let profile = Profile::new(0.0, vec![Step { at: 0.3, width: 0.2, change: 0.4 }], 1.0);
        for s in [0.21, 0.25, 0.33, 0.39, 0.7] {
            let slope = (profile.at(s + 1e-5).angle - profile.at(s - 1e-5).angle) / 2e-5;
            assert!((slope - profile.at(s).curvature).abs() < 1e-8);
        }
    }
}
