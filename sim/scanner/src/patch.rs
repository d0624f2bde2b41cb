//! Ray intersection with the curved faces of a plate (two faces, four sides of one to three strips), by Newton's method
//! on parametric patches.

use crate::bounds::Bounds;
use crate::ray::{Label, Ray};
use platen_sim_plate::{Jet, Plate, Side, Strip, Vec3};

/// Longest edge of a patch, metres: short against the radii, so that Newton's method converges from the patch's middle.
const PATCH: f64 = 0.12;

/// Margin of the boxes around the 5 x 5 sampled points: the arc between points 30 mm apart rises
/// 0.1 mm at a curvature of 1/m.
const MARGIN: f64 = 1e-3;

/// Convergence limit: distance of the surface point from the ray before the last step, metres. Afterwards it is below
/// 1e-17 m; the normal is that before the step.
const CLOSE: f64 = 1e-9;

/// Overlap of faces and patches, metres, so that no ray passes between them.
const OVERLAP: f64 = 1e-9;

/// Face of a plate.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Face {
    Top,
    Underside,
    /// A strip of a side, with its number.
    Side(Side, Strip, u16),
}

/// Rectangle in the two parameters of a face: (a, b) of the ordered rectangle, or one of them and the height above the
/// mid-surface on a side.
#[derive(Debug, Clone)]
pub(crate) struct Patch {
    face: Face,
    from: [f64; 2],
    to: [f64; 2],
    /// Start of every search. Stored for speed only: `platen demo`.
    middle: FacePoint,
}

/// Point of a face at parameters (a, b) with its derivatives by them.
#[derive(Debug, Clone, Copy)]
struct FacePoint {
    parameters: [f64; 2],
    point: Vec3,
    da: Vec3,
    db: Vec3,
}

/// Intersection of a ray with a patch.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PatchHit {
    pub(crate) range: f64,
    pub(crate) normal: Vec3,
    pub(crate) uv: [f64; 2],
}

impl Face {
    /// Returns the faces of a plate.
    fn all(plate: &Plate) -> Vec<Self> {
        let sides = Side::ALL.into_iter().flat_map(|side| {
            plate.strips().iter().zip(0..).map(move |(strip, number)| Self::Side(side, *strip, number))
        });
        [Self::Top, Self::Underside].into_iter().chain(sides).collect()
    }

    /// Returns the least and the largest parameters.
    fn range(self, plate: &Plate) -> [[f64; 2]; 2] {
        let (inset, half) = (plate.face_inset(), plate.thickness() / 2.0);
        match self {
            Self::Top | Self::Underside => [[inset, inset], [plate.width() - inset, plate.height() - inset]],
            Self::Side(side, strip, _) => {
                let length = match side {
                    Side::Bottom | Side::Top => plate.width(),
                    Side::Right | Side::Left => plate.height(),
                };
                [[0.0, strip.from + half], [length, strip.to + half]]
            }
        }
    }

    /// Returns the point of the ordered rectangle and the height of the parameters (a, b). On a bevel the parameter
    /// along the side is compressed so that neighbouring sides meet in a mitre.
    fn place(self, plate: &Plate, a: f64, b: f64) -> [f64; 3] {
        let (width, height, half) = (plate.width(), plate.height(), plate.thickness() / 2.0);
        let Self::Side(side, strip, _) = self else {
            return [a, b, if self == Self::Top { half } else { -half }];
        };
        let inset = strip.inset(b - half);
        let along = |length: f64| inset + a * (1.0 - 2.0 * inset / length);
        match side {
            Side::Bottom => [along(width), inset, b - half],
            Side::Right => [width - inset, along(height), b - half],
            Side::Top => [along(width), height - inset, b - half],
            Side::Left => [inset, along(height), b - half],
        }
    }

    /// Returns 1 where da x db points out of the plate, else -1.
    fn outward(self) -> f64 {
        match self {
            Self::Top | Self::Side(Side::Bottom | Side::Right, ..) => 1.0,
            Self::Underside | Self::Side(Side::Top | Side::Left, ..) => -1.0,
        }
    }

    /// Returns the point and its derivatives at (a, b).
    fn at(self, plate: &Plate, [a, b]: [f64; 2]) -> FacePoint {
        let of = |point: Vec3, da: Vec3, db: Vec3| FacePoint { parameters: [a, b], point, da, db };
        let [x, y, h] = self.place(plate, a, b);
        let ([u, v], [[u_x, u_y], [v_x, v_y]]) = plate.material(x, y);
        let Jet { point, du, dv, normal, .. } = plate.jet(u, v, h);
        let (dx, dy) = (du * u_x + dv * v_x, du * u_y + dv * v_y);
        let Self::Side(side, strip, _) = self else { return of(point, dx, dy) };
        let (along, across, length) = match side {
            Side::Bottom => (dx, dy, plate.width()),
            Side::Top => (dx, -dy, plate.width()),
            Side::Right => (dy, -dx, plate.height()),
            Side::Left => (dy, dx, plate.height()),
        };
        let compressed = 1.0 - 2.0 * strip.inset(h) / length;
        let slope = along * (1.0 - 2.0 * a / length) + across;
        of(point, along * compressed, normal + slope * strip.slope)
    }
}

impl Patch {
    /// Divides the faces of a plate into patches.
    pub(crate) fn all(plate: &Plate) -> Vec<Self> {
        let mut patches = Vec::new();
        for face in Face::all(plate) {
            let [from, to] = face.range(plate);
            let sizes = [0, 1].map(|k| to[k] - from[k]);
            let [na, nb] = sizes.map(|size| (size / PATCH).ceil().max(1.0) as usize);
            let at = |k: usize, i: usize, n: usize| from[k] + sizes[k] * i as f64 / n as f64;
            for i in 0..na {
                for j in 0..nb {
                    let (from, to) = ([at(0, i, na), at(1, j, nb)], [at(0, i + 1, na), at(1, j + 1, nb)]);
                    let middle = face.at(plate, [0, 1].map(|k| (from[k] + to[k]) / 2.0));
                    patches.push(Self { face, from, to, middle });
                }
            }
        }
        patches
    }

    pub(crate) fn label(&self) -> Label {
        match self.face {
            Face::Top => Label::PlateTop,
            Face::Underside => Label::PlateUnderside,
            Face::Side(..) => Label::PlateSide,
        }
    }

    /// Returns the number of the face, 0 to 13.
    pub(crate) fn object(&self) -> u16 {
        match self.face {
            Face::Top => 0,
            Face::Underside => 1,
            Face::Side(side, _, strip) => 2 + side as u16 + 4 * strip,
        }
    }

    pub(crate) fn bounds(&self, plate: &Plate) -> Bounds {
        let mix = |k: usize, i: usize| self.from[k] + (self.to[k] - self.from[k]) * i as f64 / 4.0;
        let points = (0..25).map(|i| self.face.at(plate, [mix(0, i / 5), mix(1, i % 5)]).point);
        Bounds::of(points, MARGIN)
    }

    /// Returns the point where the ray enters the plate through this patch: a root of X(a, b) = origin + t direction by
    /// Newton's method from the patch's middle. A patch is small against its radii, so that a root on it is reached in
    /// three or four steps; a root elsewhere belongs to another patch. Near a horizon the ray may leave through the
    /// patch through which it entered; the other root is then searched from the scanner's side.
    pub(crate) fn cast(&self, plate: &Plate, ray: &Ray) -> Option<PatchHit> {
        let first = self.root(plate, ray, self.middle);
        let root = match first {
            Some(root) if !self.leaves(&root, ray) => root,
            // Near a horizon: this root is the exit, or the ray lies in the tangent plane of the middle.
            _ => {
                let FacePoint { parameters: [a, b], da, db, .. } = first.map_or(self.middle, |root| root.at);
                let nearer = |x: f64, d: Vec3| x - PATCH * ray.direction.dot(&d) / d.norm_squared();
                self.root(plate, ray, self.face.at(plate, [nearer(a, da), nearer(b, db)]))?
            }
        };
        let [a, b] = root.at.parameters;
        let inside = |x: f64, k: usize| (self.from[k] - OVERLAP..=self.to[k] + OVERLAP).contains(&x);
        if !inside(a, 0) || !inside(b, 1) || root.range <= 0.0 || self.leaves(&root, ray) {
            return None;
        }
        let [a, b, _] = self.face.place(plate, a, b);
        let (uv, _) = plate.material(a, b);
        Some(PatchHit { range: root.range, normal: root.normal.normalize(), uv })
    }

    fn leaves(&self, root: &Root, ray: &Ray) -> bool {
        root.normal.dot(&ray.direction) * self.face.outward() > 0.0
    }

    /// Runs Newton's method from `start`. A root outside this patch is found roughly, and not at all beyond two patch
    /// lengths.
    fn root(&self, plate: &Plate, ray: &Ray, start: FacePoint) -> Option<Root> {
        let mut at = start;
        for _ in 0..12 {
            let FacePoint { parameters: [a, b], point, da, db } = at;
            let normal = da.cross(&db);
            let slope = normal.dot(&ray.direction);
            if slope == 0.0 {
                return None;
            }
            let range = normal.dot(&(point - ray.origin)) / slope;
            // The residual lies in the tangent plane: resolve it along da and db.
            let residual = ray.at(range) - point;
            let area = normal.norm_squared();
            let steps = [residual.cross(&db).dot(&normal) / area, da.cross(&residual).dot(&normal) / area];
            let next = [a + steps[0], b + steps[1]];
            let is_within =
                |reach: f64| (0..2).all(|k| (self.from[k] - reach..=self.to[k] + reach).contains(&next[k]));
            if !is_within(2.0 * PATCH) {
                return None;
            }
            // The rest of the way is no longer than this step, even to a double root; twice that is allowed.
            let is_elsewhere = !is_within(2.0 * steps[0].abs().max(steps[1].abs()));
            if is_elsewhere || residual.norm_squared() < CLOSE * CLOSE {
                return Some(Root { range, at: FacePoint { parameters: next, ..at }, normal });
            }
            at = self.face.at(plate, next);
        }
        None
    }
}

/// Common point of a ray and the surface of a patch, with da x db there.
struct Root {
    range: f64,
    at: FacePoint,
    normal: Vec3,
}
