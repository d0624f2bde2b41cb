//! Exact plates in front of the scanner: noisy samples and outline, and the errors of a measurement of them.

use nalgebra::{Matrix3, Rotation3};
use platen_numerics::random::Random;

use super::{Measurement, measure};
use crate::flatten::{cotangents, fixed_boundary};
use crate::surface::Derivatives;
use crate::{
    Chart, Corner, DiskMesh, EdgeCurve, Flatten, FlattenError, HeightField, Outline, Patch, PlateSpec,
    Sample, Vec3,
};

/// Harmonic map (Masuda et al., 4.3).
pub(super) struct Harmonic;

impl Flatten for Harmonic {
    fn flatten(&mut self, mesh: &DiskMesh) -> Result<Chart, FlattenError> {
        let refused = |message| FlattenError::Refused { message, hint: "a test's own fault".into() };
        let uv = fixed_boundary(mesh, &cotangents(mesh)).map_err(|e| refused(e.to_string()))?;
        Ok(Chart { uv, ..Chart::default() })
    }
}

/// A bent plate in front of the scanner, which is at the origin.
pub(super) struct Scene {
    /// Mid-surface over material coordinates, in any frame.
    pub(super) mid: Box<dyn Fn([f64; 2]) -> [f64; 3]>,
    pub(super) size: [f64; 2],
    pub(super) thickness: f64,
    /// Distance from the mid-surface's edge inwards to that of the face.
    pub(super) inset: f64,
    /// Rotation about the vertical, radians.
    pub(super) yaw: f64,
    /// Position of the plate's middle, metres, scanner frame.
    pub(super) middle: Vec3,
    /// Noise of the range; the edges' points have the same, in every direction.
    pub(super) sigma: f64,
    /// Share of samples that are 20 times as noisy.
    pub(super) wild: f64,
    /// Spacing of the samples on the plate, metres.
    pub(super) pitch: f64,
    /// Material rectangle that is hidden: from (u, v) to (u, v).
    pub(super) hidden: Option<[[f64; 2]; 2]>,
    pub(super) seed: u64,
}

/// A plate placed in its scene: level at its middle, which lies at the position that the scene gives.
pub(super) struct Placed<'a> {
    scene: &'a Scene,
    turn: Matrix3<f64>,
    centre: Vec3,
}

impl Scene {
    pub(super) fn new(mid: impl Fn([f64; 2]) -> [f64; 3] + 'static, size: [f64; 2]) -> Self {
        Self {
            mid: Box::new(mid),
            size,
            thickness: 0.036,
            inset: 0.0,
            yaw: 0.5,
            middle: Vec3::new(6.0, 0.3, -3.6),
            sigma: 0.5e-3,
            wild: 0.0,
            pitch: 0.006,
            hidden: None,
            seed: 1,
        }
    }

    pub(super) fn spec(&self) -> PlateSpec {
        PlateSpec {
            width: self.size[0],
            height: self.size[1],
            thickness: self.thickness,
            face_inset: self.inset,
            root_face: 0.0,
            u_axis: None,
            region: None,
        }
    }

    pub(super) fn placed(&self) -> Placed<'_> {
        let local = |u: f64, v: f64| Vec3::from((self.mid)([u, v]));
        let ([u, v], d) = (self.size.map(|length| 0.5 * length), 1e-4);
        let along = (local(u + d, v) - local(u - d, v)).normalize();
        let normal = along.cross(&(local(u, v + d) - local(u, v - d))).normalize();
        let level =
            Matrix3::from_rows(&[along.transpose(), normal.cross(&along).transpose(), normal.transpose()]);
        let turn = Rotation3::from_axis_angle(&Vec3::z_axis(), self.yaw) * level;
        Placed { scene: self, turn, centre: local(u, v) }
    }

    fn is_hidden(&self, u: f64, v: f64) -> bool {
        self.hidden.is_some_and(|[a, b]| u > a[0] && u < b[0] && v > a[1] && v < b[1])
    }

    /// Returns samples of the scanned face, one at a random place in each cell of a grid.
    pub(super) fn patch(&self) -> Patch {
        let (placed, mut random) = (self.placed(), Random::new(self.seed));
        let size = self.size.map(|length| length - 2.0 * self.inset);
        let n = size.map(|length| (length / self.pitch) as usize);
        let mut samples = Vec::with_capacity(n[0] * n[1]);
        for (column, row) in (0..n[0]).flat_map(|c| (0..n[1]).map(move |r| (c, r))) {
            let u = self.inset + (column as f64 + random.unit()) * size[0] / n[0] as f64;
            let v = self.inset + (row as f64 + random.unit()) * size[1] / n[1] as f64;
            let sigma = self.sigma * if random.unit() < self.wild { 20.0 } else { 1.0 };
            let face = placed.face(u, v);
            let point = face + face.normalize() * (sigma * random.normal());
            if !self.is_hidden(u, v) {
                let (column, row, sigma) = (column as u32, row as u32, self.sigma as f32);
                samples.push(Sample { point, column, row, sigma, intensity: 0 });
            }
        }
        Patch { samples, azimuth_step: 1e-3, elevation_step: 1e-3, noise: self.sigma, ..Patch::default() }
    }

    /// Returns the face's edges with a point every 10 mm; hidden parts are bridged by a straight line.
    pub(super) fn outline(&self) -> Outline {
        let (placed, mut random) = (self.placed(), Random::new(self.seed + 1000));
        let ([w, h], i) = (self.size, self.inset);
        let at = [[i, i], [w - i, i], [w - i, h - i], [i, h - i]];
        let mut jitter = |s: f64| s * Vec3::new(random.normal(), random.normal(), random.normal());
        let corners = at.map(|[u, v]| Corner {
            point: placed.face(u, v) + jitter(0.3 * self.sigma),
            sigma: [0.3 * self.sigma; 2],
            contrast: [0.0; 2],
            seen: true,
        });
        let edges = [0, 1, 2, 3].map(|k| {
            let (from, to) = (at[k], at[(k + 1) % 4]);
            let n = ((to[0] - from[0]).hypot(to[1] - from[1]) / 0.01).ceil() as usize;
            let place = |j: usize| [0, 1].map(|d| from[d] + (to[d] - from[d]) * j as f64 / n as f64);
            let seen: Vec<bool> = (0..=n).map(|j| !self.is_hidden(place(j)[0], place(j)[1])).collect();
            let mut points: Vec<Vec3> =
                (0..=n).map(|j| placed.face(place(j)[0], place(j)[1]) + jitter(self.sigma)).collect();
            (points[0], points[n]) = (corners[k].point, corners[(k + 1) % 4].point);
            for j in (0..=n).filter(|j| !seen[*j]) {
                let before = (0..j).rev().find(|i| seen[*i]).unwrap_or(0);
                let after = (j..n).find(|i| seen[*i]).unwrap_or(n);
                let f = (j - before) as f64 / (after - before) as f64;
                points[j] = points[before] * (1.0 - f) + points[after] * f;
            }
            EdgeCurve { points, seen, sigma: 0.1 * self.sigma }
        });
        let height_field =
            HeightField::between(corners.map(|c| c.point), &self.patch()).expect("a height_field");
        Outline { corners, edges, height_field }
    }

    pub(super) fn measure(&self) -> Measurement {
        let mut clock = std::time::Duration::default;
        measure(
            &self.patch(),
            &self.outline(),
            &self.spec(),
            &self.spec().rectangle(),
            &mut Harmonic,
            &mut clock,
        )
        .expect("a measurement")
    }
}

impl Placed<'_> {
    fn mid(&self, u: f64, v: f64) -> Vec3 {
        self.turn * (Vec3::from((self.scene.mid)([u, v])) - self.centre) + self.scene.middle
    }

    /// Returns the point of the scanned face over the mid-surface.
    pub(super) fn face(&self, u: f64, v: f64) -> Vec3 {
        let d = 1e-4;
        let along_u = self.mid(u + d, v) - self.mid(u - d, v);
        let along_v = self.mid(u, v + d) - self.mid(u, v - d);
        self.mid(u, v) + 0.5 * self.scene.thickness * along_u.cross(&along_v).normalize()
    }

    /// Returns derivatives of the mid-surface by central differences.
    pub(super) fn mid_derivatives(&self, u: f64, v: f64) -> Derivatives {
        let (s, d) = (|u, v| self.mid(u, v), 1e-3);
        let (p, e, w, n, f) = (s(u, v), s(u + d, v), s(u - d, v), s(u, v + d), s(u, v - d));
        let twist = s(u + d, v + d) - s(u + d, v - d) - s(u - d, v + d) + s(u - d, v - d);
        Derivatives {
            p,
            u: (e - w) / (2.0 * d),
            v: (n - f) / (2.0 * d),
            uu: (e - 2.0 * p + w) / (d * d),
            uv: twist / (4.0 * d * d),
            vv: (n - 2.0 * p + f) / (d * d),
        }
    }
}

/// Errors: mm, and 1/m for the curvature.
#[derive(Debug, Default)]
pub(super) struct Errors {
    /// Mean distance of nine markers from their true positions.
    pub(super) markers: f64,
    /// Normal distance, rms, at least 100 mm from every edge.
    pub(super) inside: f64,
    /// Normal distance, rms, nearer to an edge.
    pub(super) edge: f64,
    /// Curvatures u, v and uv, rms, at least 150 mm from every edge.
    pub(super) curvature: f64,
    /// Rms of normal errors over their stated standard deviations.
    pub(super) over_stated: f64,
}

#[derive(Default)]
struct Mean {
    square: f64,
    n: f64,
}

impl Mean {
    fn add(&mut self, x: f64) {
        self.square += x * x;
        self.n += 1.0;
    }

    fn rms(&self) -> f64 {
        (self.square / self.n).sqrt()
    }
}

impl Errors {
    /// Determines the errors of `measured` on a 50 mm grid; hidden parts and their surroundings do not count.
    pub(super) fn of(measured: &Measurement, scene: &Scene) -> Self {
        let (placed, surface, [w, h]) = (scene.placed(), &measured.surface, scene.size);
        let [mut inside, mut edge, mut bend, mut ratio] = [(); 4].map(|()| Mean::default());
        let n = scene.size.map(|length| (length / 0.05) as usize + 1);
        for (i, j) in (0..n[1]).flat_map(|j| (0..n[0]).map(move |i| (i, j))) {
            let (u, v) = (w * i as f64 / (n[0] - 1) as f64, h * j as f64 / (n[1] - 1) as f64);
            let near = |a: f64, b: f64| scene.is_hidden(u + a, v + b);
            if near(0.0, 0.0) || near(0.05, 0.0) || near(-0.05, 0.0) || near(0.0, 0.05) || near(0.0, -0.05) {
                continue;
            }
            let border = u.min(w - u).min(v).min(h - v);
            let truth = placed.mid_derivatives(u, v);
            let normal = (surface.face(u, v) - placed.face(u, v)).dot(&truth.normal());
            if border >= 0.1 { &mut inside } else { &mut edge }.add(1e3 * normal);
            ratio.add(normal / surface.sigma_point(u, v));
            if border >= 0.15 {
                let (k, t) = (surface.curvature(u, v), truth.curvature());
                [k.u - t.u, k.v - t.v, k.uv - t.uv].into_iter().for_each(|d| bend.add(d));
            }
        }
        let marker = |k: usize| {
            let (u, v) = (w * (0.1 + 0.4 * (k % 3) as f64), h * (0.1 + 0.4 * (k / 3) as f64));
            1e3 * (surface.face(u, v) - placed.face(u, v)).norm()
        };
        Self {
            markers: (0..9).map(marker).sum::<f64>() / 9.0,
            inside: inside.rms(),
            edge: edge.rms(),
            curvature: bend.rms(),
            over_stated: ratio.rms(),
        }
    }
}
