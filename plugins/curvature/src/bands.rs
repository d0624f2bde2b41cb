//! Bend bands: angle, size and uncertainty of a patch of changed curvature.

use std::f64::consts::PI;

use platen_sdk::PlateGrid;
use platen_shape::surface::Curvature;
use platen_shape::{EXPANDED, Surface};

/// Patch of the plate that bent in one sense.
#[derive(Debug, Clone)]
pub(crate) struct Band {
    /// Rotation of the plate from one side of the band to the other, radians, positive towards the scanner.
    pub(crate) angle: f64,
    /// Sense of the patch, 1 or -1. It differs from that of the angle if the patch is the spline's overshoot beside a
    /// stronger band.
    sense: f64,
    /// Expanded uncertainty (95 %), radians.
    pub(crate) uncertainty: f64,
    /// Weighted centre of the patch, (u, v), metres.
    pub(crate) centre: [f64; 2],
    /// Direction of the straight lines, from u towards v, 0 to pi.
    pub(crate) direction: f64,
    /// Extent along the straight lines, metres.
    pub(crate) length: f64,
    /// Extent across them, metres.
    pub(crate) width: f64,
    /// Nodes of the patch.
    pub(crate) nodes: Vec<usize>,
    /// Unit direction across the band.
    across: [f64; 2],
    /// Range across and range along the band, in the coordinates of these directions, metres.
    span: [[f64; 2]; 2],
}

/// Reach of the spline's overshoot beside a narrow bend, metres: two or three knot spans.
const OVERSHOOT: f64 = 0.2;

impl Band {
    /// Returns whether the band bends in the sense of its patch by more than chance. Patches are selected as the most
    /// extreme places of a map. On a plate without change their angles reach one and a half times the uncertainty of an
    /// unselected place.
    pub(crate) fn is_significant(&self) -> bool {
        self.sense * self.angle > 2.0 * self.uncertainty
    }

    /// Returns whether `other` lies within the overshoot of this band.
    pub(crate) fn overshoots_into(&self, other: &Self) -> bool {
        let ([x, y], [u, v], [across, along]) = (self.across, other.centre, self.span);
        let within = |s: f64, [from, to]: [f64; 2]| (from - OVERSHOOT..=to + OVERSHOOT).contains(&s);
        within(x * u + y * v, across) && within(x * v - y * u, along)
    }
}

/// Number of lines across a band over which its change is averaged.
const LINES: usize = 15;

/// Step along them, metres, a tenth of a knot span.
const STEP: f64 = 5e-3;

/// Share of its peak to which the change has decreased at the foot of a band.
const FOOT: f64 = 0.25;

/// Length of the integration beyond the foot, metres. The spline overshoots beside a narrow bend, and only the integral
/// including the overshoot is the plate's rotation. The length is fixed, because limits at the change of sign would
/// select noise of one sign.
const BEYOND: f64 = 0.1;

/// Half step of the difference quotients in the uncertainty, metres.
const SLOPE_STEP: f64 = 5e-3;

/// Measures the band of a patch of nodes between the surfaces `[now, before]`.
pub(crate) fn measure(
    surfaces: [&Surface; 2],
    grid: PlateGrid,
    patch: &[usize],
    change: &[Curvature],
) -> Band {
    let sum = |take: fn(&Curvature) -> f64| patch.iter().map(|&i| take(&change[i])).sum::<f64>();
    let total = Curvature::from_form(sum(|k| k.u), sum(|k| k.v), sum(|k| k.uv));
    let section = Section::new(surfaces, grid, patch, total.strongest_direction());
    let sense = total.strongest().signum();
    let [from, to] = section.ends(sense);
    let terms = section.rotation(from, to);
    let sigma = surfaces[0].sigma_of_heights(&terms).hypot(surfaces[1].sigma_of_heights(&terms));
    let weight = |i: usize| change[i].strongest().abs();
    let weights: f64 = patch.iter().map(|&i| weight(i)).sum();
    let middle = |k: usize| patch.iter().map(|&i| weight(i) * grid.at(i)[k]).sum::<f64>() / weights;
    let [x, y] = section.across;
    Band {
        angle: section.angle(from, to),
        sense,
        uncertainty: EXPANDED * sigma,
        centre: [middle(0), middle(1)],
        direction: (x.atan2(-y) + PI).rem_euclid(PI),
        length: section.along[1] - section.along[0],
        width: to - from,
        nodes: patch.to_vec(),
        across: section.across,
        span: [[from, to], section.along],
    }
}

/// Section across a band, averaged along it.
struct Section<'a> {
    surfaces: [&'a Surface; 2],
    /// Unit direction of the largest change.
    across: [f64; 2],
    /// Range of the patch along the band, metres.
    along: [f64; 2],
    /// Range across it, metres.
    reach: [f64; 2],
}

impl<'a> Section<'a> {
    fn new(surfaces: [&'a Surface; 2], grid: PlateGrid, patch: &[usize], across @ [x, y]: [f64; 2]) -> Self {
        let range = |[a, b]: [f64; 2]| {
            let values = patch.iter().map(|&i| grid.at(i)).map(|[u, v]| a * u + b * v);
            values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], s| [low.min(s), high.max(s)])
        };
        Self { surfaces, across, along: range([-y, x]), reach: range([x, y]) }
    }

    /// Returns points on the plate at distance `s` across the band, distributed along it.
    fn places(&self, s: f64) -> impl Iterator<Item = [f64; 2]> {
        let ([x, y], [first, last], now) = (self.across, self.along, self.surfaces[0]);
        (0..LINES)
            .map(move |k| first + (last - first) * (k as f64 + 0.5) / LINES as f64)
            .map(move |t| [x * s - y * t, y * s + x * t])
            .filter(|[u, v]| (0.0..=now.width()).contains(u) && (0.0..=now.height()).contains(v))
    }

    /// Returns the change of curvature across the band, averaged along it; 0 beyond the plate.
    fn change(&self, s: f64) -> f64 {
        let at = |surface: &Surface, [u, v]: [f64; 2]| surface.curvature(u, v).along(self.across);
        let [now, before] = self.surfaces;
        let (n, sum) = self
            .places(s)
            .fold((0, 0.0), |(n, sum), place| (n + 1, sum + at(now, place) - at(before, place)));
        sum / f64::from(n.max(1))
    }

    /// Returns the limits of integration on both sides of the largest change.
    fn ends(&self, sense: f64) -> [f64; 2] {
        let [first, last] = self.reach;
        let n = ((last - first) / STEP) as usize;
        let at = |k: usize| first + k as f64 * STEP;
        let (peak, most) = (0..=n)
            .map(|k| (at(k), sense * self.change(at(k))))
            .fold((first, f64::NEG_INFINITY), |best, next| if next.1 > best.1 { next } else { best });
        [-1.0, 1.0].map(|way| {
            let reach = if way < 0.0 { peak - first } else { last - peak };
            let mut steps = (1..=(reach / STEP) as usize).map(|k| peak + way * k as f64 * STEP);
            let foot = steps.find(|s| sense * self.change(*s) < FOOT * most).unwrap_or(peak + way * reach);
            let mut beyond = (0..=(BEYOND / STEP) as usize).rev().map(|k| foot + way * k as f64 * STEP);
            beyond.find(|s| 2 * self.places(*s).count() > LINES).unwrap_or(foot)
        })
    }

    /// Integrates the mean change between the limits (Simpson's rule).
    fn angle(&self, from: f64, to: f64) -> f64 {
        let n = 2 * ((to - from) / (2.0 * STEP)).ceil().max(1.0) as usize;
        let h = (to - from) / n as f64;
        let weight = |k: usize| match k {
            _ if k == 0 || k == n => 1.0,
            _ if k % 2 == 1 => 4.0,
            _ => 2.0,
        };
        (0..=n).map(|k| weight(k) * self.change(from + k as f64 * h)).sum::<f64>() * h / 3.0
    }

    /// Returns the mean rotation between the limits as a weighted sum of heights: a difference of slopes.
    fn rotation(&self, from: f64, to: f64) -> Vec<([f64; 2], f64)> {
        let slope = |s: f64, sign: f64| {
            [1.0, -1.0].into_iter().flat_map(move |way| {
                let places: Vec<[f64; 2]> = self.places(s + way * SLOPE_STEP).collect();
                let weight = sign * way * 0.5 / (SLOPE_STEP * places.len().max(1) as f64);
                places.into_iter().map(move |place| (place, weight))
            })
        };
        slope(to, 1.0).chain(slope(from, -1.0)).collect()
    }
}
