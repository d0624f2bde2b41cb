//! Circular cone, developed about its apex (isometric map).

use crate::{Jet, Vec3};

/// Cone of half angle alpha; the plate's middle lies `slant` metres from the apex. In the plate's frame
/// x = s runs across the middle generator and y = r along it, away from the apex.
#[derive(Debug, Clone)]
pub(crate) struct Cone {
    slant: f64,
    sin_alpha: f64,
    cos_alpha: f64,
    /// 1 when the axis lies above the plate, else -1.
    side: f64,
}

impl Cone {
    /// Creates a cone. `radius` (m): radius of normal curvature in the middle; `growth`: its positive growth per metre
    /// of slant; `side`: 1 when the centre lies above the plate, else -1.
    pub(crate) fn new(radius: f64, growth: f64, side: f64) -> Self {
        let (sin_alpha, cos_alpha) = growth.atan().sin_cos();
        Self { slant: radius / growth, sin_alpha, cos_alpha, side }
    }

    /// Returns the point and its derivatives by (s, r). The polar angle of the development is the angle about the axis
    /// times sin(alpha).
    pub(crate) fn jet(&self, s: f64, r: f64) -> Jet {
        let along = self.slant + r;
        let rho = s.hypot(along);
        let (sin_phi, cos_phi) = (s / rho, along / rho);
        let (sin_w, cos_w) = (s.atan2(along) / self.sin_alpha).sin_cos();
        let axis = Vec3::new(0.0, self.cos_alpha, self.sin_alpha);
        let outward = Vec3::new(0.0, self.sin_alpha, -self.cos_alpha);
        let radial = outward * cos_w + Vec3::x() * sin_w;
        let generator = axis * self.cos_alpha + radial * self.sin_alpha;
        let around = Vec3::x() * cos_w - outward * sin_w;
        let normal_phi = around * (-self.cos_alpha / self.sin_alpha);
        let polar = Jet {
            point: generator * rho - Vec3::y() * self.slant,
            du: generator,
            dv: around * rho,
            normal: axis * self.sin_alpha - radial * self.cos_alpha,
            normal_du: Vec3::zeros(),
            normal_dv: normal_phi,
        };
        self.mirrored_if_below(polar.reparameterized([[sin_phi, cos_phi], [cos_phi / rho, -sin_phi / rho]]))
    }

    /// Mirrors the cone about the plate's plane when its axis lies below; the normal remains the upper one.
    fn mirrored_if_below(&self, jet: Jet) -> Jet {
        let mirror = |v: Vec3| Vec3::new(v.x, v.y, v.z * self.side);
        let normal = |v: Vec3| mirror(v) * self.side;
        Jet {
            point: mirror(jet.point),
            du: mirror(jet.du),
            dv: mirror(jet.dv),
            normal: normal(jet.normal),
            normal_du: normal(jet.normal_du),
            normal_dv: normal(jet.normal_dv),
        }
    }
}
