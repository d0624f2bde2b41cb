//! Surface of a plane section swept along a plane profile: every shape except the cone.
//!
//! The profile C(s) lies in the xz plane with curvature k1(s). The section (X(r), Z(r)) with curvature k2(r) lies in
//! its normal plane: P(s, r) = C(s) + X(r) e_y + Z(r) N(s), where N is the profile's upper normal. A straight section
//! gives cylinders, steps and parallel bands (isometric); two circles of one radius give a sphere, two circles a torus.
//! Principal curvatures: k2 along r, k1 cos(b) / (1 - k1 Z) along s, where b is the section's tangent angle.

use crate::profile::Profile;
use crate::{Jet, Vec3};

/// Section swept along a profile.
#[derive(Debug, Clone)]
pub(crate) struct SweptSurface {
    pub(crate) profile: Profile,
    pub(crate) section: Profile,
}

impl SweptSurface {
    /// Returns true when the map from (s, r) is isometric.
    pub(crate) fn is_developable(&self) -> bool {
        self.profile.is_straight() || self.section.is_straight()
    }

    /// Returns g and its derivatives by s and r; the metric is diag(g, 1) with g = (1 - k1 Z)^2.
    pub(crate) fn metric(&self, s: f64, r: f64) -> (f64, [f64; 2]) {
        let (c, q) = (self.profile.at(s), self.section.at(r));
        let stretch = 1.0 - c.curvature * q.z;
        let by_s = -self.profile.curvature_slope(s) * q.z;
        let by_r = -c.curvature * q.angle.sin();
        (stretch * stretch, [2.0 * stretch * by_s, 2.0 * stretch * by_r])
    }

    /// Returns the point and its derivatives by (s, r), in the frame x = s, y = r, z up at the origin.
    pub(crate) fn jet(&self, s: f64, r: f64) -> Jet {
        let (c, q) = (self.profile.at(s), self.section.at(r));
        let (sin_a, cos_a) = c.angle.sin_cos();
        let (sin_b, cos_b) = q.angle.sin_cos();
        let tangent = Vec3::new(cos_a, 0.0, sin_a);
        let upright = Vec3::new(-sin_a, 0.0, cos_a);
        let dr = Vec3::y() * cos_b + upright * sin_b;
        Jet {
            point: Vec3::new(c.x, q.x, c.z) + upright * q.z,
            du: tangent * (1.0 - c.curvature * q.z),
            dv: dr,
            normal: upright * cos_b - Vec3::y() * sin_b,
            normal_du: tangent * (-c.curvature * cos_b),
            normal_dv: dr * -q.curvature,
        }
    }
}
