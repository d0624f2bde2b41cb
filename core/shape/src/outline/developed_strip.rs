//! Development of the narrow strip of the face along an edge into the plane, by the geodesic curvature of a base curve.
//!
//! In: the projected crossings of one edge. Out: a map between the strip and the plane, in which `edge` fits a stiff
//! curve.
//!
//! A base curve near the edge is fitted robustly (Tukey's biweight). Its parallel on the mid-surface is developed into
//! the plane: the geodesic curvature is kept, the bending of the surface is removed. In the plane a straight cut is
//! straight however the plate is bent. The mid-surface is developed since on the face itself a bend band askew to the
//! edge shifts the edge by half the thickness times the band's angle.

use nalgebra::Vector2;
use platen_numerics::penalised_curve::{CurveFit, Roughness, SplineCurve};
use platen_numerics::uniform_knots::UniformKnots;

use super::coverage::Coverage;
use super::projected_crossing::ProjectedCrossing;
use super::{OutlineError, Sampling};
use crate::Vec3;

/// Spacing of the base curve's points, metres.
const SPACING: f64 = 0.005;

/// Part of its length by which the base curve continues beyond the corners, to reach corners that are hidden.
const OVERHANG: f64 = 0.06;

/// Spans of the base curve, metres, for its positions across the edge and along the normal; the latter must follow
/// narrow bend bands.
const SPAN_ACROSS: f64 = 0.4;
const SPAN_NORMAL: f64 = 0.1;

/// Prior of the base curve across the edge: seen along the mean normal its curvature is at most about the first figure,
/// 1/m, over a length of the second, metres.
const CURVATURE_ACROSS: (f64, f64) = (0.1, 0.5);

/// Prior of the base curve along the normal: the curvature of a plate changes by at most about the first figure, 1/m^2
/// (0.8 1/m over a bend band of 0.1 m), over a length of the second, metres.
const CURVATURE_CHANGE: (f64, f64) = (8.0, 0.1);

/// Prior of the normals along the base curve, which turn as the plate bends: second derivative of their components,
/// 1/m^2, over a length, metres.
const NORMAL_CHANGE: (f64, f64) = (8.0, 0.1);

/// Least number of crossings on a common curve (sum of their weights).
const LEAST_WEIGHT: f64 = 8.0;

/// Rounds of reweighting, which remove crossings of other edges.
const ROUNDS: usize = 8;

/// One point of the base curve.
#[derive(Debug, Clone, Copy)]
struct Station {
    point: Vec3,
    tangent: Vec3,
    /// Within the face, to the left seen from the scanner: into the plate.
    inward: Vec3,
    /// Place and direction in the plane.
    flat: Vector2<f64>,
    flat_tangent: Vector2<f64>,
}

/// A strip along an edge.
#[derive(Debug, Clone)]
pub(super) struct DevelopedStrip {
    from: Vec3,
    along: Vec3,
    first: f64,
    stations: Vec<Station>,
    /// Coverage of the common curve by crossings, along the chord from its beginning to its end.
    seen: Coverage,
    length: f64,
}

impl DevelopedStrip {
    /// Develops the strip along the edge from `from` to `to`, through the crossings that lie on a common curve.
    ///
    /// `depth` is that of the mid-surface, metres.
    ///
    /// # Errors
    /// [`OutlineError::Edge`] when too little of the edge is seen.
    pub(super) fn new(
        crossings: &[ProjectedCrossing],
        [from, to]: [Vec3; 2],
        depth: f64,
        sampling: Sampling,
    ) -> Result<Self, OutlineError> {
        let Sampling { step, noise, .. } = sampling;
        let along = (to - from).normalize();
        let mean_normal: Vec3 = crossings.iter().map(|s| s.crossing.normal).sum();
        let inward = mean_normal.cross(&along).normalize();
        let up = along.cross(&inward);
        let length = (to - from).norm();
        let (start, end) = (-OVERHANG * length, (1.0 + OVERHANG) * length);
        let axis = |span: f64| UniformKnots::new(start, end, ((end - start) / span).ceil() as usize);
        let local = |p: Vec3| Vec3::new((p - from).dot(&along), (p - from).dot(&inward), (p - from).dot(&up));
        let data: Vec<(Vec3, Vec3)> = crossings
            .iter()
            .map(|ProjectedCrossing { crossing: c, .. }| {
                let n = Vec3::new(c.normal.dot(&along), c.normal.dot(&inward), c.normal.dot(&up));
                (local(0.5 * (c.inside + c.outside)), n)
            })
            .collect();
        let none = OutlineError::Edge { seen_percent: 0.0 };
        let (across, weights) = robust_across(axis(SPAN_ACROSS), &data, step).ok_or(none)?;
        let on_it = data.iter().zip(&weights).filter(|(_, w)| **w > 0.5).map(|((p, _), _)| p.x);
        let seen = Coverage::new(on_it, step);
        let too_few = || too_few(&seen, length);
        if weights.iter().sum::<f64>() <= LEAST_WEIGHT {
            return Err(too_few());
        }
        let mut height = CurveFit::with_prior(
            axis(SPAN_NORMAL),
            Roughness::CurvatureChange,
            CURVATURE_CHANGE.0,
            CURVATURE_CHANGE.1,
        );
        let tilt = |k: fn(&Vec3) -> f64| {
            let mut fit = CurveFit::with_prior(
                axis(SPAN_NORMAL),
                Roughness::Curvature,
                NORMAL_CHANGE.0,
                NORMAL_CHANGE.1,
            );
            for ((p, n), w) in data.iter().zip(&weights) {
                // The tilt of a local fit is uncertain by about its noise over its width of ten steps.
                fit.add(p.x, k(n), w * (10.0 * step / noise).powi(2));
            }
            fit.solve().map(|(spline, _)| spline)
        };
        for ((p, n), w) in data.iter().zip(&weights) {
            // Height of the crossing moved along the face to the base curve.
            let moved = p.z - n.y / n.z * (across.at(p.x) - p.y);
            height.add(p.x, moved, w / (noise * noise));
        }
        let (height, _) = height.solve().ok_or_else(too_few)?;
        let (n_x, n_y) = (tilt(|n| n.x / n.z).ok_or_else(too_few)?, tilt(|n| n.y / n.z).ok_or_else(too_few)?);
        let n_stations = ((end - start) / SPACING).ceil() as usize + 1;
        let points: Vec<(Vec3, Vec3)> = (0..n_stations)
            .map(|i| {
                let x = start + SPACING * i as f64;
                let point = from + along * x + inward * across.at(x) + up * height.at(x);
                (point, (along * n_x.at(x) + inward * n_y.at(x) + up).normalize())
            })
            .collect();
        Ok(Self { from, along, first: start, stations: develop(&points, depth), seen, length })
    }

    /// Returns the error of a strip with too few crossings.
    pub(super) fn too_few(&self) -> OutlineError {
        too_few(&self.seen, self.length)
    }

    /// Maps a point near the edge, on the face, to (along, inwards) in the plane, metres.
    pub(super) fn flatten(&self, point: Vec3) -> Vector2<f64> {
        let x = ((point - self.from).dot(&self.along) - self.first) / SPACING;
        let station = &self.stations[(x.round().max(0.0) as usize).min(self.stations.len() - 1)];
        let off = point - station.point;
        let (t, n) = (station.flat_tangent, Vector2::new(-station.flat_tangent.y, station.flat_tangent.x));
        station.flat + t * off.dot(&station.tangent) + n * off.dot(&station.inward)
    }

    /// Maps a place of the plane to the face: the inverse of [`Self::flatten`] near the base curve.
    pub(super) fn lift(&self, place: Vector2<f64>) -> Vec3 {
        let station = self.station(place);
        let off = place - station.flat;
        let n = Vector2::new(-station.flat_tangent.y, station.flat_tangent.x);
        station.point + station.tangent * off.dot(&station.flat_tangent) + station.inward * off.dot(&n)
    }

    /// Returns the base curve in the plane.
    pub(super) fn base(&self, along: f64) -> f64 {
        self.station(Vector2::new(along, 0.0)).flat.y
    }

    /// Returns the unit vector within the face across a curve of this slope in the plane, into the plate.
    ///
    /// The base curve itself wavers with the lattice: where an edge runs along a column its direction is wrong by up to
    /// a degree.
    pub(super) fn inward(&self, along: f64, slope: f64) -> Vec3 {
        let station = self.station(Vector2::new(along, 0.0));
        let (t, inward) = (station.flat_tangent, Vector2::new(-slope, 1.0).normalize());
        station.tangent * t.dot(&inward) + station.inward * t.perp(&inward)
    }

    /// Returns the unit normal of the face towards the scanner.
    pub(super) fn normal(&self, along: f64) -> Vec3 {
        let station = self.station(Vector2::new(along, 0.0));
        station.tangent.cross(&station.inward)
    }

    fn station(&self, place: Vector2<f64>) -> &Station {
        // The plane's first axis is the chord of the developed base curve: stations are sorted along it.
        let at = self.stations.partition_point(|s| (place - s.flat).dot(&s.flat_tangent) > 0.0);
        let near = |i: usize| (place - self.stations[i].flat).norm_squared();
        let at = at.min(self.stations.len() - 1);
        let at = if at > 0 && near(at - 1) < near(at) { at - 1 } else { at };
        &self.stations[at]
    }

    /// Returns the first and the last place along the plane's first axis.
    pub(super) fn span(&self) -> (f64, f64) {
        (self.stations[0].flat.x, self.stations[self.stations.len() - 1].flat.x)
    }
}

/// Fits the edge seen along the mean normal; also returns the weight (0 to 1) with which each crossing belongs to it.
fn robust_across(axis: UniformKnots, data: &[(Vec3, Vec3)], step: f64) -> Option<(SplineCurve, Vec<f64>)> {
    let mut weights = vec![1.0; data.len()];
    let mut spread = 20.0 * step;
    let mut curve = None;
    for _ in 0..ROUNDS {
        let mut fit =
            CurveFit::with_prior(axis, Roughness::Curvature, CURVATURE_ACROSS.0, CURVATURE_ACROSS.1);
        for ((p, _), w) in data.iter().zip(&weights) {
            fit.add(p.x, p.y, w / (step * step));
        }
        let (spline, _) = fit.solve()?;
        let off: Vec<f64> = data.iter().map(|(p, _)| (p.y - spline.at(p.x)).abs()).collect();
        spread = (0.5 * spread).max(1.5 * step);
        // Tukey's biweight at three times the spread.
        weights = off.iter().map(|r| (1.0 - (r / (3.0 * spread)).powi(2)).max(0.0).powi(2)).collect();
        curve = Some(spline);
    }
    Some((curve?, weights))
}

fn too_few(seen: &Coverage, length: f64) -> OutlineError {
    OutlineError::Edge { seen_percent: 100.0 * seen.share(0.0, length) }
}

/// Develops the curve that runs `depth` below the given one, against the normals: its direction turns in the plane as
/// it turns in the surface (geodesic curvature). `points` are the points of the curve on the face and the normals
/// there.
fn develop(points: &[(Vec3, Vec3)], depth: f64) -> Vec<Station> {
    let n = points.len();
    let on_face = |i: usize| points[i + 1].0 - points[i].0;
    let chord = |i: usize| on_face(i) - (points[i + 1].1 - points[i].1) * depth;
    let mut stations = Vec::with_capacity(n);
    let (mut flat, mut heading) = (Vector2::zeros(), 0.0_f64);
    for (i, &(point, normal)) in points.iter().enumerate() {
        let (back, ahead) = (i.saturating_sub(1), i.min(n - 2));
        let tangent = (on_face(back) + on_face(ahead)).normalize();
        let inward = normal.cross(&tangent).normalize();
        // Half of the turn at this point comes before its tangent, half after.
        let turn = if i > 0 && i + 1 < n {
            let (a, b) = (chord(back), chord(ahead));
            a.cross(&b).dot(&normal).atan2(a.dot(&b))
        } else {
            0.0
        };
        let middle = heading + 0.5 * turn;
        stations.push(Station {
            point,
            tangent,
            inward,
            flat,
            flat_tangent: Vector2::new(middle.cos(), middle.sin()),
        });
        heading += turn;
        if i + 1 < n {
            flat += Vector2::new(heading.cos(), heading.sin()) * chord(i).norm();
        }
    }
    let whole = stations[n - 1].flat.normalize();
    let turned = |v: Vector2<f64>| Vector2::new(whole.dot(&v), whole.perp(&v));
    for station in &mut stations {
        station.flat = turned(station.flat);
        station.flat_tangent = turned(station.flat_tangent);
    }
    stations
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edge_without_crossings_is_refused() {
        let sampling = Sampling { step: 0.01, angle: 1e-3, noise: 5e-4 };
        let refused = DevelopedStrip::new(&[], [Vec3::zeros(), Vec3::x()], 0.02, sampling).unwrap_err();
        assert_eq!(
            refused.to_string(),
            "0 % of one edge of the plate is seen, too little to locate it; clear what hides it, or tilt it where it mirrors the beam"
        );
    }
}
