//! Section under a template: profile of the plate along a line relative to the target's.

use platen_shape::template_seat::Profile;
use platen_shape::{Surface, TargetSurface, Vec3};

/// Straight line on the original rectangle.
#[derive(Debug, Clone)]
pub(crate) struct Line {
    pub(crate) name: String,
    from: [f64; 2],
    to: [f64; 2],
    pub(crate) length: f64,
}

/// Position of a template on a line: middle along the line and length, metres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Chord {
    pub(crate) centre: f64,
    pub(crate) length: f64,
}

/// Profile under a template, with its points on the plate.
#[derive(Debug, Clone)]
pub(crate) struct Section {
    pub(crate) profile: Profile,
    /// Positions along the line, at equal steps.
    pub(crate) along: Vec<f64>,
    /// Sagitta of the template's edge: height of its chord over its middle, positive when its centre lies above.
    pub(crate) target_sagitta: f64,
    /// Sagitta of the plate.
    pub(crate) sagitta: f64,
    frame: Frame,
}

/// Section plane: direction of the chord between two points of a curve, and the direction up.
#[derive(Debug, Clone, Copy)]
struct Frame {
    origin: Vec3,
    along: Vec3,
    up: Vec3,
}

impl Line {
    pub(crate) fn new(name: &str, from: [f64; 2], to: [f64; 2]) -> Self {
        let length = (to[0] - from[0]).hypot(to[1] - from[1]);
        Self { name: name.into(), from, to, length }
    }

    /// Returns the point on the plate at distance `s` from the first point.
    pub(crate) fn at(&self, s: f64) -> [f64; 2] {
        let f = s / self.length;
        [0, 1].map(|k| self.from[k] + f * (self.to[k] - self.from[k]))
    }

    /// Returns the unit direction.
    pub(crate) fn direction(&self) -> [f64; 2] {
        [0, 1].map(|k| (self.to[k] - self.from[k]) / self.length)
    }
}

impl Section {
    /// Projects the faces of plate and target into their section planes: x along the chord between the material points
    /// under the template's ends, 0 at its middle; heights along the normal there. Sideways curvature out of the plane
    /// (the helix of an oblique line) is ignored, as with a real straight template.
    ///
    /// A template as long as its line would extend beyond the ends of a bent plate, whose chord is shorter than its
    /// line; the section ends with the plate.
    pub(crate) fn new(
        now: &Surface,
        target: &TargetSurface,
        line: &Line,
        chord: Chord,
        n_places: usize,
    ) -> Self {
        let half = 0.5 * chord.length;
        let ends = [(chord.centre - half).max(0.0), (chord.centre + half).min(line.length)];
        let face = |s: f64| {
            let [u, v] = line.at(s);
            now.face(u, v)
        };
        let goal = |s: f64| {
            let [u, v] = line.at(s);
            target.face(u, v)
        };
        let [u, v] = line.at(chord.centre);
        let frame = Frame::new(face(chord.centre), now.normal(u, v), face(ends[1]) - face(ends[0]));
        let goal_frame = Frame::new(goal(chord.centre), target.normal(u, v), goal(ends[1]) - goal(ends[0]));

        let first = frame.reach(&face, chord.centre, -half).max(0.0);
        let last = frame.reach(&face, chord.centre, half).min(line.length);
        let along = steps(first, last, n_places);
        let (x, z): (Vec<f64>, Vec<f64>) = along.iter().map(|&s| frame.project(&face(s))).unzip();

        // The template's edge: longer, because a plate that is bent less extends farther.
        let beyond = 0.05 * chord.length;
        let edge: Vec<(f64, f64)> = steps(first - beyond, last + beyond, n_places)
            .into_iter()
            .map(|s| goal_frame.project(&goal(s)))
            .collect();
        let heights: Vec<f64> = x.iter().map(|&x| height_at(&edge, x)).collect();
        Self {
            target_sagitta: sagitta(&x, &heights),
            sagitta: sagitta(&x, &z),
            profile: Profile { d: z.iter().zip(&heights).map(|(z, t)| z - t).collect(), x },
            along,
            frame,
        }
    }

    /// Returns the cosine between the plate's normal and the direction of the gap. A point that moves by 1 along its
    /// normal changes the profile by the inverse.
    pub(crate) fn cosine(&self, normal: &Vec3) -> f64 {
        normal.dot(&self.frame.up)
    }

    /// Returns the radius of the circle through both ends and the middle of the plate's profile (R = c^2 / 8 s + s /
    /// 2), positive when its centre lies above; `None` for a straight profile.
    pub(crate) fn radius(&self) -> Option<f64> {
        let (first, last) = (self.profile.x[0], self.profile.x[self.profile.x.len() - 1]);
        // 1 um under a template of 2 m corresponds to a radius of 500 km.
        const STRAIGHT: f64 = 1e-6;
        (self.sagitta.abs() > STRAIGHT)
            .then(|| (last - first).powi(2) / (8.0 * self.sagitta) + 0.5 * self.sagitta)
    }
}

impl Frame {
    fn new(origin: Vec3, normal: Vec3, chord: Vec3) -> Self {
        let along = chord.normalize();
        let up = (normal - along * normal.dot(&along)).normalize();
        Self { origin, along, up }
    }

    /// Returns the coordinates along and up.
    fn project(&self, p: &Vec3) -> (f64, f64) {
        let q = p - self.origin;
        (q.dot(&self.along), q.dot(&self.up))
    }

    /// Returns the distance along the line at which the curve reaches x, by fixed-point iteration: dx/ds is near 1, so
    /// each round leaves at most a tenth of the error.
    fn reach(&self, curve: &impl Fn(f64) -> Vec3, centre: f64, x: f64) -> f64 {
        (0..12).fold(centre + x, |s, _| s + x - self.project(&curve(s)).0)
    }
}

/// Returns `n` values at equal steps, including both ends.
fn steps(first: f64, last: f64, n: usize) -> Vec<f64> {
    (0..n).map(|k| first + (last - first) * k as f64 / (n - 1) as f64).collect()
}

/// Returns the height of a smooth curve with increasing x, by cubic Lagrange interpolation of the four nearest points.
fn height_at(curve: &[(f64, f64)], x: f64) -> f64 {
    let after = curve.partition_point(|(at, _)| *at < x);
    let near = &curve[after.saturating_sub(2).min(curve.len().saturating_sub(4))..];
    let near = &near[..near.len().min(4)];
    let weight = |k: usize| {
        let others = (0..near.len()).filter(|other| *other != k);
        others.map(|other| (x - near[other].0) / (near[k].0 - near[other].0)).product::<f64>()
    };
    (0..near.len()).map(|k| weight(k) * near[k].1).sum()
}

/// Returns the height of the chord over the curve, half way between its ends.
fn sagitta(x: &[f64], z: &[f64]) -> f64 {
    let n = x.len() - 1;
    let middle = 0.5 * (x[0] + x[n]);
    let line: Vec<(f64, f64)> = x.iter().copied().zip(z.iter().copied()).collect();
    0.5 * (z[0] + z[n]) - height_at(&line, middle)
}
