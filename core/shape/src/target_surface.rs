//! Target surface: closed-form position, normal and curvature of every material point on the target shape.
//!
//! `placement` is the rigid registration of a measured plate to it. In: the target of the plate file and the size of
//! the plate. Out: functions of (u, v). Not in Masuda et al.
//!
//! Frame: origin at the middle of the plate's mid-surface, x along u and y along v there, z towards the scanner.
//!
//! - Flat, cylinder and cone are isometric images of the rectangle.
//! - A sphere has (u, v) along its great circles from the middle.
//! - A torus is a circle along the axis direction swept along a circle across it.
//!
//! Limit: the stretching of a real plate differs from that of a sphere or torus by millimetres within the surface,
//! which does not change the deviation along the normal.

mod cone;
mod placement;

use std::f64::consts::TAU;

use crate::Vec3;
use crate::surface::Curvature;
use cone::Cone;
use platen_model::{FLATTEST_CONE, Facing, Plate, RadiusOf, Target, TargetShape};

pub use placement::Placement;

/// The target's mid-surface over the plate, with its scanned face.
#[derive(Debug, Clone)]
pub struct TargetSurface {
    form: Form,
    /// 1 when the centre of curvature lies on the scanner's side, else -1.
    side: f64,
    middle: [f64; 2],
    /// Cosine and sine of the axis direction.
    axis: [f64; 2],
    half_thickness: f64,
}

/// A shape of the mid-surface in the coordinates along the axis and across it, with its centre above.
#[derive(Debug, Clone, Copy)]
enum Form {
    Flat,
    Cylinder { radius: f64 },
    Cone(Cone),
    Sphere { radius: f64 },
    Torus { radius: f64, cross_radius: f64 },
}

/// One place of a form: point, normal towards the centre's side, curvatures along, across and twist.
#[derive(Debug, Clone, Copy)]
struct Place {
    point: Vec3,
    normal: Vec3,
    curvature: [f64; 3],
}

/// Reason why the numbers of a target describe no surface that this plate can take.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum TargetError {
    /// A radius is zero, negative, or not a number.
    #[error("target: a radius of {mm} mm is no radius; give one above 0", mm = radius * 1000.0)]
    NoRadius {
        /// Radius as given, metres.
        radius: f64,
    },
    /// The plate would roll up.
    #[error(
        "target: a radius of {radius_mm} mm rolls the plate's side of {side_mm} mm up; is it in millimetres?",
        radius_mm = radius * 1000.0, side_mm = side * 1000.0
    )]
    RollsUp {
        /// Radius as given, metres.
        radius: f64,
        /// The plate's shorter side, metres.
        side: f64,
    },
    /// A cone that is nearly flat.
    #[error(
        "target: the radius changes by {change_mm:.0} mm along a straight line of {length_mm:.0} mm, a cone as good as flat; \
         give the radii of curvature at the two ends of that line",
        change_mm = change * 1000.0, length_mm = length * 1000.0
    )]
    NearlyFlat {
        /// Change of the radius, metres.
        change: f64,
        /// Length of the straight line through the middle, metres.
        length: f64,
    },
}

impl TargetSurface {
    /// Returns the target of a plate.
    ///
    /// # Errors
    /// As [`TargetSurface::new`].
    pub fn of_plate(target: &Target, plate: &Plate) -> Result<Self, TargetError> {
        Self::new(target, plate.width, plate.height, plate.thickness)
    }

    /// Returns the target of a plate of `width` x `height` x `thickness` metres.
    ///
    /// Radii are converted to those of the mid-surface: half a thickness more than inside, less than outside. The radii
    /// of a cone are those of normal curvature, as measured by a template that stands upright on the plate.
    ///
    /// # Errors
    /// [`TargetError`] when a radius is not valid or would roll the plate up, or a cone is nearly flat.
    pub fn new(target: &Target, width: f64, height: f64, thickness: f64) -> Result<Self, TargetError> {
        let to_mid = match target.radius_of {
            RadiusOf::Inside => 0.5 * thickness,
            RadiusOf::Mid => 0.0,
            RadiusOf::Outside => -0.5 * thickness,
        };
        let side = width.min(height);
        let mid = |radius: f64| match radius.abs() {
            given if !radius.is_finite() || given <= thickness => Err(TargetError::NoRadius { radius }),
            given if side > TAU * given => Err(TargetError::RollsUp { radius, side }),
            _ => Ok(radius + to_mid),
        };
        let above_0 = |radius: f64| {
            if radius > 0.0 { mid(radius) } else { Err(TargetError::NoRadius { radius }) }
        };
        let (form, axis) = match target.shape {
            TargetShape::Flat => (Form::Flat, 0.0),
            TargetShape::Cylinder { radius, axis } => (Form::Cylinder { radius: above_0(radius)? }, axis),
            TargetShape::Sphere { radius } => (Form::Sphere { radius: above_0(radius)? }, 0.0),
            TargetShape::Torus { axis, radius, cross_radius } => {
                (Form::Torus { radius: above_0(radius)?, cross_radius: mid(cross_radius)? }, axis)
            }
            TargetShape::Cone { axis, radius_start, radius_end } => {
                let (sin, cos) = axis.sin_cos();
                let length = (width / cos.abs()).min(height / sin.abs());
                let change = radius_end - radius_start;
                let radius = 0.5 * (above_0(radius_start)? + above_0(radius_end)?);
                if change.abs() >= FLATTEST_CONE * length {
                    return Err(TargetError::NearlyFlat { change: change.abs(), length });
                }
                let form = Cone::new(radius, change / length).map_or(Form::Cylinder { radius }, Form::Cone);
                (form, axis)
            }
        };
        let side = if target.scanned_face == Facing::Inside { 1.0 } else { -1.0 };
        let (sin, cos) = axis.sin_cos();
        let middle = [0.5 * width, 0.5 * height];
        Ok(Self { form, side, middle, axis: [cos, sin], half_thickness: 0.5 * thickness })
    }

    /// Returns the position on the mid-surface.
    #[must_use]
    pub fn point(&self, u: f64, v: f64) -> Vec3 {
        self.turned(self.place(u, v).point)
    }

    /// Returns the unit normal, towards the scanner.
    #[must_use]
    pub fn normal(&self, u: f64, v: f64) -> Vec3 {
        self.turned(self.place(u, v).normal) * self.side
    }

    /// Returns the position on the scanned face.
    #[must_use]
    pub fn face(&self, u: f64, v: f64) -> Vec3 {
        let place = self.place(u, v);
        self.turned(place.point + place.normal * (self.side * self.half_thickness))
    }

    /// Returns the curvature of the mid-surface along the plate's own u and v, positive towards the scanner. On a
    /// torus, whose lines stretch, the directions are those of its circles.
    #[must_use]
    pub fn curvature(&self, u: f64, v: f64) -> Curvature {
        let [along, across, twist] = self.place(u, v).curvature.map(|k| k * self.side);
        let [c, s] = self.axis;
        let along_u = c * c * along - 2.0 * c * s * twist + s * s * across;
        let along_v = s * s * along + 2.0 * c * s * twist + c * c * across;
        let twist = c * s * (along - across) + (c * c - s * s) * twist;
        Curvature::from_form(along_u, along_v, twist)
    }

    /// Returns the direction on the plate in which the target bends most; `None` where all directions are equal.
    #[must_use]
    pub fn bending(&self, u: f64, v: f64) -> Option<[f64; 2]> {
        let k = self.curvature(u, v);
        // 1e-9 1/m: radii of 10 m that differ by 0.1 um.
        (k.max - k.min > 1e-9).then(|| k.strongest_direction())
    }

    /// Returns the target's curvature minus the measured one, 1/m: positive where the plate has to bend more in the
    /// target's sense.
    ///
    /// The direction is that in which the target bends most; where all directions are equal, that of the largest
    /// difference.
    #[must_use]
    pub fn deficit(&self, measured: &Curvature, u: f64, v: f64) -> f64 {
        let goal = self.curvature(u, v);
        let lacking = match self.bending(u, v) {
            Some(direction) => goal.along(direction) - measured.along(direction),
            None => (goal - *measured).strongest(),
        };
        lacking * self.side
    }

    /// Returns 1 when the centre of the (main) curvature lies on the scanner's side, else -1.
    #[must_use]
    pub fn side(&self) -> f64 {
        self.side
    }

    fn place(&self, u: f64, v: f64) -> Place {
        let ([c, s], x, y) = (self.axis, u - self.middle[0], v - self.middle[1]);
        self.form.place(c * x + s * y, c * y - s * x)
    }

    /// Converts (along, across, up on the centre's side) to (x, y, z towards the scanner).
    fn turned(&self, p: Vec3) -> Vec3 {
        let [c, s] = self.axis;
        Vec3::new(c * p.x - s * p.y, s * p.x + c * p.y, self.side * p.z)
    }
}

impl Form {
    fn place(&self, a: f64, b: f64) -> Place {
        match *self {
            Self::Flat => {
                Place { point: Vec3::new(a, b, 0.0), normal: Vec3::z(), curvature: [0.0, 0.0, 0.0] }
            }
            Self::Cylinder { radius } => {
                let (sin, cos) = (b / radius).sin_cos();
                Place {
                    point: Vec3::new(a, radius * sin, radius * (1.0 - cos)),
                    normal: Vec3::new(0.0, -sin, cos),
                    curvature: [0.0, 1.0 / radius, 0.0],
                }
            }
            Self::Cone(cone) => cone.place(a, b),
            Self::Sphere { radius } => {
                let distance = a.hypot(b);
                let (sin, cos) = (distance / radius).sin_cos();
                let outward = if distance > 0.0 { Vec3::new(a, b, 0.0) / distance } else { Vec3::zeros() };
                Place {
                    point: outward * (radius * sin) + Vec3::z() * (radius * (1.0 - cos)),
                    normal: Vec3::z() * cos - outward * sin,
                    curvature: [1.0 / radius, 1.0 / radius, 0.0],
                }
            }
            Self::Torus { radius, cross_radius } => {
                let (sin_a, cos_a) = (a / radius).sin_cos();
                let (sin_b, cos_b) = (b / cross_radius).sin_cos();
                let swept = cross_radius - radius * (1.0 - cos_a);
                Place {
                    point: Vec3::new(radius * sin_a, swept * sin_b, cross_radius - swept * cos_b),
                    normal: Vec3::new(-sin_a, -cos_a * sin_b, cos_a * cos_b),
                    curvature: [1.0 / radius, cos_a / swept, 0.0],
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
