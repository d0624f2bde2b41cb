//! One edge in its rolled-out strip: a stiff curve through the intervals in which the lattice says it lies.
//!
//! Every row and column that leaves the face brackets the edge between its last cell inside and its first one outside
//! (or, at a side face, locates it). The likelihood of the curve is the product of the probabilities of those brackets.
//! It is unbiased where the middle of the bracket is not: where the edge runs along a lattice row its brackets are
//! all alike but for the few cells where it changes rows, and those few locate it.

use nalgebra::Vector2;

use super::OutlineError;
use super::spline::{Normal, Precision, Roughness, Spline};
use super::strip::Strip;
use crate::Vec3;
use crate::patch::{Beyond, Crossing};
use crate::surface::Axis;

/// Span of the curve, metres.
const SPAN: f64 = 0.25;

/// A cut edge, rolled out, is straight but for the strain of the face at a bend band and the torch's own waviness:
/// curvature, 1/m, over a length, metres.
const CURVATURE: (f64, f64) = (0.02, 0.3);

/// Softness of a bracket in parts of the lattice step: the beam's footprint and its pointing.
const SOFTNESS: f64 = 0.05;

/// Part of the brackets that may have nothing to do with the edge, and how far off they may be, in steps.
const STRAY_PART: f64 = 0.05;
const STRAY_STEPS: f64 = 10.0;

const ROUNDS: usize = 40;

/// What a crossing says of the edge, in the strip.
#[derive(Debug, Clone, Copy)]
struct Bracket {
    along: f64,
    /// Between these distances inwards.
    low: f64,
    high: f64,
    soft: f64,
}

/// An edge as a curve in its strip.
#[derive(Debug, Clone)]
pub(super) struct Edge {
    strip: Strip,
    curve: Spline,
    precision: Precision,
    /// Places along the edge of crossings that agree with it, sorted.
    seen: Vec<f64>,
    pub(super) from: f64,
    pub(super) to: f64,
}

impl Edge {
    /// Fits the edge from `from` to `to` to the crossings along it.
    ///
    /// # Errors
    /// [`OutlineError::Edge`] when too little of it is seen.
    pub(super) fn fit(
        crossings: &[&Crossing],
        from: Vec3,
        to: Vec3,
        step: f64,
        noise: f64,
    ) -> Result<Self, OutlineError> {
        let strip = Strip::new(crossings, from, to, step, noise)?;
        let (start, end) = strip.span();
        let axis = Axis::new(start, end, ((end - start) / SPAN).ceil() as usize);
        let brackets: Vec<Bracket> = crossings.iter().map(|c| bracket(&strip, c, step)).collect();
        let too_few = || OutlineError::Edge { crossings: crossings.len() };
        let prior = Normal::with_prior(axis, Roughness::Curvature, CURVATURE.0, CURVATURE.1);
        let mut state: Option<(Spline, Precision)> = None;
        for round in 0..ROUNDS {
            let mut normal = prior.clone();
            let mut moved = 0.0_f64;
            for b in &brackets {
                let at = state.as_ref().map_or_else(|| 0.0, |(curve, _)| curve.at(b.along));
                // The first rounds pull towards the middles, from far away.
                let soft = b.soft.max(2.0 * step * 0.5_f64.powi(round as i32));
                let (pull, weight) =
                    if state.is_none() { b.towards_middle(step) } else { b.evidence(at, soft, step) };
                normal.add(b.along, at + pull, weight);
            }
            let next = normal.solve().ok_or_else(too_few)?;
            if let Some((curve, _)) = &state {
                moved = brackets
                    .iter()
                    .map(|b| (curve.at(b.along) - next.0.at(b.along)).abs())
                    .fold(0.0, f64::max);
            }
            let done = round > 8 && moved < 1e-7;
            state = Some(next);
            if done {
                break;
            }
        }
        let (curve, precision) = state.ok_or_else(too_few)?;
        let mut seen: Vec<f64> = brackets
            .iter()
            .filter(|b| (b.low - step..b.high + step).contains(&curve.at(b.along)))
            .map(|b| b.along)
            .collect();
        seen.sort_by(f64::total_cmp);
        let (from, to) = (strip.flatten(from).x, strip.flatten(to).x);
        Ok(Self { strip, curve, precision, seen, from, to })
    }

    /// The point of the edge at a distance along it.
    pub(super) fn point(&self, along: f64) -> Vec3 {
        self.strip.lift(Vector2::new(along, self.curve.at(along)))
    }

    /// Place along the edge nearest to a point.
    pub(super) fn along(&self, point: Vec3) -> f64 {
        self.strip.flatten(point).x
    }

    /// Length of the edge's parallel at a depth below the face, metres.
    pub(super) fn length_below(&self, depth: f64) -> f64 {
        const PARTS: usize = 256;
        let at = |i: usize| {
            let along = self.from + (self.to - self.from) * i as f64 / PARTS as f64;
            self.point(along) - self.strip.normal(along) * depth
        };
        (0..PARTS).map(|i| (at(i + 1) - at(i)).norm()).sum()
    }

    /// Standard deviation across the edge, metres.
    pub(super) fn sigma(&self, along: f64) -> f64 {
        self.precision.variance(along).sqrt()
    }

    /// True when the edge was seen within `reach` of a place along it.
    pub(super) fn is_seen(&self, along: f64, reach: f64) -> bool {
        let next = self.seen.partition_point(|s| *s < along - reach);
        self.seen.get(next).is_some_and(|s| *s <= along + reach)
    }
}

fn bracket(strip: &Strip, crossing: &Crossing, step: f64) -> Bracket {
    let (inside, outside) = (strip.flatten(crossing.inside), strip.flatten(crossing.outside));
    let along = 0.5 * (inside.x + outside.x);
    let (low, high) = (inside.y.min(outside.y), inside.y.max(outside.y));
    let soft = SOFTNESS * step;
    match crossing.beyond {
        // Given as two standard deviations about the crease.
        Beyond::SideFace => {
            let middle = 0.5 * (low + high);
            Bracket { along, low: middle, high: middle, soft: soft.hypot(0.25 * (high - low)) }
        }
        _ => Bracket { along, low, high, soft },
    }
}

impl Bracket {
    /// (distance, weight) of a pull to the middle with the variance of a uniform distribution.
    fn towards_middle(&self, step: f64) -> (f64, f64) {
        let width = (self.high - self.low).max(step);
        (0.5 * (self.low + self.high), 12.0 / (width * width))
    }

    /// One step of the likelihood's Newton iteration for an edge at `at`: where the bracket pulls it, and with which
    /// weight. The weight fades where the bracket more likely has nothing to do with the edge.
    fn evidence(&self, at: f64, soft: f64, step: f64) -> (f64, f64) {
        let stray = STRAY_PART / (STRAY_STEPS * step);
        if self.high - self.low < 1e-6 * step {
            let off = (self.low - at) / soft;
            let density = (-0.5 * off * off).exp() / (soft * (2.0 * std::f64::consts::PI).sqrt());
            let mine = (1.0 - STRAY_PART) * density;
            return (self.low - at, mine / (mine + stray) / (soft * soft));
        }
        let (a, b) = ((self.low - at) / soft, (self.high - at) / soft);
        let inside = (normal_cdf(b) - normal_cdf(a)).max(1e-12);
        // First and second derivative of ln(inside) by `at`, in units of softness.
        let slope = (normal_pdf(a) - normal_pdf(b)) / inside;
        let curve = (a * normal_pdf(a) - b * normal_pdf(b)) / inside - slope * slope;
        let mine = (1.0 - STRAY_PART) * inside / (self.high - self.low);
        let belongs = mine / (mine + stray);
        // ln(inside) is concave; where it is nearly flat a small weight keeps the step finite.
        let weight = (-curve).max(1e-3);
        (soft * slope / weight, belongs * weight / (soft * soft))
    }
}

fn normal_pdf(x: f64) -> f64 {
    (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt()
}

/// Abramowitz and Stegun 7.1.26, to 1.5e-7, which is far below what a bracket knows.
fn normal_cdf(x: f64) -> f64 {
    let z = x.abs() / std::f64::consts::SQRT_2;
    let t = 1.0 / (1.0 + 0.327_591_1 * z);
    let series = [0.254_829_592, -0.284_496_736, 1.421_413_741, -1.453_152_027, 1.061_405_429];
    let tail = t * series.iter().rev().fold(0.0, |sum, c| sum * t + c) * (-z * z).exp();
    if x < 0.0 { 0.5 * tail } else { 1.0 - 0.5 * tail }
}
