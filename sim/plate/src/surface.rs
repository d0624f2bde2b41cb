//! Point of a surface with its first derivatives (1-jet).

use crate::Vec3;

/// Point of a surface with first derivatives of point and normal by the two parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jet {
    /// Point, metres.
    pub point: Vec3,
    /// Derivative by the first parameter.
    pub du: Vec3,
    /// Derivative by the second parameter.
    pub dv: Vec3,
    /// Upper unit normal.
    pub normal: Vec3,
    /// Derivative of the normal by the first parameter.
    pub normal_du: Vec3,
    /// Derivative of the normal by the second parameter.
    pub normal_dv: Vec3,
}

impl Jet {
    /// Returns the jet by new parameters (a, b) of which the present ones are functions (chain rule); `jacobian`
    /// contains `[[d first/da, d first/db], [d second/da, d second/db]]`.
    pub(crate) fn reparameterized(&self, jacobian: [[f64; 2]; 2]) -> Self {
        let [[a, b], [c, d]] = jacobian;
        Self {
            du: self.du * a + self.dv * c,
            dv: self.du * b + self.dv * d,
            normal_du: self.normal_du * a + self.normal_dv * c,
            normal_dv: self.normal_du * b + self.normal_dv * d,
            ..*self
        }
    }

    /// Returns the jet of the parallel surface at `h` metres along the normal.
    pub(crate) fn offset(&self, h: f64) -> Self {
        Self {
            point: self.point + self.normal * h,
            du: self.du + self.normal_du * h,
            dv: self.dv + self.normal_dv * h,
            ..*self
        }
    }
}
