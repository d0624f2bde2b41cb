//! Surfaces of revolution and their development onto the plane.

use std::f64::consts::PI;

use platen_model::TargetShape;

/// Mid-surface of a zone, between its two ends, metres and radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Revolution {
    /// Course of a cylinder.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Height of the course.
        height: f64,
    },
    /// Cone between two radii about its axis.
    Cone {
        /// Smaller radius.
        from: f64,
        /// Larger radius.
        to: f64,
        /// Length along its straight lines.
        slant: f64,
    },
    /// Knuckle of a torus between two polar angles, measured from the axis; a sphere where `centre` is 0.
    Torus {
        /// Radius of the meridian.
        radius: f64,
        /// Distance of the meridian's centre from the axis.
        centre: f64,
        /// First polar angle.
        from: f64,
        /// Last polar angle.
        to: f64,
    },
}

/// Place on the meridian with its outward normal, in the plane through the axis.
#[derive(Debug, Clone, Copy)]
struct Meridian {
    /// Distance from the axis.
    r: f64,
    z: f64,
    normal: [f64; 2],
}

impl Revolution {
    /// Returns whether the surface is curved in two directions, so that a plate must stretch.
    #[must_use]
    pub fn is_doubly_curved(&self) -> bool {
        matches!(self, Self::Torus { .. })
    }

    /// Returns the length of the meridian.
    #[must_use]
    pub fn length(&self) -> f64 {
        match *self {
            Self::Cylinder { height, .. } => height,
            Self::Cone { slant, .. } => slant,
            Self::Torus { radius, from, to, .. } => radius * (to - from),
        }
    }

    /// Returns the Gaussian curvature in the middle, 1/m^2.
    #[must_use]
    pub fn gaussian_curvature(&self) -> f64 {
        match *self {
            Self::Torus { radius, .. } => 1.0 / (radius * self.cross_radius(0.5)),
            _ => 0.0,
        }
    }

    /// Returns the radius of curvature across the meridian at the share `t` of it.
    #[must_use]
    pub fn cross_radius(&self, t: f64) -> f64 {
        let at = self.meridian(t);
        at.r / at.normal[0]
    }

    fn meridian(&self, t: f64) -> Meridian {
        match *self {
            Self::Cylinder { radius, height } => Meridian { r: radius, z: t * height, normal: [1.0, 0.0] },
            Self::Cone { from, to, slant } => {
                let (sin, cos) = half_angle(from, to, slant);
                let rho = from / sin + t * slant;
                Meridian { r: rho * sin, z: rho * cos, normal: [cos, -sin] }
            }
            Self::Torus { radius, centre, from, to } => {
                let (sin, cos) = (from + t * (to - from)).sin_cos();
                Meridian { r: centre + radius * sin, z: radius * cos, normal: [sin, cos] }
            }
        }
    }

    /// Returns half the angle about the axis that a plate covers at the share `t` of the meridian: half its part of the
    /// ring, less half a gap.
    #[must_use]
    pub fn half_width(&self, t: f64, plates: u32, gap: f64) -> f64 {
        PI / f64::from(plates) - 0.5 * gap / self.meridian(t).r
    }

    /// Returns the point at the share `t` of the meridian and the angle `turn` about the axis, `off` metres outside of
    /// the mid-surface.
    #[must_use]
    pub fn point(&self, t: f64, turn: f64, off: f64) -> [f64; 3] {
        let Meridian { r, z, normal } = self.meridian(t);
        let (sin, cos) = turn.sin_cos();
        let r = r + off * normal[0];
        [r * cos, r * sin, z + off * normal[1]]
    }

    /// Returns the place of that point in the plane: u across from the middle meridian, v along it.
    ///
    /// Cylinder and cone are developed exactly. On a sphere u is the distance from the middle meridian along the great
    /// circle across it, and v the place on the meridian where that circle leaves it. A torus is approximated by the
    /// sphere that touches it along the parallel circle through the point, with the torus's own meridian: correct to
    /// the second order of the angle.
    #[must_use]
    pub fn develop(&self, t: f64, turn: f64) -> [f64; 2] {
        match *self {
            Self::Cylinder { radius, height } => [radius * turn, t * height],
            Self::Cone { from, to, slant } => {
                let (sin, _) = half_angle(from, to, slant);
                let rho = from / sin + t * slant;
                let (s, c) = (turn * sin).sin_cos();
                [rho * s, rho * c]
            }
            Self::Torus { radius, from, to, .. } => {
                let polar = from + t * (to - from);
                let ((sin, cos), (sin_turn, cos_turn)) = (polar.sin_cos(), turn.sin_cos());
                let cross = self.cross_radius(t);
                let onward = (sin * cos_turn).atan2(cos) - polar;
                [cross * (sin * sin_turn).asin(), radius * polar + cross * onward]
            }
        }
    }

    /// Returns the target of a plate that extends from `v_from` to `v_to` along the middle meridian, in the coordinates
    /// of [`Self::develop`].
    #[must_use]
    pub fn target(&self, v_from: f64, v_to: f64) -> TargetShape {
        let axis = std::f64::consts::FRAC_PI_2;
        match *self {
            Self::Cylinder { radius, .. } => TargetShape::Cylinder { radius, axis },
            Self::Cone { from, to, slant } => {
                let (sin, cos) = half_angle(from, to, slant);
                TargetShape::Cone { axis, radius_start: v_from * sin / cos, radius_end: v_to * sin / cos }
            }
            Self::Torus { radius, centre, .. } => match centre == 0.0 {
                true => TargetShape::Sphere { radius },
                false => TargetShape::Torus { axis, radius, cross_radius: self.cross_radius(0.5) },
            },
        }
    }
}

/// Returns sine and cosine of the angle between a cone's straight lines and its axis.
fn half_angle(from: f64, to: f64, slant: f64) -> (f64, f64) {
    let sin = (to - from) / slant;
    (sin, (1.0 - sin * sin).sqrt())
}
