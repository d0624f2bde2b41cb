//! The section under a board: the plate's profile along a line against the target's.

use platen_shape::{Surface, TargetSurface, Vec3};

use crate::seat::Profile;

/// A line on the original rectangle.
#[derive(Debug, Clone)]
pub(crate) struct Line {
    pub(crate) name: String,
    from: [f64; 2],
    to: [f64; 2],
    pub(crate) length: f64,
}

/// A board on a line: its middle along the line and its length, metres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Board {
    pub(crate) centre: f64,
    pub(crate) chord: f64,
}

/// The profile under a board with its places on the plate.
#[derive(Debug, Clone)]
pub(crate) struct Section {
    pub(crate) profile: Profile,
    /// Places along the line, at equal steps.
    pub(crate) along: Vec<f64>,
    /// Height of the chord over the middle of the board's own edge, positive when its centre lies above.
    pub(crate) target_sagitta: f64,
    /// The same of the plate.
    pub(crate) sagitta: f64,
    frame: Frame,
}

/// A section plane: the chord between two places of a curve, and up.
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

    /// Place on the plate at a distance from the first point.
    pub(crate) fn at(&self, s: f64) -> [f64; 2] {
        let f = s / self.length;
        [0, 1].map(|k| self.from[k] + f * (self.to[k] - self.from[k]))
    }

    /// Unit direction.
    pub(crate) fn direction(&self) -> [f64; 2] {
        [0, 1].map(|k| (self.to[k] - self.from[k]) / self.length)
    }
}

impl Section {
    /// Lays the plate's face and the target's into their section planes: x along the chord between the material places
    /// under the board's ends, 0 at its middle, heights along the normal there. What the line curves sideways out
    /// of the plane (the helix of an oblique line) is dropped, as a straight board drops it.
    ///
    /// A board as long as its line reaches over the ends of a bent plate, which is shorter than its line: there it ends.
    pub(crate) fn new(
        now: &Surface,
        target: &TargetSurface,
        line: &Line,
        board: Board,
        n_places: usize,
    ) -> Self {
        let half = 0.5 * board.chord;
        let ends = [(board.centre - half).max(0.0), (board.centre + half).min(line.length)];
        let face = |s: f64| {
            let [u, v] = line.at(s);
            now.face(u, v)
        };
        let goal = |s: f64| {
            let [u, v] = line.at(s);
            target.face(u, v)
        };
        let [u, v] = line.at(board.centre);
        let frame = Frame::new(face(board.centre), now.normal(u, v), face(ends[1]) - face(ends[0]));
        let goal_frame = Frame::new(goal(board.centre), target.normal(u, v), goal(ends[1]) - goal(ends[0]));

        let first = frame.reach(&face, board.centre, -half).max(0.0);
        let last = frame.reach(&face, board.centre, half).min(line.length);
        let along = steps(first, last, n_places);
        let (x, z): (Vec<f64>, Vec<f64>) = along.iter().map(|&s| frame.flat(&face(s))).unzip();

        // The edge of the board: four times as dense, so that straight pieces between its places do not show, and
        // longer, because a plate that is bent less reaches farther.
        let beyond = 0.05 * board.chord;
        let edge: Vec<(f64, f64)> = steps(first - beyond, last + beyond, 4 * n_places)
            .into_iter()
            .map(|s| goal_frame.flat(&goal(s)))
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

    /// Cosine between the plate's normal and the direction of the gap: a place that moves by 1 along its normal
    /// changes the profile by 1 / this.
    pub(crate) fn upright(&self, normal: &Vec3) -> f64 {
        normal.dot(&self.frame.up)
    }

    /// Radius of the circle through both ends and the middle of the plate's profile (R = c^2 / 8 s + s / 2), positive
    /// when its centre lies above; `None` for a straight one.
    pub(crate) fn radius(&self) -> Option<f64> {
        let (first, last) = (self.profile.x[0], self.profile.x[self.profile.x.len() - 1]);
        // 1 um under a board of 2 m: a radius of 500 km.
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

    /// Along and up.
    fn flat(&self, p: &Vec3) -> (f64, f64) {
        let q = p - self.origin;
        (q.dot(&self.along), q.dot(&self.up))
    }

    /// Distance along the line at which the curve has come to x: its slope is near 1, so that each round leaves a tenth
    /// of the error or less.
    fn reach(&self, curve: &impl Fn(f64) -> Vec3, centre: f64, x: f64) -> f64 {
        (0..12).fold(centre + x, |s, _| s + x - self.flat(&curve(s)).0)
    }
}

/// `n` places at equal steps, both ends among them.
fn steps(first: f64, last: f64, n: usize) -> Vec<f64> {
    (0..n).map(|k| first + (last - first) * k as f64 / (n - 1) as f64).collect()
}

/// Height of a polyline with growing x.
fn height_at(line: &[(f64, f64)], x: f64) -> f64 {
    let k = line.partition_point(|(at, _)| *at < x).clamp(1, line.len() - 1);
    let ((x0, z0), (x1, z1)) = (line[k - 1], line[k]);
    z0 + (x - x0) / (x1 - x0) * (z1 - z0)
}

/// Height of the chord over the curve half way between its ends.
fn sagitta(x: &[f64], z: &[f64]) -> f64 {
    let n = x.len() - 1;
    let middle = 0.5 * (x[0] + x[n]);
    let line: Vec<(f64, f64)> = x.iter().copied().zip(z.iter().copied()).collect();
    0.5 * (z[0] + z[n]) - height_at(&line, middle)
}
