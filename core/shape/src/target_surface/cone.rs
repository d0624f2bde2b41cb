//! Cone, developed about its apex.

use super::Place;
use crate::Vec3;

/// A cone over the coordinates along its middle straight line and across it, with its axis above.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cone {
    /// Distance from the apex to the middle of the plate, along the straight line.
    slant: f64,
    sin: f64,
    cos: f64,
    /// 1 when the straight lines lead away from the apex, else -1.
    way: f64,
}

impl Cone {
    /// Builds a cone from the `radius` of normal curvature in the middle, which grows by `growth` per metre; `None`
    /// when it does not grow.
    pub(super) fn new(radius: f64, growth: f64) -> Option<Self> {
        // Below this the apex is farther than 1e9 radii: a cylinder to the last bit that matters.
        const CYLINDER: f64 = 1e-9;
        // The radius of normal curvature is the slant times the tangent of the half angle.
        let (sin, cos) = growth.abs().atan().sin_cos();
        (growth.abs() > CYLINDER).then(|| Self {
            slant: radius / growth.abs(),
            sin,
            cos,
            way: growth.signum(),
        })
    }

    /// Evaluates a place. The angle about the axis is the polar angle of the development divided by the sine of the
    /// half angle.
    pub(super) fn place(&self, a: f64, b: f64) -> Place {
        let along = self.slant + self.way * a;
        let (rho, polar) = (along.hypot(b), b.atan2(along));
        let (sin_w, cos_w) = (polar / self.sin).sin_cos();
        let axis = Vec3::new(self.cos, 0.0, self.sin);
        let down = Vec3::new(self.sin, 0.0, -self.cos);
        let radial = down * cos_w + Vec3::y() * sin_w;
        let point = (axis * self.cos + radial * self.sin) * rho - Vec3::x() * self.slant;
        let normal = axis * self.sin - radial * self.cos;
        let back = |p: Vec3| Vec3::new(self.way * p.x, p.y, p.z);

        // Curved at a right angle to the straight line, which runs at `polar` to the middle one.
        let strongest = self.cos / (self.sin * rho);
        let (sin_p, cos_p) = polar.sin_cos();
        let twist = -self.way * strongest * sin_p * cos_p;
        let curvature = [strongest * sin_p * sin_p, strongest * cos_p * cos_p, twist];
        Place { point: back(point), normal: back(normal), curvature }
    }
}
